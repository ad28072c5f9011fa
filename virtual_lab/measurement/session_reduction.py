"""From a session's records to judged shots, before the evaluation of uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.model import CONTROL, MeasurementModel
from virtual_lab.measurement.procedure import (
    Acceptance,
    BlockOutcome,
    Curve,
    HitWeights,
    Judgement,
    Lot,
    NextShots,
    Procedure,
    Sought,
    accepted,
    admitted,
    judge,
    lot_of,
    metric_of,
    next_shots,
    outcome_of,
    outcomes_of,
    sought_of,
)
from virtual_lab.measurement.reduction.air import DENSITY, LOGGER, measured_density
from virtual_lab.measurement.reduction.gates import THICKNESS
from virtual_lab.measurement.reduction.kinematics import centre_of_percussion
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
    MeasuredBalls,
    ShotResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, combine, propagate
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.units import Array, Mask

AIM_ALONG = "impact.cannon.along"


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockPreparation:
    """Reduced values of bats, balls and rigs of a block before the bats are hit."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimates]
    balls: BallReadings
    lot: MeasuredBalls  # measured balls for the best values of the constants, (laboratory, 1, ball)
    used: Mask  # balls that define the lot, (laboratory, 1, ball)
    bat: BatProperties  # measured bats for the best values of the constants, (laboratory, 1, 1)

    @property
    def laboratories(self) -> int:
        """Number of laboratories."""
        return len(self.used)

    @property
    def percussion(self) -> Array:
        """The place at which the procedure aims, for each measured bat, (laboratory,) [m]."""
        bat, pivot = self.bat, self.procedure.spec.pivot_from_knob
        place = centre_of_percussion(bat.z_cm, bat.inertia_cm, bat.mass, bat.length - pivot)
        return np.asarray(place).reshape(-1)

    @property
    def turn_rate(self) -> Array:
        """The angular speed the procedure requires for each measured bat, (laboratory,) [rad/s]."""
        return self.procedure.spec.turn_rate(self.bat.length).reshape(-1)

    def alone(self, laboratory: int) -> BlockPreparation:
        """Return the block of one of its laboratories."""
        one = slice(laboratory, laboratory + 1)
        return replace(
            self,
            constants={name: known.select(one) for name, known in self.constants.items()},
            balls=self.balls.select(np.array([laboratory])),
            lot=self.lot.select(one),
            used=self.used[one],
            bat=self.bat.select(one),
        )

    def of(self, laboratory: int) -> Preparation:
        """Return the preparation of one laboratory."""
        constants = {name: known.row(laboratory) for name, known in self.constants.items()}
        lot = self.lot.select((laboratory, 0))
        return Preparation(
            block=self,
            laboratory=laboratory,
            procedure=self.procedure,
            constants=constants,
            balls=self.balls.of(laboratory),
            lot=lot_of(self.procedure.spec, lot),
            bat=_bat_budgets(constants),
            percussion=float(self.percussion[laboratory]),
            turn_rate=float(self.turn_rate[laboratory]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation:
    """Reduced values of bat, balls and rigs of one laboratory before its bat is hit."""

    block: BlockPreparation
    laboratory: int  # number of the laboratory in the block
    procedure: Entry[Procedure]
    constants: Mapping[str, Estimate]
    balls: BallReadings
    lot: Lot
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm [SI]
    percussion: float  # position at which the procedure aims on the measured bat [m]
    turn_rate: float  # angular speed that the procedure requires for this bat [rad/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockReduction:
    """Reduced and judged shots of a block as fired, (shot,), without their readings."""

    preparation: BlockPreparation
    constants: Mapping[str, Estimates]  # constants of the preparation and of the hits
    owner: NDArray[np.intp]  # laboratory of each shot
    place: Array  # aimed position, from the barrel tip [m]
    results: ShotResults
    metric: Array
    sought: Sought  # quantity that a scan maximises
    valid: Mask
    acceptance: Acceptance = judge  # function that judges which hits are valid
    # owners of the shots of the last round; None: all laboratories still ask
    latest: NDArray[np.intp] | None = None

    @classmethod
    def alone(cls, reduced: SessionReduction) -> BlockReduction:
        """Return the block of one laboratory, with the validity of its hits as judged."""
        preparation = reduced.preparation
        return cls(
            preparation=preparation.block.alone(preparation.laboratory),
            constants={
                name: Estimates.stacked([known]) for name, known in reduced.constants.items()
            },
            owner=np.zeros(reduced.shot_metric.size, dtype=np.intp),
            place=reduced.readings.place,
            results=reduced.shots,
            metric=reduced.shot_metric,
            sought=reduced.sought,
            valid=reduced.judgement.valid,
            acceptance=lambda *_: reduced.judgement,
        )

    @property
    def procedure(self) -> Procedure:
        return self.preparation.procedure.spec

    @property
    def outcome(self) -> BlockOutcome:
        """The outcome of the hits by the procedure's rules."""
        return outcomes_of(
            self.procedure,
            self.preparation.laboratories,
            self.owner,
            self.place,
            self.valid,
            self.metric,
            self.sought,
        )

    def next_shots(self) -> NextShots:
        """Return the shots that the procedure asks for next; none where a test is complete."""
        asking = np.zeros(self.preparation.laboratories, dtype=bool)
        asking[... if self.latest is None else self.latest] = True
        own, turn = asking[self.owner], np.cumsum(asking) - 1
        found = next_shots(
            self.procedure,
            self.preparation.percussion[asking],
            turn[self.owner[own]],
            self.place[own],
            self.valid[own],
            self.sought.value[own],
        )
        return NextShots(np.flatnonzero(asking)[found.owner], found.place)

    def with_round(self, more: BlockReduction) -> BlockReduction:
        """Return the shots of both, `more` fired later."""

        def both(name: str) -> Any:
            return np.concatenate([getattr(self, name), getattr(more, name)])

        value, gain = map(np.concatenate, zip(self.sought, more.sought, strict=True))
        return replace(
            self,
            latest=more.owner,
            owner=both("owner"),
            place=both("place"),
            results=ShotResults.concatenate([self.results, more.results]),
            metric=both("metric"),
            sought=Sought(value, gain),
            valid=both("valid"),
        )

    def judged(self, acceptance: Acceptance, readings: ImpactReadings) -> BlockReduction:
        """Return the shots, with the hits valid that `acceptance` accepts.

        `readings` are those of all shots, as fired, (shot,).
        """
        chosen, valid = replace(self, acceptance=acceptance), np.empty_like(self.valid)
        for laboratory in range(self.preparation.laboratories):
            found = chosen.of(laboratory, readings)
            valid[self.owner == laboratory] = found.judgement.valid
        return replace(chosen, valid=valid)

    def of(self, laboratory: int, readings: ImpactReadings) -> SessionReduction:
        """Return the reduction of one laboratory.

        `readings` are those of all shots, as fired, (shot,).
        """
        preparation, own = self.preparation.of(laboratory), self.owner == laboratory
        rules, seen, results = self.procedure, readings.select(own), self.results.select(own)
        metric, sought = self.metric[own], Sought(self.sought.value[own], self.sought.gain[own])
        judgement = self.acceptance(
            rules, results, seen, preparation.percussion, preparation.turn_rate
        )
        return SessionReduction(
            preparation=preparation,
            constants={name: known.row(laboratory) for name, known in self.constants.items()},
            model=MeasurementModel(
                rules=rules, balls=preparation.balls, used=preparation.lot.used, readings=seen
            ),
            bat=self.preparation.bat.select((laboratory, 0, 0)),
            shots=results,
            shot_metric=metric,
            sought=sought,
            judgement=judgement,
            outcome=outcome_of(rules, seen.place, judgement.valid, metric, sought),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionReduction:
    """Reduced and judged records of one laboratory, before the evaluation of uncertainty."""

    preparation: Preparation
    constants: Mapping[str, Estimate]  # constants of the preparation and of the hits
    model: MeasurementModel
    bat: BatProperties
    shots: ShotResults
    shot_metric: Array  # (shot,)
    sought: Sought  # quantity that a scan maximises, (shot,)
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


def prepare(session: Session) -> Preparation:
    """Return the results of bench and wall rig of a session, before or after the bat was hit.

    Raises
    ------
    InputError
        A record, calibration or procedure that is missing or cannot be used.
    """
    return prepare_block(SessionBlock.of(session)).of(0)


@constants_known()
def prepare_block(block: SessionBlock) -> BlockPreparation:
    """Return the results of bench and wall rig of a block. `InputError` as `prepare`."""
    procedure = read(block.procedure_text, "procedure.toml", Procedure)
    asked = procedure.spec.pivot_from_knob
    for axis in block.calibration["impact.pivot.from_knob"].value:
        if abs(axis - asked) > 5e-3:  # tolerance [m]; a larger difference means another rig
            allowed = f"the rig's axis is at {axis:g} m"
            raise InputError("procedure.toml", "pivot_from_knob", f"{asked:g} m", allowed)
    balls = observe_balls(block)
    constants = _constants(block) | ball_constants(balls)
    constants |= _place_constants(procedure.spec, constants.get(AIM_ALONG))
    best = best_values(constants)
    lot = measured_balls(best, balls)
    return BlockPreparation(
        procedure=procedure,
        constants=constants,
        balls=balls,
        lot=lot,
        used=admitted(procedure.spec, lot),
        bat=bat_properties(best),
    )


def reduce_hits(session: Session, preparation: Preparation) -> SessionReduction:
    """Reduce the records at the bat, all shots together, because they share vibrations.

    `preparation` is of the same session. `InputError` as `prepare`.
    """
    block, alone = SessionBlock.of(session), preparation.block.alone(preparation.laboratory)
    readings = observe_hits(block, alone)
    return reduce_shots(block, alone, readings).of(0, readings)


@constants_known()
def observe_hits(block: SessionBlock, preparation: BlockPreparation) -> ImpactReadings:
    """Return the readings at the bat, (shot,). `InputError` as `prepare`."""
    _require_channels(block, preparation.procedure.spec)
    return observe_impact(block)


@constants_known()
def reduce_shots(
    block: SessionBlock, preparation: BlockPreparation, readings: ImpactReadings
) -> BlockReduction:
    """Reduce the shots in `readings`, each with the constants of its laboratory.

    The owners in `block` are those of the same shots.
    """
    rules, constants, owner = preparation.procedure.spec, dict(preparation.constants), block.owner
    if not readings.flights.shows_height:
        constants["impact.aim.across_square"] = across_constant(block)
    alone = readings.select(np.arange(owner.size)[:, None, None])
    best = {name: known.value[owner, None, None] for name, known in constants.items()}
    bat = preparation.bat.select(owner)
    results = shot_results(
        ShotResults,
        best,
        bat,
        preparation.lot.select(owner),
        alone,
        rules.reduction_settings,
        used=preparation.used[owner],
    )
    metric = metric_of(rules, control=best.get(CONTROL, 1.0))(Curve.measured(results), bat)
    sought = sought_of(rules, metric, alone.place, bat)
    asked = (each[owner, None, None] for each in (preparation.percussion, preparation.turn_rate))
    valid = accepted(rules, results, alone, *asked)
    return BlockReduction(
        preparation=preparation,
        constants=constants,
        owner=owner,
        place=readings.place,
        results=results.select((slice(None), 0, 0)),
        metric=metric.reshape(-1),
        sought=Sought(*(np.broadcast_to(each, metric.shape).reshape(-1) for each in sought)),
        valid=valid.reshape(-1),
    )


def best_values(constants: Mapping[str, Estimate] | Mapping[str, Estimates]) -> dict[str, Array]:
    """Return the values of the constants for a model, of a block with shape (laboratory, 1, 1)."""
    return {
        name: known.value[:, None, None] if isinstance(known, Estimates) else np.array(known.value)
        for name, known in constants.items()
    }


def _require_channels(block: SessionBlock, procedure: Procedure) -> None:
    """Refuse records without a channel that the procedure needs."""
    for channel in sorted(procedure.needs - block.impact.keys()):
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


def _place_constants(rules: Procedure, along: Estimates | None) -> dict[str, Estimates]:
    """Return the procedure's slope of e_A, and the effect of its uncertainty on e_A.

    The place is corrected for the known aim, so the product of the two uncertainties matters
    (GUM 5.1.2, note).
    """
    if along is None or not (rules.place_slope or rules.place_slope_u):
        return {}
    nothing, endless = np.zeros(along.u.shape), np.full(along.u.shape, np.inf)
    return {
        PLACE_SLOPE: Estimates(value=nothing + rules.place_slope, u=nothing, dof=endless),
        SLOPE_ERROR: Estimates(value=nothing, u=rules.place_slope_u * along.u, dof=endless),
    }


def _constants(block: SessionBlock) -> dict[str, Estimates]:
    """Return the constants of calibrations and readings that a result may depend on.

    The air's density is that of the readings, if there are any. The constants of the climate logger
    are used only for this density, and the thickness of a beam only for a check: they are left out.
    """
    positive = {"span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch"}
    for name, known in block.calibration.items():
        if name.rpartition(".")[2] in positive and not (known.value > 0).all():
            key = f"calibration.{name}"
            raise InputError("session.json", key, float(known.value.min()), "allowed: above 0")
    kept = {
        key: known
        for key, known in block.calibration.items()
        if not key.startswith(LOGGER) and not key.endswith(THICKNESS)
    }
    density = measured_density(block)
    return kept | bench_constants(block) | ({DENSITY: density} if density else {})
