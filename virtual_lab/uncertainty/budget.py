"""First-order uncertainty by the GUM: each constant is shifted by its standard uncertainty.

The model is called once with several values of every constant: first its estimates, then one set in
which each constant is shifted up, then one in which each is shifted down. The sensitivities
therefore come from the reduction itself, and a constant shared by all hits shifts them together and
does not average out. The scatter between hits is one type A component of the mean. The scatter that
constants cause because their effect differs from hit to hit is subtracted from it.

`Components` and `Budgets` hold a block of laboratories as arrays with a leading laboratory axis;
one laboratory is a block of one. `Component` and `Budget` are the printable rows of one laboratory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from math import inf, sqrt
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import AlignedArrays
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.uncertainty.scatter import HitVariance, Scatter
from virtual_lab.units import Array

HITS = "hits"  # name of the component for the scatter of the hits


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One line of a budget: a source of uncertainty and its effect on the result."""

    name: str
    value: float
    u: float
    evaluation: str
    dof: float
    sensitivity: float  # change of the result per unit of the component
    contribution: float  # |sensitivity| u, in units of the result
    shift: float = 0.0  # shift of the result's mean by curvature, u² f''/2 (GUM F.2.4.4, note 2)
    pool: str = ""  # pool of its estimate
    parts: tuple[Component, ...] = ()  # components summed up in the line of a pool


@dataclass(frozen=True, slots=True, kw_only=True)
class Components(AlignedArrays):
    """Sources of uncertainty and their effects on a result, arrays (laboratory, source)."""

    names: tuple[str, ...]
    evaluations: tuple[str, ...]
    pools: tuple[str, ...]
    value: Array
    u: Array
    dof: Array
    effect: Array  # signed effect of one standard uncertainty on the result
    shift: Array  # shift of the result's mean by curvature

    aligned: ClassVar = ("value", "u", "dof", "effect", "shift")

    def __add__(self, more: Components) -> Components:
        """Return both sets of sources."""
        return Components(
            names=self.names + more.names,
            evaluations=self.evaluations + more.evaluations,
            pools=self.pools + more.pools,
            **{
                name: np.concatenate([getattr(self, name), getattr(more, name)], axis=1)
                for name in self.aligned
            },
        )

    @property
    def sensitivity(self) -> Array:
        """Change of the result per unit of each source, 0 for a source without uncertainty."""
        uncertain = self.u > 0
        return np.where(uncertain, self.effect / np.where(uncertain, self.u, 1.0), 0.0)

    def row(self, laboratory: int) -> list[Component]:
        """Return the components of one laboratory that have an uncertainty.

        The component of the hits is always included.
        """
        sensitivity, uncertain = self.sensitivity, self.u[laboratory] > 0
        return [
            Component(
                name=name,
                value=float(self.value[laboratory, at]),
                u=float(self.u[laboratory, at]),
                evaluation=self.evaluations[at],
                dof=float(self.dof[laboratory, at]),
                sensitivity=float(sensitivity[laboratory, at]),
                contribution=abs(float(self.effect[laboratory, at])),
                shift=float(self.shift[laboratory, at]),
                pool=self.pools[at],
            )
            for at, name in enumerate(self.names)
            if uncertain[at] or name == HITS
        ]

    @property
    def line_names(self) -> tuple[str, ...]:
        """Names of `lines`: single sources first, then the pools."""
        alone = [name for name, pool in zip(self.names, self.pools, strict=True) if not pool]
        return (*alone, *dict.fromkeys(pool for pool in self.pools if pool))

    def lines(self) -> tuple[Array, Array]:
        """Return variance and degrees of freedom of each line of a budget, (laboratory, line).

        The sources of a pool share one line. The lines are in the order of `line_names`. The
        variance is in the squared unit of the result.
        """
        from virtual_lab.uncertainty.budget_kernel import add_lines

        line = _line_numbers(self.pools)
        square, dof = np.zeros((2, len(self.effect), line.max(initial=-1) + 1))
        # copies of views and of read-only arrays, for which the function would be compiled again
        effect, freedom = (np.require(each, float, ("C", "W")) for each in (self.effect, self.dof))
        add_lines(effect, freedom, line, square, dof)
        return square, dof


