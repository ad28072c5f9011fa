"""A number or claim of the paper, where it stands there, and how it is computed here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, isfinite

__all__ = ["Claim", "Row", "about", "at_least", "at_most", "between"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the paper says, and between which bounds what we find agrees with it."""

    section: str
    where: str  # text, equation, table or figure
    says: str
    paper: float | None  # the number in print; None: the paper gives none
    low: float
    high: float
    unit: str
    why: str  # these bounds
    find: Callable[[], float]

    @property
    def name(self) -> str:
        """Section, place and words: no two claims have the same."""
        return f"{self.section}, {self.where}: {self.says}"

    @property
    def tolerance(self) -> str:
        """The bounds in words."""
        if self.paper is not None and isfinite(self.high - self.low):
            return f"± {(self.high - self.low) / 2:.2g}"
        if self.low == -inf:
            return f"≤ {self.high:.4g}"
        if self.high == inf:
            return f"≥ {self.low:.4g}"
        return f"{self.low:.4g} to {self.high:.4g}"

    def row(self) -> Row:
        """Return the claim with what is found."""
        return Row(claim=self, found=float(self.find()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A claim and what was found of it, in the claim's unit."""

    claim: Claim
    found: float

    @property
    def deviation(self) -> float | None:
        """What was found less the number in print."""
        return None if self.claim.paper is None else self.found - self.claim.paper

    @property
    def holds(self) -> bool:
        """Whether it lies within the bounds; NaN does not."""
        return self.claim.low <= self.found <= self.claim.high

    @property
    def document(self) -> Mapping[str, float | str | bool | None]:
        """The row for JSON and CSV."""
        claim = self.claim
        return {
            "section": claim.section,
            "where": claim.where,
            "says": claim.says,
            "paper": claim.paper,
            "found": self.found,
            "unit": claim.unit,
            "deviation": self.deviation,
            "low": claim.low if isfinite(claim.low) else None,
            "high": claim.high if isfinite(claim.high) else None,
            "why": claim.why,
            "holds": self.holds,
        }


def about(
    section: str,
    where: str,
    says: str,
    paper: float,
    tolerance: float,
    find: Callable[[], float],
    *,
    unit: str = "",
    why: str = "rounding of the print",
) -> Claim:
    """Return the claim that a number is the one in print within a tolerance."""
    return Claim(
        section=section,
        where=where,
        says=says,
        paper=paper,
        low=paper - tolerance,
        high=paper + tolerance,
        unit=unit,
        why=why,
        find=find,
    )


def between(
    section: str,
    where: str,
    says: str,
    low: float,
    high: float,
    find: Callable[[], float],
    *,
    unit: str = "",
    why: str,
) -> Claim:
    """Return the claim that a number lies within bounds."""
    return Claim(
        section=section,
        where=where,
        says=says,
        paper=None,
        low=low,
        high=high,
        unit=unit,
        why=why,
        find=find,
    )


def at_least(
    section: str,
    where: str,
    says: str,
    low: float,
    find: Callable[[], float],
    *,
    unit: str = "",
    why: str,
) -> Claim:
    """Return the claim that a number is not below a bound."""
    return between(section, where, says, low, inf, find, unit=unit, why=why)


def at_most(
    section: str,
    where: str,
    says: str,
    high: float,
    find: Callable[[], float],
    *,
    unit: str = "",
    why: str,
) -> Claim:
    """Return the claim that a number is not above a bound."""
    return between(section, where, says, -inf, high, find, unit=unit, why=why)
