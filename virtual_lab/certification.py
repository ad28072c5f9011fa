"""A session judged and put into numbers: the metric, its uncertainty, the verdict.

This needs raw records, calibrations and the procedure, and nothing else; it is the same
computation whether the records come from this laboratory's rigs or from a folder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Datum, Entry, read
from virtual_lab.diagnostics import Evidence, Flag, flags
from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate
from virtual_lab.other_support import OtherSupport, other_support
from virtual_lab.procedure import (
    Curve,
    Finding,
    Judgement,
    Outcome,
    Procedure,
    Verdict,
    aimed_place,
    findings,
    judge,
    metric_of,
    outcome_of,
    shortfall,
    verdict,
)
from virtual_lab.reduction.measurement import (
    BatProperties,
    ShotResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.reduction.observations import (
    BallReadings,
    ImpactReadings,
    across_constant,
    ball_constants,
    bench_constants,
    observe_balls,
    observe_impact,
)
from virtual_lab.session import Session
from virtual_lab.uncertainty.budget import Budget, combine, propagate, scatter, type_a
from virtual_lab.width import Width, width_of

__all__ = [
    "CONTROL",
    "QUANTITIES",
    "Certification",
    "Reduced",
    "certify_session",
    "evaluate",
    "measure_bat",
    "reduce_session",
]

Array = NDArray[np.float64]

BAT_PROPERTIES = ("mass", "length", "z_cm", "inertia_cm")
POSITIVE = ("span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch")
PIVOT_TOLERANCE = 5e-3  # m, a rig this far off is another rig
CONTROL = "control.restitution_ratio"

QUANTITIES: Mapping[str, str] = {  # name in a certificate: the shots' field it is the mean of
    "bat_performance_factor": "bat_performance_factor",
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "recoil_factor": "lot_recoil_factor",
    "ball_restitution": "lot_ball_restitution",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Certification:
    """The outcome of one test, all of it measured."""

    session: Session
    procedure: Procedure
    procedure_sheet: tuple[Datum, ...]
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm
    shots: ShotResults
    shot_metric: Array  # (shot,)
    readings: ImpactReadings
    judgement: Judgement
    outcome: Outcome
    metric: Budget | None  # None where too few hits were valid to give one
    quantities: Mapping[str, Budget]  # by the keys of QUANTITIES; {} without a metric
    width: Width | None  # None too where the rules ask for none
    other: OtherSupport | None
    findings: tuple[Finding, ...]  # what the rules ask of a bat before it is hit
    flags: tuple[Flag, ...]  # what does not hang together in the records
    verdict: Verdict

    @property
    def marginal(self) -> bool:
        """Whether the limit lies within the 95 % interval."""
        if self.metric is None or self.procedure.most is None:
            return False
        low, high = self.metric.interval_95
        return low <= self.procedure.most <= high

    @property
    def unverified(self) -> tuple[Datum, ...]:
        """The procedure's own values that nobody could check against their source."""
        return tuple(datum for datum in self.procedure_sheet if not datum.verified)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """Records put into numbers and judged, uncertainties still to come."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimate]
    results: Callable[[Mapping[str, Array]], ShotResults]  # of any values of the constants
    metric: Callable[[Mapping[str, Array], ShotResults], Array]  # of them and their shots
    balls: BallReadings
    readings: ImpactReadings
    bat: BatProperties
    percussion: float  # centre of percussion of the bat as measured [m]
    shots: ShotResults
    shot_metric: Array  # (shot,)
    judgement: Judgement
    outcome: Outcome


@contextmanager
def _constants_known() -> Iterator[None]:
    """Turn a constant that the session's calibration lacks into bad input."""
    try:
        yield
    except KeyError as fault:
        key = f"calibration.{fault.args[0]}"
        raise InputError("session.json", key, None, "this constant is missing") from fault


@_constants_known()
def reduce_session(session: Session) -> Reduced:
    """Reduce a session's records. `InputError` where a record or procedure is of no use."""
    procedure = read(session.procedure_text, "procedure.toml", Procedure)
    rules = procedure.spec
    _require_rig(session, rules)
    ball_readings, readings = observe_balls(session), observe_impact(session)
    constants = _constants(session) | ball_constants(ball_readings)
    if "impact.gates.height_0" not in constants:
        constants["impact.aim.across_square"] = across_constant(session.records["impact"])

    def results(x: Mapping[str, Array]) -> ShotResults:
        balls = measured_balls(x, ball_readings)
        return shot_results(x, bat_properties(x), balls, readings, rules.asked)

    def metric(x: Mapping[str, Array], shots: ShotResults) -> Array:
        of = metric_of(rules, control=x[CONTROL] if rules.controlled else 1.0)
        return of(Curve.measured(shots), bat_properties(x))

    best = {name: np.array(known.value) for name, known in constants.items()}
    shots = results(best)
    shot_metric = metric(best, shots)
    bat = bat_properties(best)
    measured = {name: float(getattr(bat, name)) for name in BAT_PROPERTIES}
    percussion = aimed_place(measured, rules.pivot_from_knob)
    turn_rate = float(rules.turn_rate(measured["length"]))
    judgement = judge(rules, shots, readings, percussion, turn_rate)
    return Reduced(
        procedure=procedure,
        constants=constants,
        results=results,
        metric=metric,
        balls=ball_readings,
        readings=readings,
        bat=bat,
        percussion=percussion,
        shots=shots,
        shot_metric=shot_metric,
        judgement=judgement,
        outcome=outcome_of(rules, readings.place, judgement.valid, shot_metric),
    )


