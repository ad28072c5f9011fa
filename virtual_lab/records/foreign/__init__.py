"""Records of another laboratory: a filled-in form, with tables and units of its choice.

``laboratory.toml`` describes the files and their columns; the result is a `Session` like any
other, in SI and with indices from 0. ``virtual_lab/docs/forms.md`` has the form.
"""
