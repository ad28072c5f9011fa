"""From a session's raw records to observations, before calibrations are applied.

Repeated bench readings become one constant with a type A uncertainty, beside the calibration
constants of type B; readings of each shot remain an array. The algebra that combines the two is
`virtual_lab.measurement.reduction.shot_algebra`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.makers import flight_readings
from virtual_lab.measurement.reduction.rate import RateFit, summed_up, unseen
from virtual_lab.measurement.reduction.recoil import fit_recoil
from virtual_lab.measurement.reduction.swing import fit_swing
from virtual_lab.records import (
    AimMarks,
    EncoderRecord,
    LengthReadings,
    MassReadings,
    PendulumRecord,
    RateRecord,
    Record,
    ShotLog,
)
from virtual_lab.records.session import Session
from virtual_lab.relations.pendulum import mean_amplitude_factor
from virtual_lab.uncertainty.estimate import Estimate, mean_of_readings
from virtual_lab.units import Array

REPEATABILITY = "balls.repeatability"
SLOPE_REPEATABILITY = "balls.slope_repeatability"
READ_WITH = (  # property, channel, instrument
    ("mass", "bat-mass", "scale"),
    ("length", "length", "rule"),
    ("barrel_radius", "barrel-radius", "rule"),
    ("balance", "balance", "stand"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallReadings:
    """Readings of the balls on the scale and at the wall."""

    mass: Array  # mean scale reading a ball [kg], (ball,)
    ball: NDArray[np.int_]  # which ball, a wall hit
    nominal_speed: Array  # [m/s], (hit,)
    seen: FlightReadings


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactReadings:
    """The shots at the bat, arrays of shape (shot,)."""

    ball: NDArray[np.int_]
    place: Array  # aimed at: as set, with what the cannon is off, from the barrel tip [m]
    seen: FlightReadings
    recoil: RateFit | None  # of a bat that was at rest, where an encoder watched it
    swing: RateFit | None  # of a bat that was swung
    along: float = 0.0  # what the cannon is off, as `place` takes it [m]


def bench_constants(session: Session) -> dict[str, Estimate]:
    """Return the bat's readings as constants ``bat.…`` with type A uncertainties [SI].

    The period is that of small swings: each release is corrected for its amplitudes.
    """
    pendulum = _channel(session, "bench", "pendulum", PendulumRecord)
    releases, passages = pendulum.times.shape
    swings = passages - 1
    if releases < 2 or swings < 1:
        raise InputError(
            "bench/pendulum", "size", f"{releases} x {passages}", "needs 2 releases of 2 passages"
        )
    for name in ("first_amplitude", "last_amplitude"):
        if not (getattr(pendulum, name) > 0).all():
            raise InputError("bench/pendulum", name, None, "amplitudes must be above 0")
    shown = (pendulum.times[:, -1] - pendulum.times[:, 0]) / swings
    first, last = pendulum.first_amplitude, pendulum.last_amplitude
    constants = {
        f"bat.{name}": mean_of_readings(
            _repeated(session, channel),
            least_u=session.calibration[f"bench.{instrument}.resolution"].value / sqrt(12),
        )
        for name, channel, instrument in READ_WITH
    }
    small = shown / mean_amplitude_factor(first, last, swings)
    constants["bat.period"] = mean_of_readings(small)
    constants["bat.first_amplitude"] = Estimate(value=float(first.mean()))
    constants["bat.last_amplitude"] = Estimate(value=float(last.mean()))
    constants["bat.swings"] = Estimate(value=float(swings))
    return constants


def observe_balls(session: Session) -> BallReadings:
    """Return the ball readings from the scale and the instrument at the wall."""
    log, seen = _log_and_flights(session, "balls")
    mass = _table(session, "ball-mass").mean(axis=1)
    raw = seen.raw
    both = np.isfinite(raw.speed_in) & np.isfinite(raw.speed_out)
    ball = log.ball.astype(int)[both]  # a hit not seen both ways is no measurement of e0
    hits = np.bincount(ball, minlength=mass.size)
    if hits.min() < 2:
        raise InputError("balls", "ball", int(hits.argmin()), "needs 2 wall hits seen both ways")
    return BallReadings(
        mass=mass, ball=ball, nominal_speed=log.nominal_speed[both], seen=seen.part(both)
    )


def observe_impact(session: Session) -> ImpactReadings:
    """Return the readings of the ball and of the encoders for the shots."""
    log, seen = _log_and_flights(session, "impact")
    raw, along = seen.raw, along_of(session)
    recoil = _rates(session, "encoder", raw.contact, fit_recoil)
    swing = _rates(
        session,
        "swing",
        raw.contact,
        lambda r, t: fit_swing(r, t, _reach(session, log, raw.speed_in)),
    )
    return ImpactReadings(
        ball=log.ball.astype(int),
        place=log.place + along,
        along=along,
        seen=seen,
        recoil=recoil,
        swing=swing,
    )


def _reach(session: Session, log: ShotLog, speed: Array) -> Array:
    """Return the ball's time over the bat's motion for one encoder count, (shot,)."""
    known = session.calibration
    axis = _repeated(session, "length").mean() - known["impact.pivot.from_knob"].value
    turn = 2 * np.pi / known["impact.swing.counts_per_turn"].value
    return np.asarray(turn * (axis - log.place - along_of(session)) / speed)


def along_of(session: Session) -> float:
    """Return the offset along the bat of impacts from the set place [m]."""
    known = session.calibration.get("impact.cannon.along")
    return known.value if known else 0.0


def ball_constants(readings: BallReadings) -> dict[str, Estimate]:
    """Return type A constants: 0 ± u of each ball's mean e0, and of e0's slope.

    The scatter is that within each ball and speed, pooled over all wall hits; differences between
    balls are no uncertainty, because the whole lot is measured. The slope [s/m] has a constant
    only if the wall was hit at two or more speeds.
    """
    raw = readings.seen.raw
    ratio = raw.speed_out / raw.speed_in
    balls = len(readings.mass)
    hits = np.bincount(readings.ball, minlength=balls)

    def within(values: Array) -> Array:
        means = np.bincount(readings.ball, values, balls) / hits
        return np.asarray(values - means[readings.ball])

    steeper = within(readings.nominal_speed)
    width = float(np.sum(steeper**2))
    sloped = bool(np.ptp(readings.nominal_speed) > 0)
    slope = float(np.sum(steeper * within(ratio))) / width if sloped else 0.0
    rest = within(ratio) - slope * steeper
    dof = float(ratio.size - balls - sloped)
    scatter = float(np.sum(rest**2)) / dof
    constants = {
        name: Estimate(
            value=0.0, u=sqrt(scatter / number), dof=dof, evaluation="A", pool=REPEATABILITY
        )
        for name, number in zip(restitution_names(balls), hits, strict=True)
    }
    if sloped:
        constants[SLOPE_REPEATABILITY] = Estimate(
            value=0.0, u=sqrt(scatter / width), dof=dof, evaluation="A"
        )
    return constants


def restitution_names(balls: int) -> list[str]:
    """Return the names of the constants for the error of each ball's mean e0."""
    return [f"balls.restitution_{ball}" for ball in range(balls)]


