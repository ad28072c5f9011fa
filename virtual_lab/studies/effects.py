"""Comparison of the real effect of every budget component with the stated one.

The error of a constant in one laboratory is its certified minus its true value. Over many
laboratories the errors of the metric are regressed on the errors of all constants: each
coefficient times the constant's u is the real effect of one standard uncertainty; the budget
states it as sensitivity times u. The residual of the regression belongs to the hits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt

import numpy as np

from virtual_lab.errors import InputError
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
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column
from virtual_lab.parameters import Positive, Seed
from virtual_lab.relations.pendulum import mean_amplitude_factor
from virtual_lab.sheets import AnyBat, AnyProcedure, Instruments, entry_name
from virtual_lab.simulation.physics.beam import barrel_radius
from virtual_lab.studies.coverage import each_laboratory
from virtual_lab.uncertainty.budget import HITS, Component
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Effect of one standard uncertainty of a component on the metric, stated and realised.

    The pooled balls, `hits` and the choice of a place have no sign: they are root mean squares.
    """

    bat: str
    procedure: str
    term: str = column("term of the budget")
    stated: float = column("effect stated", "SI", "+.3e")  # mean over laboratories
    realised: float | None = column("effect found", "SI", "+.3e")  # None: no true value
    se: float | None = column("its standard error", "SI", ".1e")
    apart: float | None = column("apart", "standard errors", "+.1f")
    laboratories: int = column("laboratories")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    """One laboratory: its error, its budget, and the errors of its inputs."""

    error: float  # error of the metric, without the error caused by the choice of a place
    choice: float  # error caused by the choice of a place; NaN if it cannot be separated
    components: Mapping[str, Component]
    off: Mapping[str, float]  # error of each constant: certificate minus truth
    across: Array  # impact positions across the bat minus the mean aim [m]


