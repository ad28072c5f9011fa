"""A flag, and the probability of a false one.

There are two kinds of checks. A pair is two measurements of one thing: their difference is
compared with its uncertainty. Chance exceeds it in one faultless test of two thousand before it is
remarked on, and in one of a hundred thousand before no verdict stands. A band compares a number
with wide limits that a faultless laboratory stays well within. Together they flag fewer than one
faultless test in a hundred.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import expm1, inf, log1p

from scipy.special import stdtr

from virtual_lab.uncertainty.budget import Component, combine, type_a

REMARKED = 5e-4  # chance of a difference as large in a sound laboratory, below which it is flagged
CONTRADICTS = 1e-5  # and below which no verdict stands
HARMLESS = 0.05  # standard uncertainties of the result, that a difference may move it


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A contradiction in the records: name of the check, and a sentence with the numbers."""

    name: str
    sentence: str
    invalidates: bool = False  # nothing can be said of the bat; else a remark


@dataclass(frozen=True, slots=True, kw_only=True)
class Discrepancy:
    """The difference of two measurements of one thing."""

    name: str  # of the check
    of: str  # which of its pairs
    sentence: str
    sigmas: float  # the difference in its standard uncertainties
    likely: float  # chance of one as large in a sound laboratory
    harmful: float  # the same, where what would not move the result counts as noise

    @property
    def flag(self) -> Flag | None:
        """The flag it raises, None where chance explains the difference."""
        if self.likely >= REMARKED:
            return None
        invalidates = self.harmful < CONTRADICTS
        return Flag(name=self.name, sentence=self.sentence, invalidates=invalidates)


def pair(
    name: str,
    said: str,
    value: float,
    components: Sequence[Component],
    *,
    of: str = "",
    least: float,
    moves: float = inf,
    among: int = 1,
) -> Discrepancy:
    """Return a pair whose difference `value` should be 0.

    Parameters
    ----------
    said
        Sentence without the size in standard uncertainties.
    components
        Of the uncertainty of `value`; `least` is a lower bound of it.
    moves
        What a unit of `value` may do to the result, in the result's standard uncertainties.
    among
        Number of like differences of which this is the least likely.
    """
    u, likely = chance(value, components, least=least)
    spared = HARMLESS / moves if moves > 0 else inf
    harmful = chance(value, components, least=max(least, spared))[1] if spared < inf else 1.0
    return Discrepancy(
        name=name,
        of=of,
        sentence=f"{said}, {abs(value) / u:.1f} standard uncertainties",
        sigmas=abs(value) / u,
        likely=_of_any(likely, among),
        harmful=_of_any(harmful, among),
    )


def chance(value: float, components: Sequence[Component], *, least: float) -> tuple[float, float]:
    """Return the uncertainty of a `value` that should be 0, and the chance of a larger one.

    `least` is a lower bound of the standard uncertainty.
    """
    floor = type_a("scatter", 0.0, least)
    budget = combine(value, [*components, floor])
    return budget.u, 2 * float(stdtr(min(budget.dof, 1e9), -abs(value) / budget.u))


def _of_any(likely: float, among: int) -> float:
    """Return the chance that the least likely of several is as unlikely as this."""
    return -expm1(among * log1p(-likely)) if likely < 1 else 1.0
