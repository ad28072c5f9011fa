"""Scatter of laboratories in the stored interlaboratory studies, for comparison."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from virtual_lab.catalog.reading import DATA

TABLE = DATA / "uncertainty" / "interlab.csv"
UNLIKELY = 0.01  # one-sided p-value below which a scatter differs from the scatter of the study


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedScatter:
    """Standard deviations of a bat's result by a procedure, in the unit of its metric."""

    bat: str
    procedure: str
    repeats: float
    lots: float | None  # None: the study has one lot per laboratory, part of `laboratories`
    laboratories: float
    reproducibility: float
    cause: str  # factor with the largest effect

    def explain(self, found: float, results: int) -> str:
        """Return a sentence on the standard deviation `found` of two or more results."""
        from scipy.special import chdtrc

        square = (results - 1) * (found / self.reproducibility) ** 2
        above = float(chdtrc(results - 1, square))
        lots = "" if self.lots is None else f"lots {self.lots:.2g}, "
        verdict = "is what laboratories differ by"
        if above < UNLIKELY:
            verdict = f"is larger than that (p = {above:.1g})"
        elif 1 - above < UNLIKELY:
            verdict = f"is smaller than that (p = {1 - above:.1g})"
        return (
            "Simulated laboratories that test the same bat scatter by s_R "
            f"{self.reproducibility:.2g} (virtual-lab interlab, {self.bat}: repeats "
            f"{self.repeats:.2g}, {lots}laboratories {self.laboratories:.2g}; largest cause: "
            f"{self.cause}); the scatter here {verdict}"
        )


def expected_scatter(bat: str, procedure: str) -> ExpectedScatter | None:
    """Return the scatter of a bat's result between laboratories, from the stored studies.

    If no study of this bat and procedure is stored, the studies of other bats by this procedure are
    used, and the largest scatter is returned. The result is None if no study of the procedure is
    stored.
    """
    with TABLE.open(encoding="utf-8", newline="") as file:
        rows = [_read(row) for row in csv.DictReader(file) if row["procedure"] == procedure]
    same = [row for row in rows if row.bat == bat]
    return max(same or rows, key=lambda row: row.reproducibility, default=None)


def _read(row: Mapping[str, str]) -> ExpectedScatter:
    words = ("bat", "procedure", "cause")
    values: dict[str, Any] = {
        key: text if key in words else float(text) if text else None for key, text in row.items()
    }
    return ExpectedScatter(**values)
