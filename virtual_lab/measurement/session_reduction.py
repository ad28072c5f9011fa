"""A session's records put into numbers and judged by its rules, uncertainties still to come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.model import MeasurementModel
from virtual_lab.measurement.procedure import (
    Acceptance,
    HitWeights,
    Judgement,
    Lot,
    Procedure,
    Sought,
    aimed_place,
    judge,
    lot_of,
    outcome_of,
    sought_of,
)
from virtual_lab.measurement.reduction.flights import timed
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
)
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, combine, propagate
from virtual_lab.uncertainty.estimate import Estimate

__all__ = [
    "Preparation",
    "Reduced",
    "best_values",
    "constants_known",
    "prepare",
    "reduce_hits",
    "reduce_session",
]

Array = NDArray[np.float64]

BAT_PROPERTIES = ("mass", "length", "z_cm", "inertia_cm")
POSITIVE = ("span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch")
PIVOT_TOLERANCE = 5e-3  # m, a rig this far off is another rig
AIM_ALONG = "impact.cannon.along"


@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation:
    """What is known of bat, balls and rigs before the bat is hit."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimate]
    balls: BallReadings
    lot: Lot
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm [SI]

    @property
    def percussion(self) -> float:
        """The place that the rules aim at or about, of the bat as measured [m]."""
        return aimed_place(self._bat, self.procedure.spec.pivot_from_knob)

    @property
    def turn_rate(self) -> float:
        """The angular speed that the rules ask of the bat as measured [rad/s]."""
        return float(self.procedure.spec.turn_rate(self._bat["length"]))

    @property
    def _bat(self) -> dict[str, float]:
        return {name: budget.value for name, budget in self.bat.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """Records put into numbers and judged, uncertainties still to come."""

    preparation: Preparation
    constants: Mapping[str, Estimate]  # those of the preparation and of the hits
    model: MeasurementModel
    bat: BatProperties
    shots: ShotResults
    shot_metric: Array  # (shot,)
    sought: Sought  # by a scan, (shot,)
    judgement: Judgement
    outcome: HitWeights

    @property
    def procedure(self) -> Procedure:
        return self.model.rules

    @property
    def readings(self) -> ImpactReadings:
        return self.model.readings


@contextmanager
def constants_known() -> Iterator[None]:
    """Turn a constant that the session's calibration lacks into bad input."""
    try:
        yield
    except KeyError as fault:
        key = f"calibration.{fault.args[0]}"
        raise InputError("session.json", key, None, "this constant is missing") from fault


def reduce_session(session: Session) -> Reduced:
    """Reduce a session's records. `InputError` where a record or procedure is of no use."""
    return reduce_hits(session, prepare(session))


@constants_known()
def prepare(session: Session) -> Preparation:
    """Return what bench and wall rig give of a session whose bat may still be to hit.

    Raises
    ------
    InputError
        A record, calibration or procedure that is missing or cannot be used.
    """
    procedure = read(session.procedure_text, "procedure.toml", Procedure)
    axis = session.calibration["impact.pivot.from_knob"].value
    asked = procedure.spec.pivot_from_knob
    if abs(axis - asked) > PIVOT_TOLERANCE:
        allowed = f"the rig's axis is at {axis:g} m"
        raise InputError("procedure.toml", "pivot_from_knob", f"{asked:g} m", allowed)
    balls = observe_balls(session)
    constants = _constants(session) | ball_constants(balls)
    constants |= _place_constants(procedure.spec, constants.get(AIM_ALONG))
    return Preparation(
        procedure=procedure,
        constants=constants,
        balls=balls,
        lot=lot_of(procedure.spec, measured_balls(best_values(constants), balls)),
        bat=_bat_budgets(constants),
    )


@constants_known()
def reduce_hits(
    session: Session, preparation: Preparation, acceptance: Acceptance = judge
) -> Reduced:
    """Reduce what was recorded at the bat, all shots together: their rings are fitted as one.

    Parameters
    ----------
    session
        With the records of the impact rig.
    preparation
        Of the same session.
    acceptance
        Which hits count, by default as the rules say.

    Raises
    ------
    InputError
        As `prepare`.
    """
    rules, constants = preparation.procedure.spec, dict(preparation.constants)
    _require_channels(session, rules)
    readings = observe_impact(session)
    if "impact.gates.height_0" not in constants:
        constants["impact.aim.across_square"] = across_constant(session.records["impact"])
    model = MeasurementModel(
        rules=rules,
        balls=preparation.balls,
        lot=preparation.lot,
        readings=readings,
        by_gates=timed("impact", readings.passages),
    )
    best = best_values(constants)
    shots = model.shots(best)
    shot_metric = model.metric(best, shots)
    bat = bat_properties(best)
    sought = sought_of(rules, shot_metric, readings.place, bat)
    judgement = acceptance(rules, shots, readings, preparation.percussion, preparation.turn_rate)
    return Reduced(
        preparation=preparation,
        constants=constants,
        model=model,
        bat=bat,
        shots=shots,
        shot_metric=shot_metric,
        sought=sought,
        judgement=judgement,
        outcome=outcome_of(rules, readings.place, judgement.valid, shot_metric, sought),
    )


def best_values(constants: Mapping[str, Estimate]) -> dict[str, Array]:
    """Return the constants' values, as a model takes them."""
    return {name: np.array(known.value) for name, known in constants.items()}


def _require_channels(session: Session, procedure: Procedure) -> None:
    """Refuse records that lack what the rules read."""
    written = session.records.get("impact", {}).keys()
    for channel in sorted(procedure.needs - written):
        allowed = f"{procedure.name} needs this record"
        raise InputError(f"impact/{channel}", "record", None, allowed)


def _bat_budgets(constants: Mapping[str, Estimate]) -> dict[str, Budget]:
    """Return the bat's measured inertial properties with their uncertainties [SI]."""

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
