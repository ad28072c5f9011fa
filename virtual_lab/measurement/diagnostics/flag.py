"""A flag, and the probability of a false one.

There are two kinds of checks. A pair is two measurements of one thing: their difference is
compared with its uncertainty. Chance exceeds it in one faultless test of two thousand before it is
remarked on, and in one of a hundred thousand before no verdict stands. A band compares a number
with wide limits that a faultless laboratory stays well within. Together they flag fewer than one
faultless test in a hundred.

A check answers for a block of laboratories, with `Raised` or `Pairs`; `Flag` and `Discrepancy` are
those of one laboratory, to be printed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from virtual_lab.uncertainty.budget import Component, Components, combined, types_a
from virtual_lab.units import Array, Mask

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
class Raised:
    """A flag in the laboratories of a block in which it is raised."""

    name: str  # of the check
    where: Mask  # (laboratory,)
    sentence: Callable[[int], str]  # of a laboratory in which it is raised
    invalidates: bool = False

    @property
    def voids(self) -> Mask:
        """True where nothing can be said of the bat, (laboratory,)."""
        return self.where & self.invalidates

    def of(self, laboratory: int) -> Flag | None:
        """Return the flag of one laboratory."""
        if not self.where[laboratory]:
            return None
        said = self.sentence(laboratory)
        return Flag(name=self.name, sentence=said, invalidates=self.invalidates)


@dataclass(frozen=True, slots=True, kw_only=True)
class Discrepancy:
    """The difference of two measurements of one thing."""

    name: str  # of the check
    of: str  # which of its pairs
    sentence: str
    sigmas: float  # the difference in its standard uncertainties
    likely: float  # chance of one as large in a sound laboratory
    harmful: float  # the same, where what would not move the result counts as noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs:
    """The differences of two measurements of one thing in a block, arrays (laboratory,)."""

    name: str
    which: str
    said: Callable[[int], str]  # sentence without the size in standard uncertainties
    compared: Mask  # where there are two measurements
    sigmas: Array
    likely: Array
    harmful: Array

    @property
    def where(self) -> Mask:
        """True where chance does not explain the difference."""
        return self.compared & (self.likely < REMARKED)

    @property
    def voids(self) -> Mask:
        """True where there can be no verdict."""
        return self.where & (self.harmful < CONTRADICTS)

    def difference(self, laboratory: int) -> Discrepancy | None:
        """Return the difference in one laboratory, None where there is none."""
        if not self.compared[laboratory]:
            return None
        sigmas = float(self.sigmas[laboratory])
        return Discrepancy(
            name=self.name,
            of=self.which,
            sentence=f"{self.said(laboratory)}, {sigmas:.1f} standard uncertainties",
            sigmas=sigmas,
            likely=float(self.likely[laboratory]),
            harmful=float(self.harmful[laboratory]),
        )

    def of(self, laboratory: int) -> Flag | None:
        """Return the flag it raises in one laboratory."""
        if not self.where[laboratory]:
            return None
        found = self.difference(laboratory)
        assert found is not None
        voids = bool(self.voids[laboratory])
        return Flag(name=self.name, sentence=found.sentence, invalidates=voids)


Answer = Raised | Pairs


def pairs(
    name: str,
    said: Callable[[int], str],
    value: Array,
    components: Components,
    *,
    of: str = "",
    least: Array | float,
    moves: Array | float = inf,
    among: NDArray[Any] | int = 1,
    compared: Mask | None = None,
) -> Pairs:
    """Return pairs whose differences `value`, (laboratory,), should be 0.

    Parameters
    ----------
    said
        Gives the sentence of a laboratory, without the size in standard uncertainties.
    components
        Of the uncertainty of `value`; `least` is a lower bound of it.
    moves
        What a unit of `value` may do to the result, in the result's standard uncertainties.
    among
        Number of like differences of which this is the least likely.
    compared
        Where there are two measurements; None: everywhere.
    """
    u, likely = chances(value, components, least=least)
    moves = np.broadcast_to(np.asarray(moves, dtype=float), value.shape)
    harms = moves > 0
    spared = np.where(harms, HARMLESS / np.where(harms, moves, 1.0), 0.0)
    _, harmful = chances(value, components, least=np.maximum(least, spared))
    # what counts as noise has endless degrees of freedom, which a scatter of few has not
    harmful = np.maximum(harmful, likely)
    everywhere = np.ones(value.shape, dtype=bool)
    return Pairs(
        name=name,
        which=of,
        said=said,
        compared=everywhere if compared is None else compared,
        sigmas=np.abs(value) / u,
        likely=_of_any(likely, among),
        harmful=np.where(harms, _of_any(harmful, among), 1.0),
    )


def chance(value: float, components: Sequence[Component], *, least: float) -> tuple[float, float]:
    """Return the uncertainty of a `value` that should be 0, and the chance of a larger one.

    `least` is a lower bound of the standard uncertainty.
    """
    u, likely = chances(np.array([value]), Components.listed(components), least=least)
    return float(u[0]), float(likely[0])


def chances(value: Array, components: Components, *, least: Array | float) -> tuple[Array, Array]:
    """Return uncertainties and chances of a block, as `chance` of each laboratory."""
    floor = types_a("scatter", np.zeros(value.shape), np.broadcast_to(least, value.shape))
    budget = combined(value, components + floor)
    likely = 2 * stdtr(np.minimum(budget.dof, 1e9), -np.abs(value) / budget.u)
    return budget.u, np.asarray(likely)


def _of_any(likely: Array, among: NDArray[Any] | int) -> Array:
    """Return the chance that the least likely of several is as unlikely as this."""
    with np.errstate(divide="ignore"):  # of a chance of 1
        return np.asarray(-np.expm1(among * np.log1p(-np.minimum(likely, 1.0))))
