"""A flag, and the probability of a false one.

There are two kinds of checks. A test compares a number of zero mean with its uncertainty and
raises a flag at a deviation that chance exceeds in one faultless test of two thousand. A band
compares a number with wide limits that a faultless laboratory stays well within. Together they
flag fewer than one faultless test in a hundred.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import stdtr

from virtual_lab.uncertainty.budget import Component, combine, type_a

FALSE_ALARMS = 5e-4  # of one test, in a sound laboratory


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A contradiction in the records: name of the check, and a sentence with the numbers."""

    name: str
    sentence: str
    invalidates: bool = False  # nothing can be said of the bat; else a remark


def chance(value: float, components: Sequence[Component], *, least: float) -> tuple[float, float]:
    """Return the uncertainty of a `value` that should be 0, and the chance of a larger one.

    `least` is a lower bound of the standard uncertainty.
    """
    floor = type_a("scatter", 0.0, least)
    budget = combine(value, [*components, floor])
    return budget.u, 2 * float(stdtr(min(budget.dof, 1e9), -abs(value) / budget.u))
