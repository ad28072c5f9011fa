"""Stored interlaboratory studies: joins their tables, and summarizes them for reports.

``python -m tests.studies.interlab PART.csv … ALL.csv SUMMARY.csv``
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from virtual_lab.studies.interlab.expected import summarise


def main(*paths: str) -> None:
    *parts, joined, summary = map(Path, paths)
    table = pd.concat([pd.read_csv(part, dtype=str, keep_default_na=False) for part in parts])
    table.to_csv(joined, index=False, lineterminator="\n")
    rows = pd.DataFrame(summarise(table.to_dict("records")))
    rows.to_csv(summary, index=False, lineterminator="\n", float_format="%.4g")


if __name__ == "__main__":
    main(*sys.argv[1:])
