"""Uncertainty of any model: a function of a user's own, its inputs, and a method."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import floor, inf, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.errors import InputError, nearest
from virtual_lab.uncertainty.budget import (
    Component,
    Components,
    Variants,
    combined,
    coverage_factors,
)
from virtual_lab.uncertainty.inputs import Correlations, InputName, Inputs, read_inputs
from virtual_lab.uncertainty.models import Model
from virtual_lab.uncertainty.second_order import SecondOrder
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd

FIRST, SECOND = "first-order", "second-order"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """An output of a model with its uncertainty, and what each input contributes (first order)."""

    name: str
    value: float
    u: float
    dof: float
    interval: tuple[float, float]
    shift: float  # of the mean by curvature, all inputs
    components: tuple[Component, ...]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Propagated:
    """The outputs of a model, by one method, which it names."""

    method: str
    probability: float
    outcomes: Mapping[str, Outcome]
    correlation: Array | None  # of the outputs, (n, n)
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> Outcome:
        if name not in self.outcomes:
            allowed = f"{nearest(name, self.outcomes)}allowed: {', '.join(self.outcomes)}"
            raise InputError("", "output", name, allowed)
        return self.outcomes[name]

    @property
    def value(self) -> float:
        return self._only.value

    @property
    def u(self) -> float:
        return self._only.u

    @property
    def dof(self) -> float:
        return self._only.dof

    @property
    def interval(self) -> tuple[float, float]:
        return self._only.interval

    @property
    def _only(self) -> Outcome:
        if len(self.outcomes) > 1:
            names = ", ".join(self.outcomes)
            raise InputError("", "output", None, f"there are several; allowed: [NAME] of {names}")
        return next(iter(self.outcomes.values()))

    @property
    def table(self) -> pd.DataFrame:
        """A row an output."""
        import pandas as pd

        def row(one: Outcome) -> dict[str, Any]:
            columns = {key: getattr(one, key) for key in ("value", "u", "dof")}
            low, high = one.interval
            return {"output": one.name, "method": self.method, **columns, "low": low, "high": high}

        return pd.DataFrame([row(one) for one in self.outcomes.values()])

    @property
    def budget(self) -> pd.DataFrame:
        """A row an input and output, largest first: share of the sum of their squares."""
        import pandas as pd

        rows = []
        for one in self.outcomes.values():
            total = sum(part.contribution**2 for part in one.components)
            for part in sorted(one.components, key=lambda each: -each.contribution):
                own = {"output": one.name, "component": part.name}
                for key in ("value", "u", "dof", "evaluation", "sensitivity", "contribution"):
                    own[key] = getattr(part, key)
                share = 100 * part.contribution**2 / total if total else 0.0
                rows.append(own | {"share_percent": share})
        return pd.DataFrame(rows)

    @property
    def text(self) -> str:
        """Outputs, method and notes, a line each."""
        lines = []
        for one in self.outcomes.values():
            value, low, high = (_rounded(each, one.u) for each in (one.value, *one.interval))
            inside = f"{100 * self.probability:g} % in [{low}, {high}]"
            lines.append(f"{one.name} = {value}, u = {one.u:.2g}, {inside}")
        return "\n".join([*lines, f"method: {self.method}", *self.notes])

    def __repr__(self) -> str:
        return self.text


def propagate_inputs(
    model: Callable[..., Any],
    inputs: Mapping[InputName, Any],
    *,
    correlations: Correlations | None = None,
    method: str = FIRST,
    probability: float = 0.95,
) -> Propagated:
    """Return the uncertainty of a function's result from those of its arguments.

    Parameters
    ----------
    model
        A function of named inputs. It returns one number or a mapping of names to numbers; of
        rows of inputs, arrays (k,), the same of arrays. One that takes numbers only is called row
        by row, and a note says so. An input by groups of n observations is (k, n) or (n,).
    inputs
        By name an `Input`, a certain number, or readings (n,), whose mean and its scatter count;
        by a tuple of m names readings (n, m) that were taken together.
    correlations
        Between two inputs, ``{("a", "b"): 0.5}``; all others are 0.
    method
        ``first-order``: GUM 5.1 with differences over ± u, and Welch–Satterthwaite;
        ``second-order``: mean and variance with the terms of GUM 5.1.2, note.
    probability
        Of the coverage interval, between 0 and 1.

    Raises
    ------
    InputError
        An input, correlation or answer of the model that cannot be used.
    """
    if method not in METHODS:
        raise InputError("", "method", method, f"{nearest(method, METHODS)}allowed: {_methods()}")
    if not 0 < probability < 1:
        raise InputError("", "probability", probability, "allowed: between 0 and 1")
    read = read_inputs(inputs, correlations or {})
    if not read.sources:
        raise InputError("inputs", "u", None, "none has an uncertainty; allowed: at least one")
    called = Model.tried(model, read)
    linear = first_order(called, probability)
    return METHODS[method](called, linear)


def first_order(model: Model, probability: float) -> Propagated:
    """Return the first order of a model, with the correlation of its outputs."""
    inputs = model.inputs
    variants = Variants.of({name: each.estimate for name, each in inputs.sources.items()})
    answers = model({name: column[:, 0] for name, column in variants.columns.items()})
    outcomes, effects = {}, []
    for name, values in answers.items():
        components = variants.components(values)
        turned = _independent(components, inputs)
        budgets = combined(values[:1], turned)
        u, dof = float(budgets.u[0]), float(budgets.dof[0])
        outcomes[name] = Outcome(
            name=name,
            value=float(values[0]),
            u=u,
            dof=dof,
            interval=_interval(float(values[0]), u, dof, probability),
            shift=float(components.shift.sum()),
            components=combined(values[:1], components).of(0).components,
        )
        effects.append(turned.effect[0])
    found = Propagated(
        method=FIRST,
        probability=probability,
        outcomes=outcomes,
        correlation=_correlation(np.array(effects) @ np.array(effects).T),
        notes=_notes(model),
    )
    silent = [one.name for one in outcomes.values() if one.u == 0]
    return replace(found, notes=found.notes + tuple(_u_is_zero(outcomes[each]) for each in silent))


def second_order(model: Model, linear: Propagated) -> Propagated:
    """Return mean and u with the terms of second order; degrees of freedom are the first's."""
    points = SecondOrder.of(model.inputs)
    answers = model(points.columns)
    outcomes = {}
    for name, one in linear.outcomes.items():
        value, u = points.moments(answers[name])
        interval = _interval(value, u, one.dof, linear.probability)
        outcomes[name] = replace(one, value=value, u=u, interval=interval, shift=value - one.value)
    return replace(linear, method=SECOND, outcomes=outcomes, correlation=None, notes=_notes(model))


