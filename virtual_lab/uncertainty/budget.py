"""First-order uncertainty by the GUM: each constant moved by its standard uncertainty.

The model is called once with a column of variants of every constant (the estimates, then each
one up, then each one down), so sensitivities come from the computation itself, shared
constants act on everything they touch, and their effects are never averaged away. Scatter
between hits enters as one type A component of the mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from virtual_lab.uncertainty.estimate import Estimate

__all__ = [
    "Budget",
    "Component",
    "Variants",
    "combine",
    "effective_dof",
    "interval_95",
    "propagate",
    "scatter",
    "type_a",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One line of a budget: what it comes from and what it does to the result."""

    name: str
    value: float
    u: float
    evaluation: str
    dof: float
    sensitivity: float  # of the result, per unit of the component
    contribution: float  # |sensitivity| u, in units of the result
    shift: float = 0.0  # of the result's mean by curvature, u² f''/2 (GUM F.2.4.4, note 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """A result's standard uncertainty and where it comes from, largest component first."""

    value: float
    u: float
    u_type_a: float
    u_type_b: float
    dof: float
    interval_95: tuple[float, float]
    shift: float  # of the mean by the curvature of all components; no correction is made
    components: tuple[Component, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variants:
    """Constants as columns (k, 1): the estimates, then each uncertain one up, then each down.

    What a model makes of the columns tells what each constant does to each of its outputs.
    """

    uncertain: Mapping[str, Estimate]
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, constants: Mapping[str, Estimate]) -> Self:
        """Return them; constants without uncertainty are moved by nothing."""
        uncertain = {name: known for name, known in constants.items() if known.u > 0}
        n = len(uncertain)
        columns = {name: np.full((2 * n + 1, 1), known.value) for name, known in constants.items()}
        for index, (name, known) in enumerate(uncertain.items()):
            columns[name][1 + index] += known.u
            columns[name][1 + n + index] -= known.u
        return cls(uncertain=uncertain, columns=columns)

    def components(self, values: Array) -> list[Component]:
        """Return what each constant contributes to an output of shape (k,)."""
        up, down = self._moved(values)
        effects, shifts = (up - down) / 2, (up + down) / 2 - values[0]
        return [
            Component(
                name=name,
                value=known.value,
                u=known.u,
                evaluation=known.evaluation,
                dof=known.dof,
                sensitivity=float(effect / known.u),
                contribution=abs(float(effect)),
                shift=float(shift),
            )
            for (name, known), effect, shift in zip(
                self.uncertain.items(), effects, shifts, strict=True
            )
        ]

    def u(self, values: Array) -> Array:
        """Return the standard uncertainties of a row of results, (n,), from outputs (k, n)."""
        up, down = self._moved(values)
        return np.asarray(np.sqrt(np.sum((up - down) ** 2, axis=0)) / 2)

    def _moved(self, values: Array) -> tuple[Array, Array]:
        n = len(self.uncertain)
        return values[1 : n + 1], values[n + 1 :]


def propagate(
    model: Callable[[Mapping[str, Array]], Mapping[str, Array]],
    constants: Mapping[str, Estimate],
) -> dict[str, list[Component]]:
    """Return, for every output of `model`, the components its constants contribute.

    Parameters
    ----------
    model
        Takes constants as columns (k, 1), returns outputs of shape (k,).
    constants
        Estimates; those without uncertainty contribute nothing and are left out.
    """
    variants = Variants.of(constants)
    return {
        output: variants.components(values) for output, values in model(variants.columns).items()
    }


def combine(value: float, components: Sequence[Component]) -> Budget:
    """Return the budget of a result with its components."""
    every = sorted(components, key=lambda part: -part.contribution)
    u = _root_sum([part.contribution for part in every])
    dof = effective_dof(every)
    return Budget(
        value=value,
        u=u,
        u_type_a=_root_sum([part.contribution for part in every if part.evaluation == "A"]),
        u_type_b=_root_sum([part.contribution for part in every if part.evaluation == "B"]),
        dof=dof,
        interval_95=interval_95(value, u, dof),
        shift=sum(part.shift for part in every),
        components=tuple(every),
    )


def scatter(hits: Array, weights: Array, groups: Array) -> Component:
    """Return the type A component of a weighted sum of hits, by their scatter at each place.

    Parameters
    ----------
    hits, weights, groups
        Shape (n,): values, what each weighs in the result, and the place each was taken at.
        Every place has its own variance, as aim matters more where the bat changes quickly; a
        place of a single hit has that of the others, pooled.
    """
    _, place = np.unique(groups, return_inverse=True)
    many = np.bincount(place)
    off = hits - (np.bincount(place, hits) / many)[place]
    squares, freedom = np.bincount(place, off**2), many - 1
    pooled = float(squares.sum()) / max(int(freedom.sum()), 1)
    variance = np.where(freedom > 0, squares / np.maximum(freedom, 1), pooled)
    parts = np.bincount(place, weights**2) * variance
    known = np.sum(parts[freedom > 0] ** 2 / freedom[freedom > 0])
    total = float(parts.sum())
    dof = total**2 / float(known) if known > 0 else inf
    return type_a("hits", float(hits @ weights), sqrt(total), dof=dof)


def type_a(name: str, value: float, u: float, *, dof: float = inf) -> Component:
    """Return a component of type A that is already in units of the result."""
    return Component(
        name=name,
        value=value,
        u=u,
        evaluation="A",
        dof=dof,
        sensitivity=1.0,
        contribution=u,
    )


def effective_dof(components: Sequence[Component]) -> float:
    """Return the Welch–Satterthwaite degrees of freedom (GUM G.2b)."""
    fourth = sum(part.contribution**4 / part.dof for part in components)
    u = _root_sum([part.contribution for part in components])
    return u**4 / fourth if fourth > 0 else inf


def interval_95(value: float, u: float, dof: float) -> tuple[float, float]:
    """Return the 95 % interval value ± t u, t of Student with `dof` degrees of freedom."""
    factor = float(stdtrit(min(dof, 1e9), 0.975))
    return value - factor * u, value + factor * u


def _root_sum(contributions: Sequence[float]) -> float:
    return sqrt(sum(part**2 for part in contributions))
