"""Records of another laboratory: a form that it fills in, and tables in the units it uses.

The form ``laboratory.toml`` describes the files and their columns; an empty form is in
``virtual_lab/docs/forms.md``. The result is a `Session` like any other, in SI and with indices from
0.
"""
