"""Result of a method of propagation for the outputs of a model: numbers, budget and text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, inf, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.errors import InputError, nearest
from virtual_lab.files.dictionary import with_units
from virtual_lab.uncertainty.budget import Component
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd


CORRELATIONS = "correlations"  # row of a budget
LAST_BITS = 2.0**-44  # share of a value below which a difference is a rounding error


@dataclass(frozen=True, slots=True, kw_only=True)
class Convergence:
    """Convergence of numbers from draws: number of draws, and errors of the numbers."""

    draws: int
    standard_errors: tuple[float, ...]  # standard errors of value, u, and ends of the interval
    tolerance: float | None  # tolerance met with 95 % probability; None for a fixed number of draws


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """Joint coverage region of all outputs about their mean (JCGM 102, 7.7)."""

    mean: Array
    covariance: Array
    ellipsoid: float  # k_p: (y - mean)ᵀ V⁻¹ (y - mean) ≤ k_p²
    box: float  # k_q: every |y - mean| ≤ k_q u


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """An output of a model with its uncertainty and the first-order contribution of each input."""

    name: str
    value: float
    u: float
    dof: float
    interval: tuple[float, float]
    shift: float  # shift of the mean by the curvature of all inputs
    components: tuple[Component, ...]
    covariance: float = 0.0  # part of u² that the correlations of the inputs add, to first order
    shortest: tuple[float, float] | None = None  # shortest interval, by draws
    convergence: Convergence | None = None
    verdict: str = ""  # whether the first-order result is valid (JCGM 101, clause 8)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Propagated:
    """The outputs of a model by one method."""

    method: str
    probability: float
    outcomes: Mapping[str, Outcome]
    correlation: Array | None  # correlation of the outputs, (n, n)
    notes: tuple[str, ...]
    region: Region | None = None  # joint region of several outputs, by draws

    def __getitem__(self, name: str) -> Outcome:
        if name not in self.outcomes:
            allowed = f"{nearest(name, self.outcomes)}allowed: {', '.join(self.outcomes)}"
            raise InputError("", "output", name, allowed)
        return self.outcomes[name]

    @property
    def value(self) -> float:
        """Value of the output. Raises `InputError` if there are several outputs."""
        return self._only.value

    @property
    def u(self) -> float:
        """Standard uncertainty of the output. Raises `InputError` if there are several."""
        return self._only.u

    @property
    def dof(self) -> float:
        """Degrees of freedom of u, up to inf. Raises `InputError` for several outputs."""
        return self._only.dof

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the coverage interval. Raises `InputError` for several outputs."""
        return self._only.interval

    @property
    def _only(self) -> Outcome:
        if len(self.outcomes) > 1:
            names = ", ".join(self.outcomes)
            raise InputError(
                "", "output", None, f"there are several outputs; use [NAME] of {names}"
            )
        return next(iter(self.outcomes.values()))

    @property
    def table(self) -> pd.DataFrame:
        """Table with one row per output: value, u, degrees of freedom and ends of the interval."""
        import pandas as pd

        def row(outcome: Outcome) -> dict[str, Any]:
            columns = {key: getattr(outcome, key) for key in ("value", "u", "dof")}
            low, high = outcome.interval
            return {
                "output": outcome.name,
                "method": self.method,
                **columns,
                "low": low,
                "high": high,
            }

        return with_units(pd.DataFrame([row(outcome) for outcome in self.outcomes.values()]))

    @property
    def budget(self) -> pd.DataFrame:
        """Table with one row per pair of input and output, the largest share of an output first.

        If inputs are correlated, a last row has the share of their covariances, which may be below
        0.
        """
        import pandas as pd

        rows = []
        for outcome in self.outcomes.values():
            covariance = outcome.covariance
            total = sum(part.contribution**2 for part in outcome.components) + covariance
            for part in sorted(outcome.components, key=lambda each: -each.contribution):
                row = {"output": outcome.name, "component": part.name}
                for key in ("value", "u", "dof", "evaluation", "sensitivity", "contribution"):
                    row[key] = getattr(part, key)
                share = 100 * part.contribution**2 / total if total else 0.0
                rows.append(row | {"share_percent": share})
            if covariance:
                row = {"output": outcome.name, "component": CORRELATIONS}
                rows.append(row | {"share_percent": 100 * covariance / total if total else 0.0})
        return with_units(pd.DataFrame(rows))

    @property
    def text(self) -> str:
        """Outputs, method and notes, one per line."""
        lines = []
        for outcome in self.outcomes.values():
            value, low, high = (
                _round_to_u(each, outcome.u) for each in (outcome.value, *outcome.interval)
            )
            inside = f"{100 * self.probability:g} % in [{low}, {high}]"
            lines.append(f"{outcome.name} = {value}, u = {outcome.u:.2g}, {inside}")
            if 0 < outcome.u < inf:
                half = (outcome.interval[1] - outcome.interval[0]) / 2
                by_t = f"k = {half / outcome.u:.3g}, ν = {outcome.dof:.3g}"
                words = by_t if outcome.shortest is None else "half the width of the interval"
                lines.append(f"  U = {half:.2g}, {words}")
            if outcome.shortest and outcome.convergence:
                low, high = (_round_to_u(each, outcome.u) for each in outcome.shortest)
                lines.append(f"  shortest [{low}, {high}]; {outcome.convergence.draws} draws")
                lines.append(f"  {outcome.verdict}")
        if self.region:
            k = f"k = {self.region.ellipsoid:.4g}, box k = {self.region.box:.4g}"
            lines.append(f"all outputs together: ellipsoid {k}")
        return "\n".join([*lines, f"method: {self.method}", *self.notes])

    def __repr__(self) -> str:
        return self.text


def without_rounding(u: float, value: float) -> float:
    """Return `u`, or 0 if `u` is NaN or only a rounding error of `value`.

    A rounding error is at most 2^-44 of the absolute value. `u` and `value` have the same unit. The
    result is also 0 if `value` is NaN or infinite.
    """
    return u if u > LAST_BITS * abs(value) else 0.0


def correlation_of(covariance: Array) -> Array:
    """Return the matrix of correlation coefficients of a covariance matrix, (n, n).

    The diagonal is 1. An output with a variance of zero or NaN has the correlation 0 with all
    others.
    """
    u = np.sqrt(np.diag(covariance))
    scale = np.outer(u, u)
    return np.asarray(np.divide(covariance, scale, out=np.eye(u.size), where=scale > 0))


def _round_to_u(value: float, u: float) -> str:
    """Return a value as text, rounded to the second digit of u."""
    place = 1 - floor(log10(u)) if 0 < u < inf else 6
    return f"{value:.{place}f}" if 0 <= place <= 9 else f"{value:.7g}"