@lru_cache
def _line_numbers(pools: tuple[str, ...]) -> NDArray[np.int64]:
    """Return the line number of each source. Sources without a pool are first, then the pools."""
    alone, first = count(), pools.count("")
    number = {pool: at for at, pool in enumerate(dict.fromkeys(filter(None, pools)), first)}
    return np.array([number[pool] if pool else next(alone) for pool in pools], np.int64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """Standard uncertainty of one result, and its components, the largest contribution first."""

    value: float
    u: float
    u_type_a: float
    u_type_b: float
    dof: float
    interval_95: tuple[float, float]
    shift: float  # shift of the mean by the curvature of all components, not corrected
    components: tuple[Component, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Budgets(AlignedArrays):
    """Standard uncertainties of the results of a block, arrays (laboratory,)."""

    value: Array
    u: Array
    dof: Array
    components: Components
    scatter: Scatter | None = None  # scatter of the hits of this test alone

    aligned: ClassVar = ("value", "u", "dof", "components", "scatter")

    def row(self, laboratory: int) -> Budget:
        """Return the budget of one laboratory."""
        every = _pool_lines(self.components.row(laboratory))
        every.sort(key=lambda part: -part.contribution)
        value, u, dof = (float(array[laboratory]) for array in (self.value, self.u, self.dof))
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Variants(AlignedArrays):
    """Sets of constants for the first order: each uncertain constant is shifted by + u and by - u.

    The outputs of the model for these sets give the effect of each constant.
    """

    constants: Mapping[str, Estimates]
    uncertain: tuple[str, ...]  # names of the shifted constants
    value: Array  # values of the shifted constants, (laboratory, constant)
    stated: Array  # their stated u
    dof: Array

    aligned: ClassVar = ("constants", "value", "stated", "dof")

    @classmethod
    def of(cls, constants: Mapping[str, Estimates]) -> Self:
        """Return the variants of a block's constants; certain constants are not shifted."""
        uncertain = tuple(name for name, constant in constants.items() if constant.u.any())
        laboratories = next((len(constant.value) for constant in constants.values()), 1)

        def beside(field: str) -> Array:
            columns = [getattr(constants[name], field) for name in uncertain]
            return np.array(columns, float).reshape(-1, laboratories).T

        return cls(
            constants=constants,
            uncertain=uncertain,
            value=beside("value"),
            stated=beside("u"),
            dof=beside("dof"),
        )

    @property
    def sets(self) -> int:
        """Number of sets of constants."""
        return 2 * len(self.uncertain) + 1

    @property
    def columns(self) -> dict[str, Array]:
        """Values of each constant in the k sets, (laboratory, k, 1), the estimates first.

        Each access returns new arrays.
        """
        best = np.array([constant.value for constant in self.constants.values()], float)
        every = np.broadcast_to(best[..., None, None], (*best.shape, self.sets, 1))
        shifted = np.repeat(self.value.T[..., None, None], self.sets, axis=2)
        constant = np.arange(len(shifted))
        shifted[constant, :, constant + 1, 0] += self.stated.T
        shifted[constant, :, constant + 1 + len(shifted), 0] -= self.stated.T
        return {
            **dict(zip(self.constants, every, strict=True)),
            **dict(zip(self.uncertain, shifted, strict=True)),
        }

    def components(self, values: Array) -> Components:
        """Return the contribution of each constant to an output with the values `values`.

        `values`, (laboratory, k), are the outputs for the k sets of constants.
        """
        up, down = self._split_moves(values[..., None])
        estimates = [self.constants[name] for name in self.uncertain]
        return Components(
            names=self.uncertain,
            evaluations=tuple(each.evaluation for each in estimates),
            pools=tuple(each.pool for each in estimates),
            value=self.value,
            u=self.stated,
            dof=self.dof,
            effect=((up - down) / 2)[..., 0],
            shift=((up + down) / 2)[..., 0] - values[:, :1],
        )

    def u(self, values: Array) -> Array:
        """Return the standard uncertainties of results, (..., n), from outputs (..., k, n)."""
        return np.asarray(np.sqrt(np.sum(self.effects(values) ** 2, axis=-2)))

    def effects(self, values: Array) -> Array:
        """Return the effect of one standard uncertainty of each constant, (..., constant, n).

        `values` are the outputs of the columns, (..., k, n).
        """
        up, down = self._split_moves(values)
        return np.asarray((up - down) / 2)

    def _split_moves(self, values: Array) -> tuple[Array, Array]:
        n = len(self.uncertain)
        return values[..., 1 : n + 1, :], values[..., n + 1 :, :]


def combine_components(value: Array, components: Components) -> Budgets:
    """Return the combined standard uncertainty and degrees of freedom of results, (laboratory,).

    The contributions of the components add in quadrature. The degrees of freedom follow from the
    Welch-Satterthwaite formula (GUM G.4.1); they are inf if u is 0. Components of one pool have a u
    from one common scatter, so they count as one term with common degrees of freedom.

    Parameters
    ----------
    value
        Results, (laboratory,), which are returned unchanged.
    components
        Sources of uncertainty and their effects on the results.
    """
    from virtual_lab.uncertainty.budget_kernel import welch_satterthwaite

    square, freedom = components.lines()
    u, dof = np.empty((2, len(square)))
    welch_satterthwaite(square, freedom, u, dof)
    return Budgets(value=value, u=u, dof=dof, components=components)


def means_of_hits(
    variants: Variants,
    hits: Array,
    weights: Array,
    positions: Array,
    effects: Array,
    earlier: HitVariance | None = None,
) -> Budgets:
    """Return the budgets of weighted sums of hits, (laboratory,), in the unit of the hits.

    The sources of uncertainty are the constants, and the scatter of the hits that the constants do
    not explain.

    Parameters
    ----------
    variants
        Sets of constants: set 0 has the estimates, the others have one constant shifted by its u.
    hits
        Output of the model for each hit and set of constants, (laboratory, k, hit), where k is the
        index of a set of constants.
    weights
        Weight of each hit in the result, (laboratory, hit); 0 for a missing hit.
    positions
        Impact position of each hit, (laboratory, hit). The scatter is computed within each
        position.
    effects
        Derivative of the result with respect to each hit, (laboratory, hit); 0 for a missing hit.
        It differs from `weights` if a hit also shifts the impact position of the result.
    earlier
        Variance of a hit in earlier tests of each laboratory, pooled with the variance in this
        test. None: no earlier tests. `Budgets.scatter` has the scatter of this test alone.
    """
    value = weighted_sums(hits[:, :1], weights)[:, 0]
    constants = variants.components(weighted_sums(hits, effects))
    today = Scatter.of_hits(hits[:, 0], effects, positions, variants.effects(hits))
    scatter = today if earlier is None else today.pool_with(earlier)
    scattered = type_a_component(
        HITS, weighted_sums(hits[:, :1], effects)[:, 0], scatter.u, scatter.dof
    )
    return replace(combine_components(value, constants + scattered), scatter=today)


def weighted_sums(hits: Array, weights: Array) -> Array:
    """Return the weighted sum of the hits for each set of constants, (laboratory, k).

    `hits` holds the values of the hits, (laboratory, k, hit), for k sets of calibration constants
    and readings. `weights` is (laboratory, hit). A hit of weight 0 is left out even if it is NaN.
    """
    from virtual_lab.uncertainty.budget_kernel import weigh

    out = np.empty(hits.shape[:2])
    weigh(np.ascontiguousarray(hits), np.ascontiguousarray(weights, float), out)
    return out


def _pool_lines(components: Sequence[Component]) -> list[Component]:
    """Return the components, with all components of a pool combined in one line.

    The contribution of this line is the root sum of squares of its parts, and its u is their root
    mean square. Its degrees of freedom are those of the pool, and its sensitivity is positive.
    """
    lines = [part for part in components if not part.pool]
    pools: dict[str, list[Component]] = {}
    for part in components:
        if part.pool:
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
                sensitivity=contribution / u if u else 0.0,
                contribution=contribution,
                shift=sum(part.shift for part in parts),
                pool=name,
                parts=tuple(parts),
            )
        )
    return lines


