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
from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate
from virtual_lab.procedure import Judgement, Procedure, Verdict, aimed_place, judge, verdict
from virtual_lab.reduction.measurement import (
    BatProperties,
    ShotResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.reduction.observations import (
    ImpactReadings,
    across_constant,
    ball_repeatability,
    bench_constants,
    observe_balls,
    observe_impact,
)
from virtual_lab.relations.kinematics import recoil_factor_free, restitution_from_efficiency
from virtual_lab.session import Session
from virtual_lab.uncertainty.budget import Budget, combine, propagate

__all__ = [
    "QUANTITIES",
    "Certification",
    "OtherSupport",
    "Reduced",
    "certify_session",
    "evaluate",
    "measure_bat",
    "reduce_session",
]

Array = NDArray[np.float64]

BAT_PROPERTIES = ("mass", "length", "z_cm", "inertia_cm")
POSITIVE = ("span", "clock", "scale", "counts_per_turn", "gravity", "radius")
PIVOT_TOLERANCE = 5e-3  # m, a rig this far off is another rig

QUANTITIES: Mapping[str, str] = {  # name in a certificate: the shots' field it is the mean of
    "bat_performance_factor": "bat_performance_factor",
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "recoil_factor": "lot_recoil_factor",
    "ball_restitution": "lot_ball_restitution",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSupport:
    """What the same collision efficiency would give with the recoil factor of a free bat."""

    recoil_factor: float
    restitution: float
    bat_performance_factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Certification:
    """The outcome of one test, all of it measured."""

    session: Session
    procedure: Procedure
    procedure_sheet: tuple[Datum, ...]
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm
    shots: ShotResults
    readings: ImpactReadings
    judgement: Judgement
    quantities: Mapping[str, Budget]  # by the keys of QUANTITIES; {} with fewer than 2 valid hits
    free: OtherSupport | None
    verdict: Verdict

    @property
    def metric(self) -> Budget | None:
        """The procedure's metric, None where too few hits were valid to give one."""
        return self.quantities.get(self.procedure.metric)

    @property
    def marginal(self) -> bool:
        """Whether the limit lies within the 95 % interval."""
        if self.metric is None:
            return False
        low, high = self.metric.interval_95
        return low <= self.procedure.limit <= high

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
    readings: ImpactReadings
    bat: BatProperties
    shots: ShotResults
    judgement: Judgement


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
    _require_pivot(session, procedure.spec)
    ball_readings, readings = observe_balls(session), observe_impact(session)
    constants = _constants(session) | {
        "procedure.pivot_from_knob": Estimate(value=procedure.spec.pivot_from_knob),
        "balls.repeatability": ball_repeatability(ball_readings),
        "impact.aim.across_square": across_constant(session.records["impact"]),
    }

    def results(x: Mapping[str, Array]) -> ShotResults:
        return shot_results(x, bat_properties(x), measured_balls(x, ball_readings), readings)

    best = {name: np.array(known.value) for name, known in constants.items()}
    shots = results(best)
    bat = bat_properties(best)
    measured = {name: float(getattr(bat, name)) for name in BAT_PROPERTIES}
    aimed = aimed_place(measured, procedure.spec.pivot_from_knob, exact=True)
    return Reduced(
        procedure=procedure,
        constants=constants,
        results=results,
        readings=readings,
        bat=bat,
        shots=shots,
        judgement=judge(procedure.spec, shots, readings, aimed),
    )


def _require_pivot(session: Session, procedure: Procedure) -> None:
    """Refuse a rig whose axis is not where the rules ask for it: no reduction mends that."""
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
    procedure, shots, valid = reduced.procedure.spec, reduced.shots, reduced.judgement.valid
    quantities = {}
    if valid.sum() >= 2:
        shared = propagate(lambda x: _means(reduced.results(x), valid), reduced.constants)
        for name, field in QUANTITIES.items():
            hits = getattr(shots, field)[valid]
            quantities[name] = combine(float(hits.mean()), shared[name], hits)
    metric = quantities.get(procedure.metric)
    return Certification(
        session=session,
        procedure=procedure,
        procedure_sheet=reduced.procedure.sheet,
        bat=measure_bat(session),
        shots=shots,
        readings=reduced.readings,
        judgement=reduced.judgement,
        quantities=quantities,
        free=_with_free_bat(reduced.bat, shots, reduced.readings, valid) if metric else None,
        verdict=verdict(procedure, metric.value if metric else np.nan, int(valid.sum())),
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


def _means(shots: ShotResults, valid: NDArray[np.bool_]) -> dict[str, Array]:
    return {
        name: getattr(shots, field)[..., valid].mean(axis=-1) for name, field in QUANTITIES.items()
    }


def _with_free_bat(
    bat: BatProperties, shots: ShotResults, readings: ImpactReadings, valid: NDArray[np.bool_]
) -> OtherSupport:
    pivoted = shots.lot_recoil_factor
    lever = readings.place - bat.z_cm
    # the lot's mean ball, by the recoil factor it has on the pivot
    ball = shots.ball_mass * pivoted / shots.recoil_factor
    recoil = np.asarray(recoil_factor_free(ball, bat.mass, bat.inertia_cm, lever))
    restitution = np.asarray(restitution_from_efficiency(shots.lot_collision_efficiency, recoil))
    factor = restitution / shots.lot_ball_restitution
    return OtherSupport(
        recoil_factor=float(recoil[valid].mean()),
        restitution=float(restitution[valid].mean()),
        bat_performance_factor=float(factor[valid].mean()),
    )
