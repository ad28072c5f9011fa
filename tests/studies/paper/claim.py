"""A number or statement of the paper, and its comparison with our result."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement of the paper, with the limits within which our result agrees."""

    section: str
    where: str  # location in the section: text, equation, table or figure
    says: str
    paper: float | None  # printed number; None for a statement without a number
    low: float
    high: float
    unit: str
    why: str  # reason for the limits
    find: Callable[[], float]
    lost: str = ""  # reason why our result is outside the limits; empty for a claim that holds

    @property
    def name(self) -> str:
        """Unique name of a claim: section, location in the section, and statement."""
        return f"{self.section}, {self.where}: {self.says}"

    @property
    def tolerance(self) -> str:
        """The limits as text."""
        if self.paper is not None and isfinite(self.high - self.low):
            return f"± {(self.high - self.low) / 2:.2g}"
        if self.low == -inf:
            return f"≤ {self.high:.4g}"
        if self.high == inf:
            return f"≥ {self.low:.4g}"
        return f"{self.low:.4g} to {self.high:.4g}"

    def row(self) -> Row:
        """Compute our result and return it with the claim."""
        return Row(claim=self, result=float(self.find()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A claim with our result, in the unit of the claim."""

    claim: Claim
    result: float

    @property
    def deviation(self) -> float | None:
        """Our result minus the printed number; None if the paper prints none."""
        return None if self.claim.paper is None else self.result - self.claim.paper

    @property
    def holds(self) -> bool:
        """Whether our result is within the limits; False for NaN."""
        return self.claim.low <= self.result <= self.claim.high

    @property
    def cells(self) -> dict[str, str]:
        """The row as printed."""
        claim, deviation = self.claim, self.deviation
        return {
            "section": claim.section,
            "where": claim.where,
            "claim": claim.says,
            "paper": "" if claim.paper is None else _number(claim.paper),
            "ours": _number(self.result),
            "deviation": "" if deviation is None else _format_signed(deviation),
            "tolerance": claim.tolerance,
            "unit": claim.unit,
            "holds": "yes" if self.holds else "NO",
        }


def read_claims(path: Path, finders: Mapping[str, Callable[..., float]]) -> Iterator[Claim]:
    """Yield the claims of a CSV table, in the order of its rows.

    These columns need an explanation:

    * `find`: the name of one of the `finders`, followed by its arguments. A finder is a function
      that computes our result for the claim. Only the method `Claim.row` calls it.
    * `paper`: the number printed in the paper. It is empty if the claim has no printed number.
    * `within`: tolerance. Our result may differ by this much from the printed number, upward or
      downward.
    * `low`, `high`: limits of our result if there is no printed number. An empty limit is infinite.
    * `lost`: the reason of a known disagreement.

    Raises `KeyError` for an unknown finder or a missing column. Raises `ValueError` for a number
    that cannot be read.
    """
    with path.open(encoding="utf-8", newline="") as table:
        for row in csv.DictReader(table):
            finder, *arguments = row["find"].split()
            paper = float(row["paper"]) if row["paper"] else None
            low, high = float(row["low"] or -inf), float(row["high"] or inf)
            if paper is not None:
                low, high = paper - float(row["within"]), paper + float(row["within"])
            yield Claim(
                section=row["section"],
                where=row["where"],
                says=row["says"],
                paper=paper,
                low=low,
                high=high,
                unit=row["unit"],
                why=row["why"],
                lost=row["lost"],
                find=partial(finders[finder], *map(argument, arguments)),
            )


def argument(word: str) -> float | str | None:
    """Return a word of a table as the argument of a finder: a number, a text, or None."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return None if word == "energy" else word  # the swing law of constant energy has no exponent


def _number(value: float) -> str:
    """Return a number with four significant digits, or as an integer from 1000 on."""
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.1e}" if 0 < abs(value) < 1e-3 else f"{value:.4g}"


def _format_signed(value: float) -> str:
    if abs(value) < 1e-12:  # rounding
        return "0"
    return f"{'-' if value < 0 else '+'}{_number(abs(value))}"
