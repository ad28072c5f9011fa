"""From a session's records to judged shots, before the evaluation of uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import AlignedArrays
from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import (
    Acceptance,
    Curve,
    HitWeights,
    Judgement,
    NextShots,
    Objective,
    Procedure,
    accept_hits,
    admit_balls,
    has_too_few,
    hit_weights_of,
    judge,
    metric_of,
    next_shots,
    objective_of,
)
from virtual_lab.measurement.procedure.model import CONTROL, MeasurementModel
from virtual_lab.measurement.reduction.air import DENSITY, LOGGER, measured_density
from virtual_lab.measurement.reduction.flights import number_shots
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
    restitution_names,
)
from virtual_lab.measurement.reduction.shot_algebra import (
    PLACE_SLOPE,
    SLOPE_ERROR,
    BatProperties,
    MeasuredBalls,
    ShotResults,
    bat_properties,
    kept_shares,
    measured_balls,
    shot_results,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.budget import Budgets, Variants, combine_components
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.units import Array, Mask

AIM_ALONG = "impact.cannon.along"


@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation(AlignedArrays):
    """Reduced values of bats, balls and rigs of a block before the bats are hit."""

    procedure: Entry[Procedure]
    constants: Mapping[str, Estimates]
    balls: BallReadings
    lot: MeasuredBalls  # measured balls for the best values of the constants, (laboratory, 1, ball)
    used: Mask  # balls that define the lot, (laboratory, 1, ball)
    bat: BatProperties  # measured bats for the best values of the constants, (laboratory, 1, 1)

    aligned: ClassVar = ("constants", "balls", "lot", "used", "bat")

    @property
    def laboratories(self) -> int:
        """Number of laboratories."""
        return len(self.used)

    @property
    def short(self) -> Mask:
        """Whether too few balls of each box are within the windows, (laboratory,)."""
        return has_too_few(self.procedure.spec, self.lot)[:, 0]

    @property
    def percussion(self) -> Array:
        """Center of percussion of each measured bat, from the barrel tip, (laboratory,) [m]."""
        bat, pivot = self.bat, self.procedure.spec.pivot_from_knob
        position = centre_of_percussion(bat.z_cm, bat.inertia_cm, bat.mass, bat.length - pivot)
        return np.asarray(position).reshape(-1)

    @property
    def turn_rate(self) -> Array:
        """Angular speed that the procedure requires of each measured bat, (laboratory,) [rad/s]."""
        return self.procedure.spec.turn_rate(self.bat.length).reshape(-1)

    def first_shots(self) -> NextShots:
        """Return the shots that the procedure requires first."""
        owner, nothing = np.zeros(0, dtype=np.intp), np.zeros(0)
        valid = nothing.astype(bool)
        return next_shots(self.procedure.spec, self.percussion, owner, nothing, valid, nothing)

    @property
    def bat_budgets(self) -> dict[str, Budgets]:
        """Measured mass, length, z_cm and inertia_cm with their uncertainties [SI]."""
        variants = Variants.of(self.constants)
        measured = bat_properties(variants.columns)
        budgets = {}
        for name in ("mass", "length", "z_cm", "inertia_cm"):
            values = getattr(measured, name)[..., 0]
            budgets[name] = combine_components(values[:, 0], variants.components(values))
        return budgets


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction(AlignedArrays):
    """Reduced and judged shots of a block as fired, (shot,), without their readings."""

    preparation: Preparation
    constants: Mapping[str, Estimates]  # constants of the preparation and of the hits
    owner: NDArray[np.intp]  # laboratory of each shot
    position: Array  # aimed position, from the barrel tip [m]
    shots: ShotResults
    shot_metric: Array
    objective: Objective  # quantity that a scan maximizes
    valid: Mask
    acceptance: Acceptance = judge  # function that judges which hits are valid
    # laboratories of the shots of the last round; None: every laboratory may still need shots
    latest: NDArray[np.intp] | None = None

    aligned: ClassVar = ("owner", "position", "shots", "shot_metric", "objective", "valid")

    @property
    def procedure(self) -> Procedure:
        return self.preparation.procedure.spec

    @property
    def shot_numbers(self) -> NDArray[np.intp]:
        """Indices of the shots of each laboratory, (laboratory, n), filled up with -1."""
        mask = np.ones(self.owner.size, dtype=bool)
        return number_shots(self.owner, mask, self.preparation.laboratories)

    @property
    def hit_weights(self) -> HitWeights:
        """The weights of the hits by the procedure's rules."""
        return hit_weights_of(
            self.procedure,
            self.preparation.laboratories,
            self.owner,
            self.position,
            self.valid,
            self.shot_metric,
            self.objective,
        )

    def next_shots(self) -> NextShots:
        """Return the shots that the procedure requires next, none for a complete test."""
        asking = np.zeros(self.preparation.laboratories, dtype=bool)
        asking[... if self.latest is None else self.latest] = True
        mask, turn = asking[self.owner], np.cumsum(asking) - 1
        following = next_shots(
            self.procedure,
            self.preparation.percussion[asking],
            turn[self.owner[mask]],
            self.position[mask],
            self.valid[mask],
            self.objective.value[mask],
        )
        return NextShots(np.flatnonzero(asking)[following.owner], following.position)

    def judgement(self, readings: ImpactReadings, laboratory: int = 0) -> Judgement:
        """Return the reason for rejection of each shot of one laboratory, empty for a valid hit.

        `readings` are the readings of all shots of all laboratories, (shot,).
        """
        mask, preparation = self.owner == laboratory, self.preparation
        return self.acceptance(
            self.procedure,
            self.shots.select(mask),
            readings.select(mask),
            float(preparation.percussion[laboratory]),
            float(preparation.turn_rate[laboratory]),
        )

    def judge_hits(self, acceptance: Acceptance, readings: ImpactReadings) -> Reduction:
        """Return the reduction with the valid hits that `acceptance` accepts.

        `readings` are the readings of all shots of all laboratories, as fired, (shot,).
        """
        chosen, valid = replace(self, acceptance=acceptance), np.empty_like(self.valid)
        for laboratory in range(self.preparation.laboratories):
            valid[self.owner == laboratory] = chosen.judgement(readings, laboratory).valid
        return replace(chosen, valid=valid)

    def row(self, laboratory: int) -> Reduction:
        """Return the reduction of one laboratory as a block of one."""
        index, part = np.array([laboratory]), self.select(self.owner == laboratory)
        return replace(
            part,
            preparation=self.preparation.select(index),
            constants={name: each.select(index) for name, each in self.constants.items()},
            owner=np.zeros_like(part.owner),
            latest=None,
        )

    def model(
        self,
        readings: ImpactReadings,
        hits: NDArray[np.intp] | None = None,
        laboratories: slice = slice(None),
    ) -> MeasurementModel:
        """Return the results of `hits` as functions of the constants, (laboratory, k, hit).

        `hits` are the indices of shots of the `laboratories`, (laboratory, hit), negative for no
        shot. None means all shots. `readings` are the readings of all shots in firing order,
        (shot,).
        """
        preparation, hits = self.preparation, self.shot_numbers if hits is None else hits
        chosen = np.arange(preparation.laboratories)[laboratories]
        return MeasurementModel(
            rules=self.procedure,
            balls=preparation.balls.select(chosen),
            used=preparation.used[chosen],
            readings=readings.select(hits[:, None]),
        )

    def single_model(self, readings: ImpactReadings) -> MeasurementModel:
        """Return the model for a block of one laboratory, without the axis of the block."""
        preparation, first = self.preparation, np.array(0)
        return MeasurementModel(
            rules=self.procedure,
            balls=preparation.balls.select(first).select(first),
            used=preparation.used[0, 0],
            readings=readings,
        )