def _require_rig(session: Session, procedure: Procedure) -> None:
    """Refuse records that lack what the rules read, and a rig whose axis is elsewhere."""
    written = session.records.get("impact", {}).keys()
    for channel in sorted(procedure.needs - written):
        allowed = f"{procedure.name} needs this record"
        raise InputError(f"impact/{channel}", "record", None, allowed)
    axis, asked = session.calibration["impact.pivot.from_knob"].value, procedure.pivot_from_knob
    if abs(axis - asked) > PIVOT_TOLERANCE:
        raise InputError(
            "procedure.toml", "pivot_from_knob", f"{asked:g} m", f"the rig's axis is at {axis:g} m"
        )


def certify_session(session: Session) -> Certification:
    """Reduce a session and evaluate it. `InputError` as `reduce_session`."""
    return evaluate(session, reduce_session(session))


def evaluate(session: Session, reduced: Reduced) -> Certification:
    """Return metric, uncertainty and verdict of a session already reduced."""
    procedure, shots, outcome = reduced.procedure.spec, reduced.shots, reduced.outcome
    where, valid = reduced.readings.place, reduced.judgement.valid
    quantities: dict[str, Budget] = {}
    metric = None
    if np.isfinite(outcome.weights).all():
        values = {name: getattr(shots, field) for name, field in QUANTITIES.items()}
        values["metric"] = reduced.shot_metric
        shared = propagate(lambda x: _weighted(reduced, x), reduced.constants)
        used, groups = outcome.used, np.round(where, 6)
        for name, hits in values.items():
            part = scatter(hits[used], outcome.weights[used], groups[used])
            value = float(hits[used] @ outcome.weights[used])
            quantities[name] = combine(value, [*shared[name], part])
        metric = quantities.pop("metric")
        lost = shortfall(procedure, where, valid, reduced.shot_metric).rms
        if lost > 0:
            choice = type_a("choice of the place", outcome.place, lost)
            metric = combine(metric.value, [*metric.components, choice])
    found = findings(procedure, reduced.bat)
    return Certification(
        session=session,
        procedure=procedure,
        procedure_sheet=reduced.procedure.sheet,
        bat=measure_bat(session),
        shots=shots,
        shot_metric=reduced.shot_metric,
        readings=reduced.readings,
        judgement=reduced.judgement,
        outcome=outcome,
        metric=metric,
        quantities=quantities,
        width=width_of(procedure, where, valid, reduced.shot_metric) if metric else None,
        other=other_support(procedure, shots, reduced.bat, outcome) if metric else None,
        findings=found,
        flags=flags(_evidence(session, reduced)),
        verdict=verdict(
            procedure,
            metric.value if metric else np.nan,
            complete=not outcome.reason,
            eligible=all(finding.met for finding in found),
        ),
    )


def _evidence(session: Session, reduced: Reduced) -> Evidence:
    return Evidence(
        session=session,
        procedure=reduced.procedure.spec,
        constants=reduced.constants,
        bat=reduced.bat,
        balls=reduced.balls,
        readings=reduced.readings,
        shots=reduced.shots,
        judgement=reduced.judgement,
        results=reduced.results,
    )


@_constants_known()
def measure_bat(session: Session) -> dict[str, Budget]:
    """Return the bat's measured inertial properties with their uncertainties [SI]."""
    constants = _constants(session)

    def properties(x: Mapping[str, Array]) -> dict[str, Array]:
        bat = bat_properties(x)
        return {name: np.ravel(getattr(bat, name)) for name in BAT_PROPERTIES}

    best = properties({name: np.array([[known.value]]) for name, known in constants.items()})
    return {
        name: combine(float(best[name][0]), components)
        for name, components in propagate(properties, constants).items()
    }


def _constants(session: Session) -> dict[str, Estimate]:
    for name, known in session.calibration.items():
        if name.rpartition(".")[2] in POSITIVE and not known.value > 0:
            key = f"calibration.{name}"
            raise InputError("session.json", key, known.value, "allowed: above 0")
    return dict(session.calibration) | bench_constants(session)


def _weighted(reduced: Reduced, x: Mapping[str, Array]) -> dict[str, Array]:
    used, shots = reduced.outcome.used, reduced.results(x)
    weights = reduced.outcome.weights[used]
    sums = {name: getattr(shots, field)[..., used] @ weights for name, field in QUANTITIES.items()}
    return sums | {"metric": reduced.metric(x, shots)[..., used] @ weights}
