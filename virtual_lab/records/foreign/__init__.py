"""Records that another laboratory wrote: a form it fills in, its own tables, its own units.

``laboratory.toml`` says which file holds which record and what its columns mean; what comes
out is a `Session` like any other, in SI and counted from 0. ``data/README.md`` has the form.
"""