def type_a_component(name: str, value: Array, u: Array, dof: Array | float = inf) -> Components:
    """Return a budget component of type A with sensitivity 1, in arrays (laboratory, 1).

    Parameters
    ----------
    name
        Name of the component.
    value, u
        Value and standard uncertainty in the unit of the result, (laboratory,).
    dof
        Degrees of freedom of `u`, (laboratory,) or one number for all laboratories.
    """
    column = (len(u), 1)
    return Components(
        names=(name,),
        evaluations=("A",),
        pools=("",),
        value=np.reshape(value, column),
        u=u[:, None],
        dof=np.full(u.shape, dof)[:, None],
        effect=u[:, None],
        shift=np.zeros(column),
    )


def interval_95(value: float, u: float, dof: float) -> tuple[float, float]:
    """Return the lower and upper end of the 95 % interval, value - t u and value + t u.

    The ends are in the unit of `value`. t is the coverage factor of Student's distribution with
    `dof` degrees of freedom, which may be inf.
    """
    factor = float(coverage_factors(np.array(dof)))
    return value - factor * u, value + factor * u


def coverage_factors(dof: Array, probability: float = 0.95) -> Array:
    """Return the coverage factor t of Student's distribution, dimensionless, in the shape of `dof`.

    The interval ± t u has the coverage probability `probability`. `dof` are the degrees of freedom
    of u and may be inf. The factor is NaN for degrees of freedom that are NaN, 0 or negative.
    """
    from scipy.special import stdtrit  # takes half a second to load, too long for a page

    return np.asarray(stdtrit(np.minimum(dof, 1e9), (1 + probability) / 2))


def _root_sum(contributions: Sequence[float]) -> float:
    return sqrt(sum(part**2 for part in contributions))
