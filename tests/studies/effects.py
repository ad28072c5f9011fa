"""Comparison of the stated and the real effect of each component of the uncertainty budget.

    python -m tests.studies.effects BAT PROCEDURE LABORATORIES

The error of a constant is its certified minus its true value. Over many laboratories, the errors of
the metric are regressed on the errors of all constants, in units of u. A coefficient of this
regression is the real effect of one standard uncertainty; the stated effect is sensitivity times u
in the budget. The residual of the regression is the effect of the hits.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from virtual_lab.lab import BatTest, BlockTest, RoundRobin
from virtual_lab.measurement.procedure import CHOICE
from virtual_lab.measurement.reduction.observations import (
    REPEATABILITY,
    SLOPE_REPEATABILITY,
    bench_constants,
    observe_balls,
    restitution_names,
)
from virtual_lab.measurement.reduction.shot_algebra import SLOPE_ERROR, measured_balls
from virtual_lab.measurement.session_reduction import AIM_ALONG
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import quiet
from virtual_lab.output.tables import column, table_text
from virtual_lab.relations.pendulum import mean_amplitude_factor
from virtual_lab.simulation.physics.beam import barrel_radius
from virtual_lab.studies.coverage import each_laboratory
from virtual_lab.uncertainty.budget import HITS, Component
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Effect of one standard uncertainty of a component on the metric, stated and real.

    The effects of the balls, of `hits` and of the choice of a position are root mean squares and
    have no sign.
    """

    bat: str
    procedure: str
    component: str = column("term of the budget")
    unit: str  # SI unit of the metric
    # mean over laboratories
    stated_effect: float = column("stated effect", "SI", "+.3e")
    # None without a true value
    real_effect: float | None = column("real effect", "SI", "+.3e")
    real_effect_se: float | None = column("its standard error", "SI", ".1e")
    difference_in_se: float | None = column("difference", "standard errors", "+.1f")
    laboratories: int = column("laboratories")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    """Error, budget and errors of the inputs of one laboratory."""

    error: float  # error of the metric, without `choice`
    choice: float  # error caused by the choice of a position; NaN if unknown
    components: Mapping[str, Component]
    constant_errors: Mapping[str, float]  # error of each constant: certified minus true value
    across: Array  # impact positions across the bat minus the mean aim [m]


def effects(bat: str, procedure: str, laboratories: int, seed: int = 1) -> list[Effect]:
    """Return stated and real effect of each component of the budget, largest stated effect first.

    The effect is the change of the metric by one standard uncertainty u of the component. The
    instruments record summary values, and every laboratory tests the nominal bat. Raises
    `ValueError` if fewer than four laboratories per component have a result.

    For two components, the real effect can differ from the stated effect for a known reason.

    The first is the slope of the collision efficiency along the barrel. Its stated uncertainty is
    the spread of the slope over many bats, but the study tests one bat. For the slope,
    `real_effect` is the effect of the slope error of this one bat. It cannot be compared with the
    stated effect, and `difference_in_se` is None. The slope error also changes the real effect of
    the aim.

    The second is `hits`. Its stated effect is too large if the results differ between balls. This
    is the case if the bat-ball restitution is not proportional to the ball-wall restitution, as for
    a hollow bat. The stated effect assumes that each hit has an independent, randomly drawn ball.
    In fact, the hits use different balls of the same dozen. The differences between the balls
    increase the scatter of the hits, but they partly cancel in the mean. With the procedure
    ``asa``, which uses six of twelve balls for its six hits, the stated effect is 6 % too large.
    """
    round_robin = RoundRobin.of(bat, procedure, summed=True)
    blocks = each_laboratory(round_robin, _cases, laboratories, seed, 1, quiet)
    cases = [case for block in blocks for case in block]
    names = list(dict.fromkeys(name for case in cases for name in case.components))
    if len(cases) < 4 * len(names) or not cases:
        raise ValueError(f"{len(cases)} with a result, {4 * len(names)} are needed")
    regressors = {name: _errors_of(name, cases) for name in names}
    regressors_known = {name: errors for name, errors in regressors.items() if errors is not None}
    coefficients, coefficients_se, residual = _regress(
        np.array([case.error for case in cases]), regressors_known
    )
    rows, unit = [], METRICS[round_robin.setup.rules.spec.metric].si_unit
    for name in names:
        stated = _stated_effect(name, cases)
        realised, se = coefficients.get(name), coefficients_se.get(name)
        if name == HITS:
            realised, se = residual, residual / sqrt(2 * (len(cases) - len(regressors_known) - 1))
        elif name == CHOICE:
            realised, se = _spread(np.array([case.choice for case in cases]))
        elif name == SLOPE_ERROR and AIM_ALONG in coefficients:
            # One bat has one slope. The error of this slope changes the effect of the aim.
            realised, se = (
                coefficients[AIM_ALONG] - _stated_effect(AIM_ALONG, cases),
                coefficients_se[AIM_ALONG],
            )
        rows.append(
            Effect(
                bat=bat,
                procedure=procedure,
                component=name,
                unit=unit,
                stated_effect=stated,
                real_effect=realised,
                real_effect_se=se,
                difference_in_se=_difference(name, stated, realised, se),
                laboratories=len(cases),
            )
        )
    return sorted(rows, key=lambda row: -abs(row.stated_effect))