METHODS: dict[str, Callable[[Model, Propagated], Propagated]] = {
    FIRST: lambda _model, linear: linear,
    SECOND: second_order,
}


def _methods() -> str:
    return ", ".join(METHODS)


def _independent(components: Components, inputs: Inputs) -> Components:
    """Return the components with those of each block of correlated inputs turned independent.

    Their squares then add up to cᵀ V c, and a block is one term of the degrees of freedom.
    """
    effect, dof, pools = components.effect.copy(), components.dof.copy(), list(components.pools)
    for number, joint in enumerate(inputs.joints):
        at = [components.names.index(name) for name in joint.names]
        effect[:, at] = (effect[:, at] / components.u[:, at]) @ joint.factor
        dof[:, at] = joint.dof
        for each in at:
            pools[each] = f"block {number}"
    return replace(components, effect=effect, dof=dof, pools=tuple(pools))


def _correlation(covariance: Array) -> Array:
    u = np.sqrt(np.diag(covariance))
    scale = np.outer(u, u)
    return np.asarray(np.divide(covariance, scale, out=np.eye(u.size), where=scale > 0))


def _interval(value: float, u: float, dof: float, probability: float) -> tuple[float, float]:
    half = float(coverage_factors(np.array(dof), probability)) * u
    return value - half, value + half


def _rounded(value: float, u: float) -> str:
    """Return a value to the second digit of u."""
    place = 1 - floor(log10(u)) if 0 < u < inf else 6
    return f"{value:.{place}f}" if 0 <= place <= 9 else f"{value:.7g}"


def _notes(model: Model) -> tuple[str, ...]:
    rows = "the model takes numbers only or mixes rows: it is called row by row"
    return (rows,) if model.row_by_row else ()


def _u_is_zero(one: Outcome) -> str:
    if one.shift == 0:
        return f"u of {one.name} is 0: no input moves it within its u"
    return (
        f"u of {one.name} is 0 by the first order, but curvature shifts its mean by "
        f"{one.shift:.3g}: take method='second-order' or 'monte-carlo'"
    )