@contextmanager
def name_missing_constants() -> Iterator[None]:
    """Convert a `KeyError` within the context to an `InputError` about a missing constant.

    The message names the constant and ``session.json``. The function can also be used as a
    decorator.
    """
    try:
        yield
    except KeyError as fault:
        key = f"calibration.{fault.args[0]}"
        raise InputError("session.json", key, None, "this constant is missing") from fault


def reduce_block(block: SessionBlock) -> tuple[Reduction, ImpactReadings]:
    """Return the reduced shots of a block of laboratories, and the readings of the same shots.

    All shots are reduced together, because they share the frequencies of the vibrations in the
    encoder record.

    Raises
    ------
    InputError
        A record, calibration or procedure is missing or cannot be used.
    """
    preparation = prepare(block)
    readings = observe_hits(block, preparation)
    return reduce_shots(block, preparation, readings), readings


@name_missing_constants()
def prepare(block: SessionBlock) -> Preparation:
    """Return the measured bat, balls and constants, as known before the first impact.

    They are computed from the bench measurements and from the hits at the wall, for each
    laboratory.

    Raises
    ------
    InputError
        A record, calibration or procedure is missing or cannot be used.
    """
    procedure = read(block.procedure_text, "procedure.toml", Procedure)
    pivot = procedure.spec.pivot_from_knob
    for axis in block.calibration["impact.pivot.from_knob"].value:
        if abs(axis - pivot) > 5e-3:  # tolerance [m]; a larger difference means another rig
            allowed = f"the rig's axis is at {axis:g} m"
            raise InputError("procedure.toml", "pivot_from_knob", f"{pivot:g} m", allowed)
    balls = observe_balls(block)
    constants = _constants(block) | ball_constants(balls)
    constants |= _place_constants(procedure.spec, constants.get(AIM_ALONG))
    best = best_values(constants)
    lot = measured_balls(best, balls)
    errors = [constants[name].u for name in restitution_names(lot.restitution.shape[-1])]
    kept = kept_shares(lot.restitution, np.stack(errors, axis=-1)[:, None])
    return Preparation(
        procedure=procedure,
        constants=constants,
        balls=replace(balls, kept=kept),
        lot=replace(lot, kept=kept),
        used=admit_balls(procedure.spec, lot),
        bat=bat_properties(best),
    )