def _cases(tested: BlockTest) -> list[_Case]:
    return [_case(tested.of(one)) for one in np.flatnonzero(~tested.certified.invalid).tolist()]


def _case(tested: BatTest) -> _Case:
    certification, sealed = tested.certification, tested.sealed
    budget = certification.metric
    assert budget is not None
    components = {part.name: part for part in budget.components}
    error, choice = budget.value - sealed.measurand["metric"], 0.0
    if CHOICE in components:
        correction = certification.procedure.correction
        alike = correction is None or correction.method == "none"
        exact = sealed.measurand.get(certification.procedure.metric) if alike else None
        choice = np.nan
        if exact is not None:
            choice = exact + components[CHOICE].value - sealed.measurand["metric"]
            error -= choice
    across = sealed.shots["across"] - sealed.constants["impact.cannon.across"]
    return _Case(
        error=error,
        choice=choice,
        components=components,
        constant_errors=_constant_errors(tested),
        across=across,
    )


def _constant_errors(tested: BatTest) -> dict[str, float]:
    """Return the error of each constant, certified minus true value [SI], keyed by name."""
    session, lot = tested.certification.session, tested.sealed.balls.spec
    true = dict(tested.sealed.constants)
    true |= {"ball.radius": lot.radius, "ball.restitution_slope": lot.restitution.slope}
    certified = {name: estimate.value for name, estimate in session.calibration.items()}
    errors = {name: certified[name] - value for name, value in true.items() if name in certified}
    return errors | _reading_errors(tested, true) | _ball_errors(tested, certified | true)


