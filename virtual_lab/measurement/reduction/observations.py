"""From raw records to observations, before calibrations are applied.

Repeated bench readings become one constant with a type A uncertainty, in addition to the
calibration constants of type B. Readings of each shot remain an array. Constants and readings are
combined in `virtual_lab.measurement.reduction.shot_algebra`.

Arrays of shots have one of three layouts, which `select` converts: (shot,), as recorded;
(laboratory, 1, shot), where the axis of length 1 is for the sets of constants; and (shot, 1, 1),
where the constants may differ from shot to shot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, ClassVar, get_args

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.makers import flight_readings
from virtual_lab.measurement.reduction.rate import RateFit, empty_rates, rates_from_summary, unwrap
from virtual_lab.measurement.reduction.recoil import fit_recoil
from virtual_lab.measurement.reduction.swing import fit_swing
from virtual_lab.records import (
    REFERENCE_MASS,
    AimMarks,
    EncoderRecord,
    LengthReadings,
    MassReadings,
    PendulumRecord,
    RateRecord,
    ShotLog,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.relations.pendulum import mean_amplitude_factor
from virtual_lab.uncertainty.estimate import Estimates, means_of_readings
from virtual_lab.units import Array, Mask

REPEATABILITY = "balls.repeatability"
SLOPE_REPEATABILITY = "balls.slope_repeatability"
# smallest relative difference of an odd swing from the median; a lost passage gives 1
UNEVEN = 0.25
READ_WITH = (  # property, channel, instrument
    ("mass", "bat-mass", "scale"),
    ("length", "length", "rule"),
    ("barrel_radius", "barrel-radius", "rule"),
    ("balance", "balance", "stand"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallReadings(AlignedArrays):
    """Readings of the balls on the scale and at the wall, with leading axes (laboratory, 1).

    A hit that was not detected in both directions is ignored; its ball index is -1.
    """

    mass: Array  # mean scale reading of each ball [kg], (..., ball)
    ball: NDArray[np.intp]  # ball of each wall hit, (..., hit)
    nominal_speed: Array  # nominal speed of each wall hit [m/s], (..., hit)
    flights: FlightReadings
    kept: Array | float = 1.0  # see `MeasuredBalls`

    aligned: ClassVar = EVERY_FIELD

    @property
    def share(self) -> Array:
        """Weight of each hit in the mean of each ball, (..., hit, ball)."""
        which = self.ball[..., None] == np.arange(self.mass.shape[-1])
        return np.asarray(which / which.sum(axis=-2, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactReadings(AlignedArrays):
    """The shots at the bat, arrays (..., shot)."""

    ball: NDArray[np.intp]
    position: Array  # aimed position, from the tip: set position plus offset of the cannon [m]
    flights: FlightReadings
    recoil: RateFit | None  # rotation of a bat that was at rest; None without an encoder
    swing: RateFit | None  # rotation of a bat that was swung; None without an encoder
    along: Array | float = 0.0  # offset of the cannon along the bat, included in `position` [m]

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class Releases:
    """Releases of the pendulum, arrays (laboratory, release).

    A swing is the time between two passages of the pendulum through its lowest point in the same
    direction. A swing is odd if it differs by more than 25 % from the median of all swings of its
    laboratory. If a passage is not recorded, one swing is twice as long. If a passage is recorded
    twice, one swing is very short. A release without an odd swing is counted. If a laboratory has
    fewer than two such releases, or if they are fewer than half of its releases, all its releases
    are counted. The records then do not show which releases are right.
    """

    times: Array  # times of the passages, (laboratory, release, passage) [s]
    first_amplitude: Array
    last_amplitude: Array
    odd: Mask  # (laboratory, release, swing)
    counted: Mask

    @classmethod
    def of(cls, record: PendulumRecord, laboratories: int = 1) -> Releases:
        """Return the releases in the record of equally many releases per laboratory."""
        times = record.times.reshape(laboratories, -1, record.times.shape[1])
        swings = np.diff(times, axis=2)
        odd = np.abs(swings / np.median(swings, axis=(1, 2), keepdims=True) - 1) > UNEVEN
        even = ~odd.any(axis=2)
        too_few = even.sum(axis=1) < max(2, even.shape[1] / 2)
        return cls(
            times=times,
            first_amplitude=record.first_amplitude.reshape(laboratories, -1),
            last_amplitude=record.last_amplitude.reshape(laboratories, -1),
            odd=odd,
            counted=even | too_few[:, None],
        )


def pendulum_releases(block: SessionBlock) -> Releases:
    """Return the releases of the pendulum in a block of laboratories.

    Raises `InputError` for a record that is missing, has fewer than two releases or passages, or
    has an amplitude that is not positive.
    """
    record = _channel(block, "bench", "pendulum", PendulumRecord)
    releases, passages = len(record.times) // block.laboratories, record.times.shape[1]
    if releases < 2 or passages < 2:
        size = f"{releases} releases of {passages} passages"
        allowed = "needs at least 2 releases of 2 passages"
        raise InputError("bench/pendulum", "size", size, allowed)
    for name in ("first_amplitude", "last_amplitude"):
        if not (getattr(record, name) > 0).all():
            raise InputError("bench/pendulum", name, None, "amplitudes must be above 0")
    return Releases.of(record, block.laboratories)


def bench_constants(block: SessionBlock) -> dict[str, Estimates]:
    """Return the mean bench readings of each bat with type A u, keyed by name, (laboratory,) [SI].

    The names are ``bat.mass``, ``bat.length``, ``bat.barrel_radius``, ``bat.balance`` (distance of
    the center of mass from the tip), ``bat.period``, ``bat.first_amplitude``,
    ``bat.last_amplitude`` and ``bat.swings``. The period is corrected to small swings by the
    amplitudes of each release. Only counted releases are used, see `Releases`. Raises `InputError`
    for a record that is missing, has too few readings, or has a reading that is not positive.
    Raises `KeyError` if the calibration lacks a resolution.
    """
    pendulum = pendulum_releases(block)
    times, counted = pendulum.times, pendulum.counted
    first, last, swings = pendulum.first_amplitude, pendulum.last_amplitude, times.shape[2] - 1
    periods = (times[..., -1] - times[..., 0]) / swings
    constants = {
        f"bat.{name}": means_of_readings(
            _read_repeats(block, channel),
            least_u=block.calibration[f"bench.{instrument}.resolution"].value / sqrt(12),
        )
        for name, channel, instrument in READ_WITH
    }
    small = periods / mean_amplitude_factor(first, last, swings)
    constants["bat.period"] = means_of_readings(small, used=counted)
    constants["bat.first_amplitude"] = _exact(first.mean(axis=1, where=counted))
    constants["bat.last_amplitude"] = _exact(last.mean(axis=1, where=counted))
    constants["bat.swings"] = _exact(np.full(block.laboratories, float(swings)))
    return constants


def _exact(value: Array) -> Estimates:
    return Estimates(value=value, u=np.zeros(value.shape), dof=np.full(value.shape, inf))


def reference_readings(block: SessionBlock) -> Array:
    """Return the readings of the reference mass, (laboratory, 2, repeat) [kg].

    On the second axis, index 0 holds the readings before bat and balls were weighed, and index 1
    the readings after. Raises `InputError` if the record is missing, does not have these two sets
    of readings, or has only one reading per set.
    """
    readings = _table(block, REFERENCE_MASS)
    if readings.shape[1] != 2 or readings.shape[2] < 2:
        size = f"{readings.shape[1]} items, {readings.shape[2]} readings of each"
        allowed = "needs items 0 (before) and 1 (after), with at least 2 readings of each"
        raise InputError(f"bench/{REFERENCE_MASS}", "size", size, allowed)
    return np.asarray(readings)


def observe_balls(block: SessionBlock) -> BallReadings:
    """Return the readings of the balls from scale and wall in a block of laboratories [SI].

    The arrays have the shape (laboratory, 1, ball) or (laboratory, 1, hit). The axis of length 1 is
    the axis for sets of constants in later computations. If the gates did not detect a ball in both
    directions, the hit is ignored and its ball index is -1. Raises `InputError` for a record that
    is missing or cannot be used, and for a ball with fewer than two detected hits.
    """
    log, flights = _log_and_flights(block, "balls")
    mass = _table(block, "ball-mass").mean(axis=-1)
    raw = flights.raw
    has_both = np.isfinite(raw.speed_in) & np.isfinite(raw.speed_out)
    # A hit that was not detected in both directions does not measure e0.
    ball = _by_laboratory(block, np.where(has_both, log.ball, -1).astype(np.intp))
    hits = (ball[..., None] == np.arange(mass.shape[1])).sum(axis=1)
    if hits.min() < 2:
        worst = int(np.unravel_index(hits.argmin(), hits.shape)[1])
        allowed = "needs at least 2 wall hits in which the gates saw the ball in both directions"
        raise InputError("balls", "ball", worst, allowed)
    order = np.where(ball >= 0, np.arange(ball.size).reshape(ball.shape), -1)
    return BallReadings(
        mass=mass[:, None],
        ball=ball[:, None],
        nominal_speed=_by_laboratory(block, log.nominal_speed)[:, None],
        flights=flights.part(order[:, None]),
    )


def observe_impact(block: SessionBlock) -> ImpactReadings:
    """Return the readings of the shots at the bat, in the order of firing, (shot,).

    `position` is the impact position as aimed, including the calibrated offset of the cannon along
    the bat [m]. Speeds are computed with the surveyed distances of the gates. All other corrections
    are applied later. The encoder readings `recoil` and `swing` are in counts. They are None if the
    rig has no such encoder. Raises `InputError` for a record that is missing or cannot be used.
    """
    log, flights = _log_and_flights(block, "impact")
    raw, along = flights.raw, _along(block)
    recoil = _rates(block, "encoder", raw.contact, fit_recoil)
    swing = _rates(
        block,
        "swing",
        raw.contact,
        lambda r, t: fit_swing(r, t, _time_per_count(block, log, raw.speed_in)),
    )
    return ImpactReadings(
        ball=log.ball.astype(np.intp),
        position=log.place + along,
        along=along,
        flights=flights,
        recoil=recoil,
        swing=swing,
    )


def _time_per_count(block: SessionBlock, log: ShotLog, speed: Array) -> Array:
    """Return the time in which the ball travels as far as the bat moves per count, (shot,) [s]."""
    constants, owner = block.calibration, block.owner
    length = _read_repeats(block, "length").mean(axis=1)
    axis = length - constants["impact.pivot.from_knob"].value
    turn = 2 * np.pi / constants["impact.swing.counts_per_turn"].value
    return np.asarray(turn[owner] * (axis[owner] - log.place - _along(block)) / speed)


def _along(block: SessionBlock) -> Array:
    """Return the offset of each impact from the set position along the bat, (shot,) [m]."""
    estimate = block.calibration.get("impact.cannon.along")
    return estimate.value[block.owner] if estimate else np.zeros(block.owner.shape)


def along_of(session: Session) -> float:
    """Return the calibrated offset of the line of fire from the set position along the bat [m].

    It is positive toward the knob. It is 0 if the calibration does not state it.
    """
    estimate = session.calibration.get("impact.cannon.along")
    return estimate.value if estimate else 0.0


def ball_constants(readings: BallReadings) -> dict[str, Estimates]:
    """Return constants for the random errors of the measured e0 of a lot, keyed by name.

    Each constant has the value 0 and a standard uncertainty u of type A. The constants are added to
    the measured values so that u is propagated to the results. Each constant has the shape
    (laboratory,):

    * One constant per ball is the error of the mean e0 of this ball.
    * One more constant is the error of the slope of e0 over speed [s/m]. It exists only if the wall
      was hit at two or more speeds.

    u is computed from the scatter of the hits of each ball around its mean, without the effect of
    the speed. The scatter is pooled over all wall hits of a laboratory. Differences between balls
    do not contribute, because the whole lot is measured.
    """
    raw, share = readings.flights.raw, readings.share
    share = share.reshape(-1, *share.shape[-2:])  # (laboratory, hit, ball)
    present = readings.ball.reshape(len(share), -1) >= 0
    ratio = np.where(present, np.reshape(raw.speed_out / raw.speed_in, present.shape), 0.0)
    speed = np.where(present, readings.nominal_speed.reshape(present.shape), 0.0)
    balls, hits = share.shape[2], (share > 0).sum(axis=1)

    def within(values: Array) -> Array:
        """Return values minus the mean of their ball, (laboratory, hit)."""
        means = (values[:, None] @ share)[:, 0]
        ball_mean = (share > 0) @ means[..., None]
        return np.where(present, values - ball_mean[..., 0], 0.0)

    steeper = within(speed)
    width = np.sum(steeper**2, axis=1)
    sloped = bool(np.ptp(readings.nominal_speed) > 0)
    deviation = within(ratio)
    slope = np.sum(steeper * deviation, axis=1) / width if sloped else np.zeros(len(share))
    rest = deviation - slope[:, None] * steeper
    dof = present.sum(axis=1) - balls - float(sloped)
    scatter = np.sum(rest**2, axis=1) / dof
    nothing = np.zeros(len(share))
    constants = {
        name: Estimates(
            value=nothing,
            u=np.sqrt(scatter / number),
            dof=dof,
            evaluation="A",
            pool=REPEATABILITY,
        )
        for name, number in zip(restitution_names(balls), hits.T, strict=True)
    }
    if sloped:
        constants[SLOPE_REPEATABILITY] = Estimates(
            value=nothing, u=np.sqrt(scatter / width), dof=dof, evaluation="A"
        )
    return constants


def restitution_names(balls: int) -> list[str]:
    """Return the names of the constants for the error of each ball's e0.

    They are ``balls.restitution_0``, ``balls.restitution_1``, ….
    """
    return [f"balls.restitution_{ball}" for ball in range(balls)]


def across_constant(block: SessionBlock) -> Estimates:
    """Return the mean square of the marks' offsets across the bat [m²], with u, (laboratory,).

    Test shots without a bat leave marks on a paper at the target. An offset is the distance of a
    mark from the aimed point. The relative u is √(2/n) for n marks, because their offsets are
    assumed to be normally distributed. Raises `InputError` if the record of the marks is missing or
    of another kind.
    """
    marks = block.impact.get("aim")
    if marks is None:
        raise InputError("impact/aim", "record", None, "this record is missing")
    if not isinstance(marks, AimMarks):
        raise InputError("impact/aim", "record", type(marks).__name__, "expected aim marks")
    across = _by_laboratory(block, marks.across)
    square, number = np.mean(across**2, axis=1), across.shape[1]
    return Estimates(
        value=square,
        u=square * sqrt(2 / number),
        dof=np.full(square.shape, float(number)),
        evaluation="A",
    )


def _rates(
    block: SessionBlock,
    channel: str,
    contact: Array,
    fit: Callable[[EncoderRecord, Array], RateFit],
) -> RateFit | None:
    """Return the encoder's rate at contact, None if the rig has no such encoder."""
    if channel not in block.impact:
        return None
    record = _channel(block, "impact", channel, EncoderRecord | RateRecord)
    where = f"impact/{channel}"
    shots = len(record.rate) if isinstance(record, RateRecord) else len(record.counts)
    if shots != len(contact):
        raise InputError(where, "shots", shots, f"the log has {len(contact)} shots")
    if isinstance(record, RateRecord):
        return rates_from_summary(record)
    _require_equal_steps(record.times, where)
    if not np.isfinite(contact).any():
        return empty_rates(len(contact))
    # Counts come from a single laboratory.
    turn = block.calibration[f"impact.{channel}.counts_per_turn"].value[0]
    try:
        return fit(unwrap(record, turn, contact), contact)
    except ValueError as fault:
        raise InputError(where, "times", None, str(fault)) from fault


