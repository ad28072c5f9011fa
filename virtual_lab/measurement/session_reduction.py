"""From a session's records to judged shots, before the evaluation of uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

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
from virtual_lab.units import Array

AIM_ALONG = "impact.cannon.along"


@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation:
    """Reduced values of bat, balls and rigs before the bat is hit."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimate]
    balls: BallReadings
    lot: Lot
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm [SI]

    @property
    def percussion(self) -> float:
        """The place at which the procedure aims, for the measured bat [m]."""
        return aimed_place(self._bat, self.procedure.spec.pivot_from_knob)

    @property
    def turn_rate(self) -> float:
        """The angular speed that the procedure requires for the measured bat [rad/s]."""
        return float(self.procedure.spec.turn_rate(self._bat["length"]))

    @property
    def _bat(self) -> dict[str, float]:
        return {name: budget.value for name, budget in self.bat.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionReduction:
    """Reduced and judged records, before the evaluation of uncertainty."""

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
    """Report a constant missing in the session's calibration as bad input."""
    try:
        yield
    except KeyError as fault:
        key = f"calibration.{fault.args[0]}"
        raise InputError("session.json", key, None, "this constant is missing") from fault


def reduce_session(session: Session) -> SessionReduction:
    """Reduce a session's records. `InputError` for an unusable record or procedure."""
    return reduce_hits(session, prepare(session))


@constants_known()
def prepare(session: Session) -> Preparation:
    """Return the results of bench and wall rig of a session, before or after the bat was hit.

    Raises
    ------
    InputError
        A record, calibration or procedure that is missing or cannot be used.
    """
    procedure = read(session.procedure_text, "procedure.toml", Procedure)
    axis = session.calibration["impact.pivot.from_knob"].value
    asked = procedure.spec.pivot_from_knob
    if abs(axis - asked) > 5e-3:  # m: another rig
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
) -> SessionReduction:
    """Reduce the records at the bat, all shots together, because they share vibrations.

    Parameters
    ----------
    session
        With the records of the impact rig.
    preparation
        Of the same session.
    acceptance
        Which hits count, by default by the procedure.

    Raises
    ------
    InputError
        As `prepare`.
    """
    rules, constants = preparation.procedure.spec, dict(preparation.constants)
    _require_channels(session, rules)
    readings = observe_impact(session)
    if not readings.seen.shows_height:
        constants["impact.aim.across_square"] = across_constant(session.records["impact"])
    model = MeasurementModel(
        rules=rules,
        balls=preparation.balls,
        lot=preparation.lot,
        readings=readings,
    )
    best = best_values(constants)
    shots = model.shots(best)
    shot_metric = model.metric(best, shots)
    bat = bat_properties(best)
    sought = sought_of(rules, shot_metric, readings.place, bat)
    judgement = acceptance(rules, shots, readings, preparation.percussion, preparation.turn_rate)
    return SessionReduction(
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
    """Refuse sessions without a channel that the procedure needs."""
    written = session.records.get("impact", {}).keys()
    for channel in sorted(procedure.needs - written):
        allowed = f"{procedure.name} needs this record"
        raise InputError(f"impact/{channel}", "record", None, allowed)


def _bat_budgets(constants: Mapping[str, Estimate]) -> dict[str, Budget]:
    """Return the bat's measured inertial properties with their uncertainties [SI]."""

    def properties(x: Mapping[str, Array]) -> dict[str, Array]:
        bat = bat_properties(x)
        names = ("mass", "length", "z_cm", "inertia_cm")
        return {name: np.ravel(getattr(bat, name)) for name in names}

    best = properties({name: np.array([[known.value]]) for name, known in constants.items()})
    return {
        name: combine(float(best[name][0]), components)
        for name, components in propagate(properties, constants).items()
    }


def _place_constants(rules: Procedure, along: Estimate | None) -> dict[str, Estimate]:
    """Return the procedure's slope of e_A, and the effect of its uncertainty on e_A.

    The place is corrected for the known aim, so the product of the two uncertainties matters
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
    positive = {"span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch"}
    for name, known in session.calibration.items():
        if name.rpartition(".")[2] in positive and not known.value > 0:
            key = f"calibration.{name}"
            raise InputError("session.json", key, known.value, "allowed: above 0")
    return dict(session.calibration) | bench_constants(session)