def _reading_errors(tested: BatTest, true: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of the mean bench readings caused by scatter [SI], keyed by name."""
    constants = bench_constants(tested.certification.block)
    readings = {name: float(each.value[0]) for name, each in constants.items()}
    bat, body = tested.sealed.bat_properties, tested.sealed.bat.body
    lever = float(bat["length"] - true["bench.pendulum.pivot_from_knob"] - bat["z_cm"])
    turning = float(bat["inertia_cm"] + bat["mass"] * lever**2)
    swung = turning + true["bench.pendulum.clamp_inertia"]
    moment = float(bat["mass"]) * lever + true["bench.pendulum.clamp_moment"]
    first, last = readings["bat.first_amplitude"], readings["bat.last_amplitude"]
    swings, offset = int(readings["bat.swings"]), true["bench.pendulum.amplitude_offset"]
    faster = mean_amplitude_factor(np.array(first), np.array(last), swings) / mean_amplitude_factor(
        np.array(first - offset), np.array(last - offset), swings
    )
    period = 2 * np.pi * sqrt(swung / (moment * true["hall.gravity"]))
    exact = {
        "bat.mass": float(bat["mass"]) * true["bench.scale.span"] + true["bench.scale.zero"],
        "bat.length": float(bat["length"]) + true["bench.rule.offset"],
        "bat.balance": float(bat["z_cm"]) + true["bench.stand.offset"],
        "bat.barrel_radius": float(barrel_radius(body.profile)) + true["bench.rule.offset"],
        "bat.period": period * true["bench.pendulum.clock"] / float(faster),
    }
    return {name: readings[name] - value for name, value in exact.items()}


def _ball_errors(tested: BatTest, constants: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of e0 of each ball and of its slope caused by scatter, keyed by name."""
    readings, lot = observe_balls(tested.certification.block), tested.sealed.balls
    names = restitution_names(readings.mass.shape[-1])
    x = {name: np.array(value) for name, value in constants.items()}
    x |= dict.fromkeys([*names, SLOPE_REPEATABILITY], np.array(0.0))
    sloped = bool(np.ptp(readings.nominal_speed) > 0)
    if not sloped:
        del x[SLOPE_REPEATABILITY]
    balls = measured_balls(x, readings)
    speed = np.full(len(names), float(np.squeeze(balls.speed)))
    exact = lot.restitution_at(np.arange(len(names)), speed)
    errors = dict(zip(names, (balls.restitution[0, 0] - exact).tolist(), strict=True))
    if sloped:
        errors[SLOPE_REPEATABILITY] = float(np.squeeze(balls.slope)) - lot.spec.restitution.slope
    return errors


def _errors_of(name: str, cases: list[_Case]) -> Array | None:
    """Return the errors of a component in units of u, shape (case,); None if unknown."""
    if name == REPEATABILITY:
        parts = [case.components[name].parts if name in case.components else () for case in cases]
        shifts = [
            sum(part.sensitivity * case.constant_errors[part.name] for part in each)
            for each, case in zip(parts, cases, strict=True)
        ]
        return np.asarray(np.array(shifts) / _stated_effect(name, cases))
    if name == "impact.aim.across_square":
        square = float(np.mean(np.concatenate([case.across for case in cases]) ** 2))
        errors = [case.components[name].value - square for case in cases]
    elif all(name in case.constant_errors for case in cases):
        errors = [case.constant_errors[name] for case in cases]
    else:
        return None
    u = sqrt(float(np.mean([case.components[name].u ** 2 for case in cases])))
    return np.asarray(np.array(errors) / u)


def _stated_effect(name: str, cases: list[_Case]) -> float:
    """Return the mean stated effect of a component, or its root mean square if it has no sign."""
    every = [case.components[name] for case in cases if name in case.components]
    if name in (REPEATABILITY, HITS, CHOICE):
        return sqrt(sum(part.contribution**2 for part in every) / len(cases))
    u = sqrt(sum(part.u**2 for part in every) / len(every))
    return u * sum(part.sensitivity for part in every) / len(cases)


def _regress(
    error: Array, regressors: Mapping[str, Array]
) -> tuple[dict[str, float], dict[str, float], float]:
    """Return coefficients and their standard errors, keyed by name, and the sd of the residuals."""
    design = np.column_stack([np.ones(error.size), *regressors.values()])
    inverse = np.linalg.pinv(design)
    coefficients = inverse @ error
    residuals = error - design @ coefficients
    residual = sqrt(float(residuals @ residuals) / (error.size - design.shape[1]))
    se = residual * np.linalg.norm(inverse, axis=1)
    return (
        dict(zip(regressors, coefficients[1:].tolist(), strict=True)),
        dict(zip(regressors, se[1:].tolist(), strict=True)),
        residual,
    )


def _difference(name: str, stated: float, realised: float | None, se: float | None) -> float | None:
    """Return real minus stated effect in standard errors; None if not comparable."""
    if name == SLOPE_ERROR or realised is None or not se:
        return None
    return (realised - stated) / se


def _spread(values: Array) -> tuple[float | None, float | None]:
    """Return the root mean square of `values` and its standard error, for any distribution.

    Both are None for fewer than two finite values.
    """
    values = values[np.isfinite(values)]
    if values.size < 2:
        return None, None
    square = values**2
    root = sqrt(float(square.mean()))
    return root, float(square.std(ddof=1)) / sqrt(values.size) / (2 * root) if root else None


if __name__ == "__main__":
    print(table_text(effects(*sys.argv[1:3], int(sys.argv[3]))))
