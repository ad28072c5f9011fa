"""First-order uncertainty by the GUM: each constant is shifted by its standard uncertainty.

The model is called once with a column of variants of every constant: the estimates, then each
constant shifted up, then each one shifted down. So the sensitivities come from the reduction
itself, and a constant shared by all hits shifts them together and does not average out. The
scatter between hits is one type A component of the mean, after subtraction of the scatter that
comes from constants with different effects on different hits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One line of a budget: a source of uncertainty and its effect on the result."""

    name: str
    value: float
    u: float
    evaluation: str
    dof: float
    sensitivity: float  # of the result, per unit of the component
    contribution: float  # |sensitivity| u, in units of the result
    shift: float = 0.0  # of the result's mean by curvature, u² f''/2 (GUM F.2.4.4, note 2)
    pool: str = ""  # that of its estimate
    parts: tuple[Component, ...] = ()  # of a pool's line, what it sums up


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """Standard uncertainty of a result and its components, largest first."""

    value: float
    u: float
    u_type_a: float
    u_type_b: float
    dof: float
    interval_95: tuple[float, float]
    shift: float  # of the mean by the curvature of all components; no correction is made
    components: tuple[Component, ...]


class Variation(Protocol):
    """Constants shifted within their uncertainty, and the effects on the outputs of a model."""

    @property
    def columns(self) -> Mapping[str, Array]:
        """The constants as columns (k, 1), the estimates first."""
        ...

    def components(self, values: Array) -> list[Component]:
        """Return what the constants contribute to an output of shape (k,)."""
        ...

    def effects(self, values: Array) -> Array:
        """Return effects on outputs (k, ...), (m, ...): their squares add up to the variance."""
        ...

    def u(self, values: Array) -> Array:
        """Return the standard uncertainties of a row of results, (n,), from outputs (k, n)."""
        ...


