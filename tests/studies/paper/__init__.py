"""Every number, figure and claim of the 2003 paper, compared with results of this program.

`python -m tests.studies.paper` prints the table; `tests/studies/test_paper.py` checks every row.
Figs. 2 to 4 of the paper are those of `virtual-lab profile`.
"""