def effects(
    bat: AnyBat = "r161",
    *,
    procedure: AnyProcedure = "astm-f1881",
    laboratories: int = 1000,
    seed: Seed = 1,
    summed: bool = False,
    workers: Positive = 1,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Rows[Effect]:
    """Compare the stated and the realised effect of each component of the metric's budget.

    The table has one row per component, the largest first.

    Two components can differ for a known reason. The stated uncertainty of the slope along the
    barrel is the spread over many bats, but the study tests one bat: `realised` is one sample of
    `stated`, so `apart` is None. The same slope explains a deviation of the aim's effect. The
    component `hits` is stated for independent balls, but the balls are drawn from a dozen without
    replacement. If e is not proportional to e0, as for a hollow bat, the differences between balls
    then scatter the hits more than the mean (asa, six of twelve balls: 6 % of the component).

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    procedure
        The test procedure: a name in the catalog or a .toml file.

        Or a sheet: ``vl.procedure("bbcor").with_(valid_hits=8)``.
    laboratories
        Number of laboratories, at least four per component.
    seed
        Seed of the study; its laboratories are taken by number, from 0.
    summed
        Instruments write sums instead of every reading, and the bat is nominal: much faster.
    workers
        Number of processes, each with one thread, that share the laboratories.
    instruments
        Instruments and rigs with changed values, in place of those of the catalog.

        Sheets: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with the number of laboratories done and in total.

    Raises
    ------
    InputError
        Unknown names, or too few laboratories for the number of terms.
    """
    bat, procedure = entry_name(bat), entry_name(procedure)
    round_robin = RoundRobin.of(bat, procedure, summed=summed)
    found_of_all = each_laboratory(round_robin, _cases, laboratories, seed, workers, progress)
    cases = [case for block in found_of_all for case in block]
    names = list(dict.fromkeys(name for case in cases for name in case.components))
    if len(cases) < 4 * len(names) or not cases:
        least = f"{4 * len(names)} and more with a result, 4 for each of {len(names)} terms"
        raise InputError("", "laboratories", len(cases), f"allowed: {least}")
    regressors = {name: _errors_of(name, cases) for name in names}
    known = {name: errors for name, errors in regressors.items() if errors is not None}
    found, found_se, left = _regressed(np.array([case.error for case in cases]), known)
    rows = []
    for name in names:
        stated = _stated(name, cases)
        realised, se = found.get(name), found_se.get(name)
        if name == HITS:
            realised, se = left, left / sqrt(2 * (len(cases) - len(known) - 1))
        elif name == CHOICE:
            realised, se = _spread(np.array([case.choice for case in cases]))
        elif name == SLOPE_ERROR and AIM_ALONG in found:
            # one bat has one slope, so its error shows in the effect of the aim
            realised, se = found[AIM_ALONG] - _stated(AIM_ALONG, cases), found_se[AIM_ALONG]
        rows.append(
            Effect(
                bat=bat,
                procedure=procedure,
                term=name,
                stated=stated,
                realised=realised,
                se=se,
                apart=_apart(name, stated, realised, se),
                laboratories=len(cases),
            )
        )
    return Rows(
        name="effects",
        title=f"{bat} by {procedure}: the effect of every term of the budget on the metric",
        words="Effect: what one standard uncertainty of the term does to the metric. SI: its unit.",
        rows=sorted(rows, key=lambda row: -abs(row.stated)),
    )


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
        here = sealed.measurand.get(certification.procedure.metric) if alike else None
        choice = np.nan
        if here is not None:
            choice = here + components[CHOICE].value - sealed.measurand["metric"]
            error -= choice
    across = sealed.shots["across"] - sealed.constants["impact.cannon.across"]
    return _Case(error=error, choice=choice, components=components, off=_off(tested), across=across)


def _off(tested: BatTest) -> dict[str, float]:
    """Return the error of each uncertain constant: the laboratory's minus the true value."""
    session, lot = tested.certification.session, tested.sealed.balls.spec
    true = dict(tested.sealed.constants)
    true |= {"ball.radius": lot.radius, "ball.restitution_slope": lot.restitution.slope}
    known = {name: one.value for name, one in session.calibration.items()}
    off = {name: known[name] - value for name, value in true.items() if name in known}
    return off | _readings_off(tested, true) | _balls_off(tested, known | true)


def _readings_off(tested: BatTest, true: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of the mean bench readings, without instrument errors."""
    block = tested.certification.block
    found = {name: float(each.value[0]) for name, each in bench_constants(block).items()}
    bat, body = tested.sealed.bat_properties, tested.sealed.bat.body
    lever = float(bat["length"] - true["bench.pendulum.pivot_from_knob"] - bat["z_cm"])
    turning = float(bat["inertia_cm"] + bat["mass"] * lever**2)
    swung = turning + true["bench.pendulum.clamp_inertia"]
    moment = float(bat["mass"]) * lever + true["bench.pendulum.clamp_moment"]
    first, last = found["bat.first_amplitude"], found["bat.last_amplitude"]
    swings, offset = int(found["bat.swings"]), true["bench.pendulum.amplitude_offset"]
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
    return {name: found[name] - value for name, value in exact.items()}


def _balls_off(tested: BatTest, constants: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of each ball's mean e0 and of its slope that are caused by scatter."""
    readings, lot = observe_balls(tested.certification.block), tested.sealed.balls
    names = restitution_names(readings.mass.shape[-1])
    x = {name: np.array(value) for name, value in constants.items()}
    x |= dict.fromkeys([*names, SLOPE_REPEATABILITY], np.array(0.0))
    sloped = bool(np.ptp(readings.nominal_speed) > 0)
    if not sloped:
        del x[SLOPE_REPEATABILITY]
    found = measured_balls(x, readings)
    speed = np.full(len(names), float(np.squeeze(found.speed)))
    exact = lot.restitution_at(np.arange(len(names)), speed)
    off = dict(zip(names, (found.restitution[0, 0] - exact).tolist(), strict=True))
    if sloped:
        off[SLOPE_REPEATABILITY] = float(np.squeeze(found.slope)) - lot.spec.restitution.slope
    return off


def _errors_of(name: str, cases: list[_Case]) -> Array | None:
    """Return the standardised errors of a component, (case,), None if the truth lacks them."""
    if name == REPEATABILITY:
        parts = [case.components[name].parts if name in case.components else () for case in cases]
        moved = [
            sum(part.sensitivity * case.off[part.name] for part in each)
            for each, case in zip(parts, cases, strict=True)
        ]
        return np.asarray(np.array(moved) / _stated(name, cases))
    if name == "impact.aim.across_square":
        square = float(np.mean(np.concatenate([case.across for case in cases]) ** 2))
        off = [case.components[name].value - square for case in cases]
    elif all(name in case.off for case in cases):
        off = [case.off[name] for case in cases]
    else:
        return None
    u = sqrt(float(np.mean([case.components[name].u ** 2 for case in cases])))
    return np.asarray(np.array(off) / u)


def _stated(name: str, cases: list[_Case]) -> float:
    """Return the mean stated effect; the root mean square if it has no sign."""
    every = [case.components[name] for case in cases if name in case.components]
    if name in (REPEATABILITY, HITS, CHOICE):
        return sqrt(sum(part.contribution**2 for part in every) / len(cases))
    u = sqrt(sum(part.u**2 for part in every) / len(every))
    return u * sum(part.sensitivity for part in every) / len(cases)


def _regressed(
    error: Array, known: Mapping[str, Array]
) -> tuple[dict[str, float], dict[str, float], float]:
    """Return coefficients, their standard errors, and the standard deviation of the residual."""
    design = np.column_stack([np.ones(error.size), *known.values()])
    inverse = np.linalg.pinv(design)
    coefficients = inverse @ error
    rest = error - design @ coefficients
    left = sqrt(float(rest @ rest) / (error.size - design.shape[1]))
    se = left * np.linalg.norm(inverse, axis=1)
    return (
        dict(zip(known, coefficients[1:].tolist(), strict=True)),
        dict(zip(known, se[1:].tolist(), strict=True)),
        left,
    )


def _apart(name: str, stated: float, realised: float | None, se: float | None) -> float | None:
    """Return the deviation of an effect from the stated one in standard errors, if meaningful."""
    if name == SLOPE_ERROR or realised is None or not se:
        return None
    return (realised - stated) / se


def _spread(values: Array) -> tuple[float | None, float | None]:
    """Return the root mean square and its standard error, whatever the distribution."""
    values = values[np.isfinite(values)]
    if values.size < 2:
        return None, None
    square = values**2
    root = sqrt(float(square.mean()))
    return root, float(square.std(ddof=1)) / sqrt(values.size) / (2 * root) if root else None
