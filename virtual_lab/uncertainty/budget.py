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

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from virtual_lab.estimate import Estimate

__all__ = ["Budget", "Component", "combine", "effective_dof", "interval_95", "propagate"]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """A result's standard uncertainty and where it comes from, largest component first."""

    value: float
    u: float
    u_type_a: float
    u_type_b: float
    dof: float
    interval_95: tuple[float, float]
    components: tuple[Component, ...]


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
    uncertain = [name for name, known in constants.items() if known.u > 0]
    n = len(uncertain)
    columns = {name: np.full((2 * n + 1, 1), known.value) for name, known in constants.items()}
    for index, name in enumerate(uncertain):
        columns[name][1 + index] += constants[name].u
        columns[name][1 + n + index] -= constants[name].u
    components = {}
    for output, values in model(columns).items():
        effects = (values[1 : n + 1] - values[n + 1 :]) / 2
        components[output] = [
            Component(
                name=name,
                value=constants[name].value,
                u=constants[name].u,
                evaluation=constants[name].evaluation,
                dof=constants[name].dof,
                sensitivity=float(effect / constants[name].u),
                contribution=abs(float(effect)),
            )
            for name, effect in zip(uncertain, effects, strict=True)
        ]
    return components


def combine(value: float, components: Sequence[Component], hits: Array | None = None) -> Budget:
    """Return the budget of a result with its shared `components`.

    Where the result is the mean of `hits` (n,), n ≥ 2, their scatter is one component more.
    """
    every = list(components) if hits is None else [_scatter(value, hits), *components]
    every.sort(key=lambda part: -part.contribution)
    u = _root_sum([part.contribution for part in every])
    dof = effective_dof(every)
    return Budget(
        value=value,
        u=u,
        u_type_a=_root_sum([part.contribution for part in every if part.evaluation == "A"]),
        u_type_b=_root_sum([part.contribution for part in every if part.evaluation == "B"]),
        dof=dof,
        interval_95=interval_95(value, u, dof),
        components=tuple(every),
    )


def _scatter(value: float, hits: Array) -> Component:
    u = float(hits.std(ddof=1)) / sqrt(hits.size)
    return Component(
        name="hits",
        value=value,
        u=u,
        evaluation="A",
        dof=float(hits.size - 1),
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