Propagator = Callable[[Mapping[str, Estimate]], Variation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variants:
    """First order: each uncertain constant shifted up by its u, then each shifted down.

    The outputs of the model for these columns give the effect of each constant.
    """

    uncertain: Mapping[str, Estimate]
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, constants: Mapping[str, Estimate]) -> Self:
        """Return the variants; constants without uncertainty are not shifted."""
        uncertain = {name: known for name, known in constants.items() if known.u > 0}
        n = len(uncertain)
        columns = {
            name: np.full((2 * n + 1, 1), known.value, float) for name, known in constants.items()
        }
        for index, (name, known) in enumerate(uncertain.items()):
            columns[name][1 + index] += known.u
            columns[name][1 + n + index] -= known.u
        return cls(uncertain=uncertain, columns=columns)

    def components(self, values: Array) -> list[Component]:
        """Return what each constant contributes to an output of shape (k,)."""
        up, down = self._moved(values)
        effects, shifts = self.effects(values), (up + down) / 2 - values[0]
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
                pool=known.pool,
            )
            for (name, known), effect, shift in zip(
                self.uncertain.items(), effects, shifts, strict=True
            )
        ]

    def u(self, values: Array) -> Array:
        """Return the standard uncertainties of a row of results, (n,), from outputs (k, n)."""
        return np.asarray(np.sqrt(np.sum(self.effects(values) ** 2, axis=0)))

    def effects(self, values: Array) -> Array:
        """Return what one standard uncertainty of each constant does to outputs, (constant, ...).

        `values` are the outputs of the columns, (k, ...).
        """
        up, down = self._moved(values)
        return np.asarray((up - down) / 2)

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
        Estimates; those without uncertainty contribute nothing and are omitted.
    """
    variants = Variants.of(constants)
    return {
        output: variants.components(values) for output, values in model(variants.columns).items()
    }


def combine(value: float, components: Sequence[Component]) -> Budget:
    """Return the budget of a result; the components of a pool become one line."""
    every = sorted(_pooled(components), key=lambda part: -part.contribution)
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


def mean_of_hits(
    variants: Variation, hits: Array, weights: Array, places: Array, effects: Array | None = None
) -> Budget:
    """Return the budget of a weighted sum of hits: constants, then the remaining scatter.

    Parameters
    ----------
    variants, hits
        Constants, and the outputs of a model for their columns, (k, hit).
    weights, places
        Weight of each hit in the result, and its place, (hit,).
    effects
        Derivative of the result with respect to each hit, (hit,), if it differs from the weight.
    """
    effects = weights if effects is None else effects
    own = scatter(hits[0], effects, places, variants.effects(hits))
    return combine(float(hits[0] @ weights), [*variants.components(hits @ effects), own])


def _pooled(components: Sequence[Component]) -> list[Component]:
    """Return the components, each pool as one line: root sum of squares, dof of the pool.

    The u of the line is the root mean square of the parts' u; its sensitivity is positive.
    """
    lines = [part for part in components if not part.pool or part.parts]
    pools: dict[str, list[Component]] = {}
    for part in components:
        if part.pool and not part.parts:
            pools.setdefault(part.pool, []).append(part)
    for name, parts in pools.items():
        u = _root_sum([part.u for part in parts]) / sqrt(len(parts))
        contribution = _root_sum([part.contribution for part in parts])
        lines.append(
            Component(
                name=name,
                value=sum(part.value for part in parts) / len(parts),
                u=u,
                evaluation=parts[0].evaluation,
                dof=parts[0].dof,
                sensitivity=contribution / u,
                contribution=contribution,
                shift=sum(part.shift for part in parts),
                pool=name,
                parts=tuple(parts),
            )
        )
    return lines


def scatter(hits: Array, weights: Array, groups: Array, effects: Array | None = None) -> Component:
    """Return the type A component of a weighted sum of hits, by their scatter at each place.

    Parameters
    ----------
    hits, weights, groups
        Shape (n,): values, their weights in the result, and their places.
        Every place has a separate variance, because stray aim matters more where the bat's
        response changes quickly; a place with a single hit gets the pooled variance of the others.
    effects
        Shape (m, n): effect on each hit of one standard uncertainty of each constant in the same
        budget. The mean scatter that these effects cause within a place is subtracted from the
        variance of the place (never below 0), because the budget already contains it.
    """
    _, place = np.unique(groups, return_inverse=True)
    many = np.bincount(place)
    off = hits - (np.bincount(place, hits) / many)[place]
    squares, freedom = np.bincount(place, off**2), many - 1
    pooled = float(squares.sum()) / max(int(freedom.sum()), 1)
    seen = np.where(freedom > 0, squares / np.maximum(freedom, 1), pooled)
    square = np.bincount(place, weights**2)
    # a variance is as uncertain as before when a known part of it is taken off
    uncertain = (square * seen)[freedom > 0] ** 2 / freedom[freedom > 0]
    total = float(square @ np.maximum(seen - _explained(effects, place, freedom), 0.0))
    dof = total**2 / float(uncertain.sum()) if total > 0 and uncertain.sum() > 0 else inf
    return type_a("hits", float(hits @ weights), sqrt(total), dof=dof)


def _explained(effects: Array | None, place: NDArray[np.int_], freedom: NDArray[np.int_]) -> Array:
    """Return the mean variance within each place that constants cause, (place,).

    A place with a single hit gets the pooled value of the others.
    """
    if effects is None or not len(effects):
        return np.zeros(freedom.size)
    here = place[:, None] == np.arange(freedom.size)
    means = effects @ here / (freedom + 1)
    squares = np.sum((effects - means[:, place]) ** 2, axis=0) @ here
    pooled = float(squares.sum()) / max(int(freedom.sum()), 1)
    return np.where(freedom > 0, squares / np.maximum(freedom, 1), pooled)


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
    from scipy.special import stdtrit  # half a second to load, that a page must not wait for

    factor = float(stdtrit(min(dof, 1e9), 0.975))
    return value - factor * u, value + factor * u


def _root_sum(contributions: Sequence[float]) -> float:
    return sqrt(sum(part**2 for part in contributions))
