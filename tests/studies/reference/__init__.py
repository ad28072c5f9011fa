"""Published measurements of bats, balls and tests, compared with results of this program.

`python -m tests.studies.reference` prints the table; `tests/studies/test_reference.py` checks every
row.
"""
