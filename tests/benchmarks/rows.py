"""Results of benchmarks: one row per result, with its target."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from math import isnan, nan
from pathlib import Path

from tests.benchmarks.machine import vectors

__all__ = ["Row", "line", "tell", "write_csv"]

COLUMNS = ("part", "what", "value", "unit", "error", "target", "verdict", "note")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One result, or a note why there is none."""

    part: str
    what: str
    value: float = nan
    unit: str = ""
    error: float = nan  # largest error of e_A with this result
    at_most: float | None = None
    at_least: float | None = None
    note: str = ""

    @property
    def target(self) -> str:
        """Target of the value, empty without one."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return "" if self.at_least is None else f">= {self.at_least:g}"

    @property
    def verdict(self) -> str:
        """Whether the target was reached; empty without a target."""
        if not self.target:
            return ""
        above = self.at_least is None or self.value >= self.at_least
        below = self.at_most is None or self.value <= self.at_most
        return "reached" if above and below else "MISSED"


def line(row: Row) -> str:
    """Return a row as a line of text."""
    large = "{:.0f}" if row.value >= 1000 else "{:.3g}"
    value = "" if isnan(row.value) else large.format(row.value)
    error = "" if isnan(row.error) else f"{row.error:.1e}"
    goal = f"{row.target} {row.verdict}".strip()
    rest = f"{row.unit:<8}{error:>8}  {goal:<16}  {row.note}"
    return f"  {row.what:<50}{value:>9} {rest}".rstrip()


def tell(name: str, rows: Iterable[Row], paths: Iterable[str]) -> None:
    """Print rows under a heading as they come, and write them as CSV to each path."""
    print(f"{name}, {datetime.now(UTC):%Y-%m-%d}, one core, {vectors()}")
    done = []
    for row in rows:
        done.append(row)
        print(line(row), flush=True)
    for path in paths:
        write_csv(done, Path(path))


def write_csv(rows: Iterable[Row], path: Path) -> None:
    """Write rows as CSV; a missing number is an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(COLUMNS)
        for row in rows:
            cells = [getattr(row, column) for column in COLUMNS]
            out.writerow(["" if _missing(cell) else cell for cell in cells])


def _missing(cell: object) -> bool:
    return isinstance(cell, float) and isnan(cell)