@name_missing_constants()
def observe_hits(block: SessionBlock, preparation: Preparation) -> ImpactReadings:
    """Return the readings of the shots at the bat, in the order of firing, (shot,).

    `observe_impact` describes these readings. `preparation` states the procedure, which determines
    the records that are needed. Raises `InputError` if a record is missing that the procedure
    needs, or if a record cannot be used.
    """
    _require_channels(block, preparation.procedure.spec)
    return observe_impact(block)


@name_missing_constants()
def reduce_shots(
    block: SessionBlock, preparation: Preparation, readings: ImpactReadings
) -> Reduction:
    """Return the results of the shots in `readings`, and which shots are valid, (shot,) [SI].

    `block` holds the records of these shots, and `preparation` the measured bats and balls of each
    laboratory. Each shot is reduced with the constants of its laboratory. Raises `InputError` for a
    missing constant. If the instrument that times the ball measures no heights, the error is also
    raised for missing aim marks.
    """
    rules, constants, owner = preparation.procedure.spec, dict(preparation.constants), block.owner
    if not readings.flights.shows_height:
        constants["impact.aim.across_square"] = across_constant(block)
    alone = readings.select(np.arange(owner.size)[:, None, None])
    best = {name: estimates.value[owner, None, None] for name, estimates in constants.items()}
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
    metric = metric_of(rules, control_ratio=best.get(CONTROL, 1.0))(Curve.from_shots(results), bat)
    objective = objective_of(rules, metric, alone.position, bat)
    targets = (each[owner, None, None] for each in (preparation.percussion, preparation.turn_rate))
    valid = accept_hits(rules, results, alone, *targets)
    return Reduction(
        preparation=preparation,
        constants=constants,
        owner=owner,
        position=readings.position,
        shots=results.select((slice(None), 0, 0)),
        shot_metric=metric.reshape(-1),
        objective=Objective(
            value=np.broadcast_to(objective.value, metric.shape).reshape(-1),
            gain=np.broadcast_to(objective.gain, metric.shape).reshape(-1),
        ),
        valid=valid.reshape(-1),
    )


def best_values(constants: Mapping[str, Estimates]) -> dict[str, Array]:
    """Return the values of the constants without their uncertainties, each (laboratory, 1, 1).

    They broadcast with arrays (laboratory, set of constants, shot).
    """
    return {name: estimates.value[:, None, None] for name, estimates in constants.items()}


def _require_channels(block: SessionBlock, procedure: Procedure) -> None:
    """Refuse records without a channel that the procedure needs."""
    for channel in sorted(procedure.needs - block.impact.keys()):
        allowed = f"{procedure.name} needs this record"
        raise InputError(f"impact/{channel}", "record", None, allowed)


def _place_constants(rules: Procedure, along: Estimates | None) -> dict[str, Estimates]:
    """Return the procedure's slope of e_A along the barrel, and the error of e_A that it causes.

    e_A is already corrected for the known aim. The remaining effect is the product of the
    uncertainties of slope and aim (GUM 5.1.2, note).
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

    The density of the air comes from the climate readings, if there are any. The constants of the
    climate logger (used only for this density) and the thickness of a beam (used only for a check)
    are left out.
    """
    positive = {"span", "clock", "scale", "counts_per_turn", "gravity", "radius", "pitch"}
    for name, estimates in block.calibration.items():
        if name.rpartition(".")[2] in positive and not (estimates.value > 0).all():
            key = f"calibration.{name}"
            raise InputError("session.json", key, float(estimates.value.min()), "allowed: above 0")
    calibrations = {
        key: estimates
        for key, estimates in block.calibration.items()
        if not key.startswith(LOGGER) and not key.endswith(THICKNESS)
    }
    density = measured_density(block)
    return calibrations | bench_constants(block) | ({DENSITY: density} if density else {})