def across_constant(records: Mapping[str, Record]) -> Estimate:
    """Return the mean square of the offsets across the bat [m²] from the marks before the test.

    Its relative standard uncertainty is that of a mean square of n normal offsets, √(2/n).
    """
    marks = records.get("aim")
    if marks is None:
        raise InputError("impact/aim", "record", None, "this record is missing")
    if not isinstance(marks, AimMarks):
        raise InputError("impact/aim", "record", type(marks).__name__, "expected aim marks")
    square = float(np.mean(marks.across**2))
    number = marks.across.size
    return Estimate(value=square, u=square * sqrt(2 / number), dof=number, evaluation="A")


def _rates(
    session: Session,
    channel: str,
    contact: Array,
    fit: Callable[[EncoderRecord, Array], RateFit],
) -> RateFit | None:
    """Return the encoder's rate at contact, None if the rig has no such encoder."""
    if channel not in session.records["impact"]:
        return None
    record = _channel(session, "impact", channel, EncoderRecord | RateRecord)
    where = f"impact/{channel}"
    shots = len(record.rate) if isinstance(record, RateRecord) else len(record.counts)
    if shots != len(contact):
        raise InputError(where, "shots", shots, f"the log has {len(contact)}")
    if isinstance(record, RateRecord):
        return summed_up(record)
    ticks = np.diff(record.times)
    if not (ticks.size and ticks.min() > 0 and np.ptp(ticks) < 1e-3 * ticks.min()):
        raise InputError(where, "times", None, "must rise in even steps")
    if not np.isfinite(contact).any():
        return unseen(len(contact))
    try:
        return fit(record, contact)
    except ValueError as fault:
        raise InputError(where, "times", None, str(fault)) from fault


def _log_and_flights(session: Session, stage: str) -> tuple[ShotLog, FlightReadings]:
    log = _channel(session, stage, "log", ShotLog)
    balls = len(_table(session, "ball-mass"))
    odd = (log.ball != np.floor(log.ball)) | (log.ball < 0) | (log.ball >= balls)
    if odd.any():
        allowed = f"allowed: 0 to {balls - 1}, those weighed, counted from 0"
        raise InputError(f"{stage}/log", "ball", log.ball[odd][0], allowed)
    seen = flight_readings(session, stage)
    shots = len(seen.raw.contact)
    if len(log.ball) != shots:
        raise InputError(stage, "shots", shots, f"the log has {len(log.ball)}")
    return log, seen


def _repeated(session: Session, channel: str) -> Array:
    """Return the readings of a bench channel with one item, (repeat,), all above 0."""
    readings = _table(session, channel)[0]
    if readings.size < 2:
        raise InputError(f"bench/{channel}", "repeats", readings.size, "needs 2 readings or more")
    if not readings.min() > 0:
        raise InputError(f"bench/{channel}", "reading", readings.min(), "must be above 0")
    return np.asarray(readings)


def _table(session: Session, channel: str) -> Array:
    """Return the readings of a bench channel, (item, repeat)."""
    record = _channel(session, "bench", channel, MassReadings | LengthReadings)
    return np.asarray(record.readings)


def _channel(session: Session, stage: str, channel: str, kind: Any) -> Any:
    record = session.records.get(stage, {}).get(channel)
    if record is None:
        raise InputError(f"{stage}/{channel}", "record", None, "this record is missing")
    if not isinstance(record, kind):
        found = type(record).__name__
        allowed = " or ".join(each.__name__ for each in get_args(kind) or (kind,))
        raise InputError(f"{stage}/{channel}", "record", found, f"expected {allowed}")
    return record