def _require_equal_steps(times: Array, where: str) -> None:
    """Raise `InputError` unless times increase in steps that are equal to 0.1 %.

    Times as large as those of Unix may differ further, by their rounding in the record and here.
    """
    steps = np.diff(times)
    if not steps.size:
        raise InputError(where, "times", times.size, "allowed: at least 2")
    usual = float(np.median(steps))
    deviation = np.abs(steps - usual)
    tolerance = 5e-4 * usual + 4 * np.spacing(np.abs(times).max())
    if not (usual > 0 and (deviation < tolerance).all()):
        worst = int(np.argmax(deviation))
        allowed = f"must be {usual:.3g} s, as most others: times must increase in equal steps"
        raise InputError(where, f"step after sample {worst}", float(f"{steps[worst]:.4g}"), allowed)


def _log_and_flights(block: SessionBlock, stage: str) -> tuple[ShotLog, FlightReadings]:
    log = _channel(block, stage, "log", ShotLog)
    balls = _table(block, "ball-mass").shape[1]
    odd = (log.ball != np.floor(log.ball)) | (log.ball < 0) | (log.ball >= balls)
    if odd.any():
        allowed = f"allowed: 0 to {balls - 1}, the numbers of the weighed balls"
        raise InputError(f"{stage}/log", "ball", log.ball[odd][0], allowed)
    flights = flight_readings(block, stage)
    shots = len(flights.raw.contact)
    if len(log.ball) != shots:
        words = f"the other records of {stage} have {shots} shots"
        raise InputError(f"{stage}/log", "shots", len(log.ball), words)
    return log, flights


