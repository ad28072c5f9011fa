"""A session's records put into numbers and judged by its rules, uncertainties still to come."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import (
    Curve,
    HitWeights,
    Judgement,
    Lot,
    Procedure,
    Sought,
    aimed_place,
    judge,
    lot_of,
    metric_of,
    outcome_of,
    sought_of,
)
from virtual_lab.measurement.reduction.flights import Flown, timed
from virtual_lab.measurement.reduction.observations import (
    BallReadings,
    ImpactReadings,
    across_constant,
    ball_constants,
    bench_constants,
    observe_balls,
    observe_impact,
)
from virtual_lab.measurement.reduction.shot_algebra import (
    PLACE_SLOPE,
    SLOPE_ERROR,
    BatProperties,
    ShotResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, combine, propagate
from virtual_lab.uncertainty.estimate import Estimate

__all__ = [
    "CONTROL",
    "Reduced",
    "Results",
    "constants_known",
    "measure_bat",
    "measure_lot",
    "reduce_session",
]

Array = NDArray[np.float64]

BAT_PROPERTIES = ("mass", "length", "z_cm", "inertia_cm")
POSITIVE = ("span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch")
PIVOT_TOLERANCE = 5e-3  # m, a rig this far off is another rig
CONTROL = "control.restitution_ratio"
ALONG = "impact.cannon.along"


class Results(Protocol):
    """The shots' results of any values of the constants."""

    def __call__(self, x: Mapping[str, Array], flown: Flown = ...) -> ShotResults:
        """Return them, with the flights the gates saw or with those `flown` tells."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """Records put into numbers and judged, uncertainties still to come."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimate]
    results: Results  # of any values of the constants
    metric: Callable[[Mapping[str, Array], ShotResults], Array]  # of them and their shots
    balls: BallReadings
    lot: Lot
    readings: ImpactReadings
    bat: BatProperties
    percussion: float  # centre of percussion of the bat as measured [m]
    shots: ShotResults
    shot_metric: Array  # (shot,)
    sought: Sought  # by a scan, (shot,)
    judgement: Judgement
    outcome: HitWeights


@contextmanager
def constants_known() -> Iterator[None]:
    """Turn a constant that the session's calibration lacks into bad input."""
    try:
        yield
    except KeyError as fault:
        key = f"calibration.{fault.args[0]}"
        raise InputError("session.json", key, None, "this constant is missing") from fault


@constants_known()
def reduce_session(session: Session) -> Reduced:
    """Reduce a session's records. `InputError` where a record or procedure is of no use."""
    procedure = read(session.procedure_text, "procedure.toml", Procedure)
    rules = procedure.spec
    _require_rig(session, rules)
    ball_readings, readings = observe_balls(session), observe_impact(session)
    constants = _constants(session) | ball_constants(ball_readings)
    constants |= _place_constants(rules, constants.get(ALONG))
    if "impact.gates.height_0" not in constants:
        constants["impact.aim.across_square"] = across_constant(session.records["impact"])

    by_gates = timed("impact", readings.passages)

    best = {name: np.array(known.value) for name, known in constants.items()}
    lot = lot_of(rules, measured_balls(best, ball_readings))

    def results(x: Mapping[str, Array], flown: Flown = by_gates) -> ShotResults:
        balls = measured_balls(x, ball_readings)
        return shot_results(x, bat_properties(x), balls, readings, rules.asked, flown, lot.used)

    def metric(x: Mapping[str, Array], shots: ShotResults) -> Array:
        of = metric_of(rules, control=x[CONTROL] if rules.controlled else 1.0)
        return of(Curve.measured(shots), bat_properties(x))

    shots = results(best)
    shot_metric = metric(best, shots)
    bat = bat_properties(best)
    sought = sought_of(rules, shot_metric, readings.place, bat)
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
        lot=lot,
        readings=readings,
        bat=bat,
        percussion=percussion,
        shots=shots,
        shot_metric=shot_metric,
        sought=sought,
        judgement=judgement,
        outcome=outcome_of(rules, readings.place, judgement.valid, shot_metric, sought),
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


@constants_known()
def measure_lot(session: Session) -> Lot:
    """Return which balls the rules admit, of a session whose bat is still to be hit."""
    rules = read(session.procedure_text, "procedure.toml", Procedure).spec
    readings = observe_balls(session)
    constants = _constants(session) | ball_constants(readings)
    best = {name: np.array(known.value) for name, known in constants.items()}
    return lot_of(rules, measured_balls(best, readings))


@constants_known()
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


def _place_constants(rules: Procedure, along: Estimate | None) -> dict[str, Estimate]:
    """Return the slope of e_A that the rules know of, and what its uncertainty makes of e_A.

    The place allows for the aim as it is known, so the product of the two uncertainties counts
    (GUM 5.1.2, note).
    """
    if along is None or not (rules.place_slope or rules.place_slope_u):
        return {}
    error = rules.place_slope_u * along.u
    return {
        PLACE_SLOPE: Estimate(value=rules.place_slope),
        SLOPE_ERROR: Estimate(value=0.0, u=error),
    }


def _constants(session: Session) -> dict[str, Estimate]:
    for name, known in session.calibration.items():
        if name.rpartition(".")[2] in POSITIVE and not known.value > 0:
            key = f"calibration.{name}"
            raise InputError("session.json", key, known.value, "allowed: above 0")
    return dict(session.calibration) | bench_constants(session)
