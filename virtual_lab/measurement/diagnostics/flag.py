"""A flag, and the probability of a false one.

There are two kinds of checks. A pair consists of two measurements of one quantity. Their difference
is compared with its uncertainty. A flag is raised if a difference of this size occurs by chance in
fewer than one of 2 000 faultless tests. It rules out a verdict if it occurs in fewer than one of
100 000. A band compares a number with wide limits, which a faultless laboratory never approaches.
Together the checks flag fewer than one faultless test in a hundred.

A check returns `Raised` or `Pairs` for a block of laboratories. `Flag` and `Discrepancy` are the
printed forms for one laboratory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from virtual_lab.uncertainty.budget import Budgets, Components, combine_components
from virtual_lab.units import Array, Mask

# probability of an equal or larger difference in a sound laboratory, below which it is flagged
REMARKED = 5e-4
CONTRADICTS = 1e-5  # the same probability, below which no verdict is possible
HARMLESS = 0.05  # shift of the result that is harmless [standard uncertainty of the result]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flag:
    """A contradiction in the records of one laboratory: name of the check, and a sentence."""

    name: str
    sentence: str
    invalidates: bool = False  # True: no verdict is possible; False: a remark


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """Result of a check: the laboratories of a block in which a flag is raised, possibly none."""

    name: str  # name of the check
    where: Mask  # mask of the laboratories in which it is raised, (laboratory,)
    sentence: Callable[[int], str]  # sentence for a laboratory in which it is raised
    invalidates: bool = False

    @property
    def voids(self) -> Mask:
        """True where no verdict on the bat is possible, (laboratory,)."""
        return self.where & self.invalidates

    def row(self, laboratory: int) -> Flag | None:
        """Return the flag of one laboratory, None if it is not raised there."""
        if not self.where[laboratory]:
            return None
        statement = self.sentence(laboratory)
        return Flag(name=self.name, sentence=statement, invalidates=self.invalidates)


@dataclass(frozen=True, slots=True, kw_only=True)
class Discrepancy:
    """The difference of two measurements of one quantity in one laboratory."""

    name: str  # name of the check
    of: str  # name of the pair within the check
    sentence: str
    sigmas: float  # difference in units of its standard uncertainty
    likely: float  # probability of an equal or larger difference in a sound laboratory
    # the same probability, if a difference too small to affect the result is treated as noise
    harmful: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs:
    """Result of a check: differences of two measurements of one quantity, arrays (laboratory,)."""

    name: str
    which: str
    statement: Callable[[int], str]  # sentence without the size in standard uncertainties
    compared: Mask  # mask of the laboratories with both measurements
    sigmas: Array
    likely: Array
    harmful: Array

    @property
    def where(self) -> Mask:
        """True where chance does not explain the difference, so that a flag is raised."""
        return self.compared & (self.likely < REMARKED)

    @property
    def voids(self) -> Mask:
        """True where the difference rules out a verdict, (laboratory,)."""
        return self.where & (self.harmful < CONTRADICTS)

    def difference(self, laboratory: int) -> Discrepancy | None:
        """Return the difference in one laboratory, None if the laboratory is not compared."""
        if not self.compared[laboratory]:
            return None
        sigmas = float(self.sigmas[laboratory])
        return Discrepancy(
            name=self.name,
            of=self.which,
            sentence=f"{self.statement(laboratory)}, a difference of {sigmas:.1f} standard "
            "uncertainties",
            sigmas=sigmas,
            likely=float(self.likely[laboratory]),
            harmful=float(self.harmful[laboratory]),
        )

    def row(self, laboratory: int) -> Flag | None:
        """Return the flag of one laboratory, None if it is not raised there."""
        if not self.where[laboratory]:
            return None
        difference = self.difference(laboratory)
        assert difference is not None
        voids = bool(self.voids[laboratory])
        return Flag(name=self.name, sentence=difference.sentence, invalidates=voids)


Answer = Raised | Pairs


def pairs(
    name: str,
    statement: Callable[[int], str],
    value: Array,
    components: Components,
    *,
    of: str = "",
    least: Array | float,
    moves: Array | float = inf,
    among: NDArray[Any] | int = 1,
    compared: Mask | None = None,
) -> Pairs:
    """Return a comparison of two measurements in each laboratory. Their difference should be 0.

    The arrays of the result are (laboratory,). `sigmas` is the absolute difference in units of its
    standard uncertainty. `likely` is the two-sided p-value of the hypothesis that the difference is
    0. `harmful` is a p-value too, but a small difference counts as noise: a difference that shifts
    the test result by `HARMLESS` of its u (see `moves`) is used as an additional standard
    uncertainty.

    Parameters
    ----------
    name
        Name of the check.
    statement
        Function that takes the index of a laboratory and returns the sentence of its flag. The
        sentence must not state the number of standard uncertainties, because the flag adds this
        number.
    value
        Difference of the two measurements, (laboratory,), in any unit.
    components
        Components of the uncertainty of `value`.
    of
        Name of the comparison, if the check makes several.
    least
        Additional standard uncertainty of `value`, in the same unit. It is added in quadrature, so
        the u of the difference is at least `least`.
    moves
        Largest possible shift of the test result if `value` changes by 1. The shift is in units of
        the standard uncertainty of the test result. By default it is infinite.
    among
        Number of differences from which `value` was chosen as the least likely. The p-values are
        corrected for this choice. 1 if nothing was chosen.
    compared
        Mask of the laboratories with both measurements, (laboratory,). By default all have both.
    """
    budget = combine_components(value, components)
    u, likely = chances(budget, least)
    moves = np.asarray(moves, dtype=float)
    harms = moves > 0
    spared = np.where(harms, HARMLESS / np.where(harms, moves, 1.0), 0.0)
    _, harmful = chances(budget, np.maximum(least, spared))
    # Noise has infinite degrees of freedom here, unlike the scatter of a few shots. The larger
    # probability is on the safe side.
    harmful = np.maximum(harmful, likely)
    everywhere = np.ones(value.shape, dtype=bool)
    return Pairs(
        name=name,
        which=of,
        statement=statement,
        compared=everywhere if compared is None else compared,
        sigmas=np.abs(value) / u,
        likely=_of_any(likely, among),
        harmful=np.where(harms, _of_any(harmful, among), 1.0),
    )


def chances(budget: Budgets, least: Array | float) -> tuple[Array, Array]:
    """Return the standard uncertainties and the two-sided p-values of values that should be 0.

    The values, their standard uncertainties and the degrees of freedom are those of `budget`. All
    arrays are (laboratory,). A p-value is the probability of an equal or larger absolute value by
    chance, for a t distribution.

    `least` is an additional standard uncertainty, in the unit of the values, with infinite degrees
    of freedom. It is added in quadrature to the uncertainties of `budget`.
    """
    u = np.hypot(budget.u, least)
    with np.errstate(divide="ignore"):  # a value without uncertainty of its own
        dof = budget.dof * (u / budget.u) ** 4  # Welch and Satterthwaite
    return u, np.asarray(2 * stdtr(np.minimum(dof, 1e9), -np.abs(budget.value) / u))


def _of_any(likely: Array, among: NDArray[Any] | int) -> Array:
    """Return the probability that the smallest of `among` p-values is at most `likely`."""
    with np.errstate(divide="ignore"):  # logarithm of 0 for a probability of 1
        return np.asarray(-np.expm1(among * np.log1p(-np.minimum(likely, 1.0))))