def _read_repeats(block: SessionBlock, channel: str) -> Array:
    """Return the readings of a channel with a single item, (laboratory, repeat).

    Raises `InputError` if a reading is not above 0.
    """
    readings = _table(block, channel)[:, 0]
    if readings.shape[1] < 2:
        raise InputError(
            f"bench/{channel}", "repeats", readings.shape[1], "needs at least 2 readings"
        )
    if not readings.min() > 0:
        raise InputError(f"bench/{channel}", "reading", readings.min(), "must be above 0")
    return np.asarray(readings)


def _table(block: SessionBlock, channel: str) -> Array:
    """Return the readings of a bench channel, (laboratory, item, repeat)."""
    record = _channel(block, "bench", channel, MassReadings | LengthReadings)
    return _by_laboratory(block, np.asarray(record.readings))


def _by_laboratory(block: SessionBlock, rows: NDArray[Any]) -> NDArray[Any]:
    """Return rows split by laboratory, (laboratory, row, ...), with equally many for each."""
    return rows.reshape(block.laboratories, -1, *rows.shape[1:])


def _channel(block: SessionBlock, stage: str, channel: str, kind: Any) -> Any:
    record = block.records.get(stage, {}).get(channel)
    if record is None:
        raise InputError(f"{stage}/{channel}", "record", None, "this record is missing")
    if not isinstance(record, kind):
        actual = type(record).__name__
        allowed = " or ".join(each.__name__ for each in get_args(kind) or (kind,))
        raise InputError(f"{stage}/{channel}", "record", actual, f"expected {allowed}")
    return record
