"""Uncertainty of any model: a user's function, its inputs, and a method of propagation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import compress
from typing import Any

import numpy as np

from virtual_lab.errors import InputError, nearest
from virtual_lab.parameters import AnyModel, Certain, DrawsRule, Propagation, Seed
from virtual_lab.uncertainty.budget import (
    Components,
    Variants,
    combine_components,
    coverage_factors,
)
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.uncertainty.inputs import Correlations, InputName, Inputs, read_inputs
from virtual_lab.uncertainty.models import Model, Outputs
from virtual_lab.uncertainty.monte_carlo import MONTE_CARLO, MOST_DRAWS, RULES, Drawing, monte_carlo
from virtual_lab.uncertainty.propagated import (
    LAST_BITS,
    Outcome,
    Propagated,
    correlation_of,
    without_rounding,
)
from virtual_lab.uncertainty.second_order import SecondOrder
from virtual_lab.units import Array, Mask

FIRST, SECOND = "first-order", "second-order"
STEEP = 100.0  # ratio of neighboring differences above which a model jumps or bends
BESIDE = "{} jumps within u of {}: first order takes the slope beside the jump, draws cross it"
ACROSS = "{} jumps or bends within u of {}, so first order does not describe it; compare draws"


def propagate_inputs(
    model: AnyModel,
    inputs: Mapping[InputName, Any],
    *,
    correlations: Correlations | None = None,
    method: Propagation = "first-order",
    probability: Certain = 0.95,
    digits: int = 2,
    draws: int | None = None,
    rule: DrawsRule = "stein",
    validate: bool = False,
    seed: Seed = 0,
    progress: Callable[[str, int, int], object] = lambda _text, _done, _total: None,
) -> Propagated:
    """Return the uncertainty of a function's result from the uncertainties of its arguments.

    Parameters
    ----------
    model
        A function of named inputs that returns one number, or a mapping of names to numbers. It is
        called for k sets of inputs at a time, with an array (k,) per input, and returns arrays
        (k,). If it accepts only numbers, it is called for one set at a time, and a note says so. An
        input that consists of n observations is passed as an array (k, n), or as (n,) for one set.
    inputs
        The value for a name is an `Input`, a number without uncertainty, or readings (n,). The mean
        of the readings and its standard uncertainty are used. The value for a tuple of m names is
        an array of readings (n, m) that were taken together.
    correlations
        Correlation coefficients of pairs of inputs, ``{("a", "b"): 0.5}``. All other coefficients
        are 0.
    method
        ``first-order`` is the law of propagation of GUM 5.1. Each input is changed by +u and by -u
        to find its sensitivity. The degrees of freedom follow from the Welch–Satterthwaite formula.
        If the model jumps within u of an input, as an angle at ±π, the slope beside the jump is
        used and a note says so. If there is no clear slope, the note says that.

        ``second-order`` adds the terms of GUM 5.1.2, note, to mean and variance.

        ``monte-carlo`` is JCGM 101, and JCGM 102 for several outputs. It gives the
        probabilistically symmetric and the shortest interval. If a single draw causes more than
        15 % of the variance, as for 1/x about 0, u is infinite and the value is the median.
    probability
        Coverage probability of the interval, between 0 and 1.
    digits
        Number of significant digits of u, 1 to 15. If `draws` is None, Monte Carlo draws continue
        until value, u and ends of the interval are accurate to half a unit of the last of these
        digits.
    draws
        Number of Monte Carlo draws, rounded up to a multiple of 16 384, and at least 32 768. None:
        `rule` determines the number.
    rule
        Rule for the number of draws. ``stein`` meets all tolerances together with a probability of
        95 %. ``7.9`` is the rule of JCGM 101, 7.9.
    validate
        Whether Monte Carlo draws continue until they are five times as accurate as `digits`
        requires. JCGM 101, clause 8, requires this to judge whether the first-order result is
        valid. With two digits this takes about 1 to 80 million draws: up to some seconds for a
        product of two inputs, and up to an hour for a model of 50 µs that accepts only numbers.
    seed
        Seed of the draws.
    progress
        Function that is called with a message, the number of draws made, and the number of all
        draws. By default ``vl.propagate`` shows the progress of long runs on stderr.

    Raises
    ------
    InputError
        An argument is not allowed. An input, a correlation or an output of the model cannot be
        used. No input has an uncertainty. Too many draws are needed. The model gives different
        results for the same inputs.
    """
    named_method(method, "method")
    if not 0 < probability < 1:
        raise InputError("", "probability", probability, "allowed: between 0 and 1")
    if rule not in RULES:
        raise InputError("", "rule", rule, f"{nearest(rule, RULES)}allowed: {', '.join(RULES)}")
    for key, count, most in (("digits", digits, 15), ("draws", draws, MOST_DRAWS)):
        if count is not None and not 1 <= count <= most:
            raise InputError("", key, count, f"allowed: 1 to {most}")
    read = read_inputs(inputs, correlations or {})
    if not read.sources:
        raise InputError("inputs", "u", None, "none has an uncertainty; allowed: at least one")
    called = Model.try_out(model, read)
    linear = first_order(called, probability)
    drawing = Drawing(
        probability=probability,
        digits=digits,
        draws=draws,
        rule=rule,
        validate=validate,
        seed=seed,
        progress=progress,
    )
    result = METHODS[method](called, linear, drawing)
    called.require_same()
    return result


def first_order(model: Model, probability: float) -> Propagated:
    """Return value, u, interval and components of each output by first order (GUM 5.1).

    The result also has the correlation between the outputs, which is caused by their common inputs.
    `probability` is the coverage probability of the interval. A note names the inputs within whose
    u an output jumps or bends. Raises `InputError` for an output that cannot be used.
    """
    inputs = model.inputs
    variants = Variants.of(
        {name: Estimates.stack([each.estimate]) for name, each in inputs.sources.items()}
    )
    answers, notes = _without_jumps(model, variants)
    outcomes, effects = {}, []
    for name, values in answers.items():
        components = variants.components(values[None])
        turned = _independent(components, inputs)
        budgets = combine_components(values[:1], turned)
        u, dof = without_rounding(float(budgets.u[0]), float(values[0])), float(budgets.dof[0])
        parts = combine_components(values[:1], components).row(0)
        outcomes[name] = Outcome(
            name=name,
            value=float(values[0]),
            u=u,
            dof=dof,
            interval=_interval(float(values[0]), u, dof, probability),
            shift=float(components.shift.sum()),
            components=parts.components,
            covariance=u**2 - parts.u**2 if inputs.joints else 0.0,
        )
        effects.append(turned.effect[0])
    return Propagated(
        method=FIRST,
        probability=probability,
        outcomes=outcomes,
        correlation=correlation_of(np.array(effects) @ np.array(effects).T),
        notes=_notes(model) + notes,
    )


def _without_jumps(model: Model, variants: Variants) -> tuple[Outputs, tuple[str, ...]]:
    """Return the outputs for all sets of constants, (k,), and notes on jumps and bends.

    An input is suspect if the changes of an output for +u and for -u differ by a large factor. The
    model is then also called with half of each step. If one of the four differences of an input
    exceeds the others by a large factor, the output jumps there. If the others agree, the outputs
    for + u and - u are replaced by those of a line with their slope. An output bends if its changes
    differ by a large factor for u and for u/2.
    """
    columns = {name: column[0, :, 0] for name, column in variants.columns.items()}
    answers, n, notes = model(columns), len(variants.uncertain), []
    halves: Outputs = {}
    for name, values in answers.items():
        rounding = LAST_BITS * float(np.abs(values).max())

        def differ(a: Array, b: Array, factor: float = STEEP, least: float = rounding) -> Mask:
            small, large = np.sort(np.abs([a, b]), axis=0)
            return np.asarray(large > factor * small + least)

        middle, up, down = values[0], values[1 : n + 1], values[n + 1 :]
        above, below = up - middle, middle - down
        if not differ(above, below, STEEP / 2).any():
            continue
        halves = halves or model({key: (each + each[0]) / 2 for key, each in columns.items()})
        near_up, near_down = halves[name][1 : n + 1], halves[name][n + 1 :]
        steps = np.diff([down, near_down, np.full(n, middle), near_up, up], axis=0)
        order = np.argsort(np.abs(steps), axis=0)
        *rest, largest = np.take_along_axis(steps, order, axis=0)
        jumps, bends = differ(largest, rest[-1]), differ(above, below) & differ(*steps[1:3])
        slope = np.mean(rest, axis=0)
        clear = jumps & (np.ptp(rest, axis=0) < np.abs(slope) / 2)
        up[clear], down[clear] = middle + 2 * slope[clear], middle - 2 * slope[clear]
        for mask, words in ((clear, BESIDE), ((jumps | bends) & ~clear, ACROSS)):
            if mask.any():
                notes.append(words.format(name, ", ".join(compress(variants.uncertain, mask))))
    return answers, tuple(notes)


def second_order(model: Model, linear: Propagated, _drawing: Drawing) -> Propagated:
    """Return value, u and interval of each output of a model, computed to second order.

    `linear` is the first-order result. Its degrees of freedom are kept. The correlation of the
    outputs is None. Raises `InputError` if the Taylor series of the
    model does not converge.
    """
    points = SecondOrder.of(model.inputs)
    answers = model(points.columns)
    outcomes = {}
    for name, outcome in linear.outcomes.items():
        value, u = points.moments(answers[name])
        u = without_rounding(u, value)
        interval = _interval(value, u, outcome.dof, linear.probability)
        outcomes[name] = replace(
            outcome, value=value, u=u, interval=interval, shift=value - outcome.value
        )
    return replace(linear, method=SECOND, outcomes=outcomes, correlation=None, notes=linear.notes)


METHODS: dict[str, Callable[[Model, Propagated, Drawing], Propagated]] = {
    FIRST: lambda _model, linear, _drawing: _with_zeros(linear),
    SECOND: second_order,
    MONTE_CARLO: monte_carlo,
}


def named_method(method: str, key: str = "uncertainty") -> Any:
    """Return `method` unchanged if it is a method of propagation.

    The methods are ``first-order``, ``second-order`` and ``monte-carlo``. Raises `InputError` for
    another name; `key` is the name of the argument in its message.
    """
    if method not in METHODS:
        allowed = f"{nearest(method, METHODS)}allowed: {', '.join(METHODS)}"
        raise InputError("", key, method, allowed)
    return method


def _independent(components: Components, inputs: Inputs) -> Components:
    """Return the components with each block of correlated inputs transformed to independent ones.

    The sum of their squared effects is then cᵀ V c, the variance of the result. Each block is one
    term in the formula for the degrees of freedom.
    """
    effect, dof, pools = components.effect.copy(), components.dof.copy(), list(components.pools)
    for number, joint in enumerate(inputs.joints):
        at = [components.names.index(name) for name in joint.names]
        effect[:, at] = (effect[:, at] / components.u[:, at]) @ joint.factor
        dof[:, at] = joint.dof
        for each in at:
            pools[each] = f"block {number}"
    return replace(components, effect=effect, dof=dof, pools=tuple(pools))


def _interval(value: float, u: float, dof: float, probability: float) -> tuple[float, float]:
    half = float(coverage_factors(np.array(dof), probability)) * u
    return value - half, value + half


def _notes(model: Model) -> tuple[str, ...]:
    rows = "the model is called row by row, because it accepts only numbers or mixes rows"
    return (rows,) if model.row_by_row else ()


def _with_zeros(linear: Propagated) -> Propagated:
    """Return the result with a note for each output with u = 0, which states the reason."""
    zeros = tuple(_u_is_zero(each) for each in linear.outcomes.values() if each.u == 0)
    return replace(linear, notes=linear.notes + zeros)


def _u_is_zero(outcome: Outcome) -> str:
    if outcome.covariance:
        return f"u of {outcome.name} is 0, because the errors of its correlated inputs cancel"
    if outcome.shift == 0:
        return f"u of {outcome.name} is 0, because no input changes it within the u of the input"
    return (
        f"u of {outcome.name} is 0 to first order, but the curvature shifts its mean by "
        f"{outcome.shift:.3g}; use method='second-order' or 'monte-carlo'"
    )
