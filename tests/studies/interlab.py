"""Stored interlaboratory studies: joins their tables, and summarizes them for reports.

``python -m tests.studies.interlab PART.csv … ALL.csv SUMMARY.csv``
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from virtual_lab.studies.interlab.expected import ExpectedScatter
from virtual_lab.studies.interlab.study import FACTORS


def summarize(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a summary of an interlaboratory study, one row per bat and procedure.

    `rows` is the table of `interlab`. The summary is the table that `expected_scatter` reads. If
    the procedure converts to a standard ball, only the converted result has a row. Raises
    `ValueError` if the study has no simulations in which only one factor varies, and `KeyError` for
    rows without a standard deviation of the study.
    """
    terms: dict[tuple[str, str, str], dict[str, float]] = {}
    for row in rows:
        if row["simulated"] not in ("", None):
            case = row["bat"], row["procedure"], row["result"]
            terms.setdefault(case, {})[row["term"]] = float(row["simulated"])
    summary = []
    for (bat, procedure, result), sds in terms.items():
        normalised = (bat, procedure, "normalized") in terms
        if result == ("normalized" if normalised else "as found"):
            scatter = ExpectedScatter(
                bat=bat,
                procedure=procedure,
                repeats=sds["s_r"],
                lots=sds.get("s_lot"),
                laboratories=sds["s_L"],
                reproducibility=sds["s_R"],
                cause=max(sds.keys() & set(FACTORS), key=lambda name: sds[name]),
            )
            summary.append(asdict(scatter))
    return summary


def main(*paths: str) -> None:
    *parts, joined, summary = map(Path, paths)
    table = pd.concat([pd.read_csv(part, dtype=str, keep_default_na=False) for part in parts])
    table.to_csv(joined, index=False, lineterminator="\n")
    rows = pd.DataFrame(summarize(table.to_dict("records")))
    rows.to_csv(summary, index=False, lineterminator="\n", float_format="%.4g")


if __name__ == "__main__":
    main(*sys.argv[1:])
