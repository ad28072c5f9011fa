"""From a session's raw records to observations: signals reduced, calibrations not yet applied.

What is repeated on the bench becomes one constant with a type A uncertainty beside the
calibrations' constants of type B; what is read at each shot stays an array of readings. The
algebra that joins the two is `virtual_lab.reduction.measurement`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate, mean_of_readings
from virtual_lab.records import (
    AimMarks,
    EncoderRecord,
    GateRecord,
    LengthReadings,
    MassReadings,
    PendulumRecord,
    Record,
    ShotLog,
)
from virtual_lab.reduction.gates import inbound_duration, inbound_passages, outbound_duration
from virtual_lab.reduction.recoil import RecoilFit, fit_recoil
from virtual_lab.relations.pendulum import mean_amplitude_factor
from virtual_lab.session import Session

__all__ = [
    "BallReadings",
    "ImpactReadings",
    "across_constant",
    "ball_repeatability",
    "bench_constants",
    "observe_balls",
    "observe_impact",
]

Array = NDArray[np.float64]
TICK_EVENNESS = 1e-3  # of a step; the search for rings takes them as even
READ_WITH = (  # property, channel, instrument
    ("mass", "bat-mass", "scale"),
    ("length", "length", "rule"),
    ("barrel_radius", "barrel-radius", "rule"),
    ("balance", "balance", "stand"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallReadings:
    """The balls on the scale and against the wall."""

    mass: Array  # mean scale reading a ball [kg], (ball,)
    ball: NDArray[np.int_]  # which ball, a wall hit
    nominal_speed: Array  # [m/s], (hit,)
    duration_in: Array  # shown, between the gates [s], (hit,)
    duration_out: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactReadings:
    """The shots at the bat, arrays of shape (shot,)."""

    ball: NDArray[np.int_]
    nominal_speed: Array  # [m/s]
    place: Array  # set with the rule, from the barrel tip [m]
    duration_in: Array  # shown, between the gates [s]
    duration_out: Array
    contact: Array  # shown time of contact, from the gates [s]
    recoil: RecoilFit


def bench_constants(session: Session) -> dict[str, Estimate]:
    """Return the bat's readings as constants ``bat.…`` with type A uncertainties [SI].

    The period is that of small swings: each release is corrected for its own amplitudes.
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
    """Return what the scale and the wall rig's gates say of the balls."""
    log, gates = _log_and_gates(session, "balls")
    mass = _table(session, "ball-mass").mean(axis=1)
    seen = np.isfinite(inbound_duration(gates)) & np.isfinite(outbound_duration(gates))
    ball = log.ball.astype(int)[seen]  # a hit the gates missed is no measurement of e0
    hits = np.bincount(ball, minlength=mass.size)
    if hits.min() < 2:
        raise InputError(
            "balls/gates", "ball", int(hits.argmin()), "needs 2 wall hits seen both ways"
        )
    return BallReadings(
        mass=mass,
        ball=ball,
        nominal_speed=log.nominal_speed[seen],
        duration_in=inbound_duration(gates)[seen],
        duration_out=outbound_duration(gates)[seen],
    )


def observe_impact(session: Session) -> ImpactReadings:
    """Return what gates and encoder say of the shots."""
    log, gates = _log_and_gates(session, "impact")
    encoder = _channel(session, "impact", "encoder", EncoderRecord)
    passages = inbound_passages(gates)
    nearest = session.calibration[f"impact.gates.distance_{passages.shape[1] - 1}"].value
    duration = inbound_duration(gates)
    farthest = session.calibration["impact.gates.distance_0"].value
    if not farthest > nearest:
        raise InputError(
            "session.json",
            "calibration.impact.gates.distance_0",
            farthest,
            f"must be above {nearest:g} m, the nearest gate's",
        )
    contact = passages[:, -1] + nearest * duration / (farthest - nearest)
    if len(encoder.counts) != len(log.ball):
        raise InputError(
            "impact/encoder", "shots", len(encoder.counts), f"the log has {len(log.ball)}"
        )
    ticks = np.diff(encoder.times)
    if not (ticks.size and ticks.min() > 0 and np.ptp(ticks) < TICK_EVENNESS * ticks.min()):
        raise InputError("impact/encoder", "times", None, "must rise in even steps")
    try:
        recoil = fit_recoil(encoder, contact)
    except ValueError as fault:
        raise InputError("impact/encoder", "times", None, str(fault)) from fault
    return ImpactReadings(
        ball=log.ball.astype(int),
        nominal_speed=log.nominal_speed,
        place=log.place,
        duration_in=duration,
        duration_out=outbound_duration(gates),
        contact=contact,
        recoil=recoil,
    )


def ball_repeatability(readings: BallReadings) -> Estimate:
    """Return the type A uncertainty of the lot's mean e0: 0 ± what repeated wall hits scatter.

    The scatter is that within each ball, pooled; how the balls differ is no uncertainty of a
    lot measured whole.
    """
    ratio = readings.duration_in / readings.duration_out
    balls = len(readings.mass)
    hits = np.bincount(readings.ball, minlength=balls)
    means = np.bincount(readings.ball, ratio, balls) / hits
    dof = float(ratio.size - balls)
    within = float(np.sum((ratio - means[readings.ball]) ** 2)) / dof
    return Estimate(value=0.0, u=sqrt(within / ratio.size), dof=dof, evaluation="A")


def across_constant(records: Mapping[str, Record]) -> Estimate:
    """Return the mean square of the offsets across the bat [m²] from the marks before the test.

    Its standard uncertainty is that of a mean square of n normal offsets, √(2/n) of itself.
    """
    marks = records.get("aim")
    if not isinstance(marks, AimMarks):
        raise InputError("impact/aim", "record", type(marks).__name__, "expected aim marks")
    square = float(np.mean(marks.across**2))
    number = marks.across.size
    return Estimate(value=square, u=square * sqrt(2 / number), dof=number, evaluation="A")


def _log_and_gates(session: Session, stage: str) -> tuple[ShotLog, GateRecord]:
    log = _channel(session, stage, "log", ShotLog)
    gates = _channel(session, stage, "gates", GateRecord)
    balls = len(_table(session, "ball-mass"))
    for ball in log.ball:
        if ball not in range(balls):
            raise InputError(
                f"{stage}/log", "ball", ball, f"allowed: 0 to {balls - 1}, those weighed"
            )
    if len(log.ball) != len(gates.times):
        raise InputError(stage, "shots", len(gates.times), f"the log has {len(log.ball)}")
    return log, gates


def _repeated(session: Session, channel: str) -> Array:
    """Return the readings of the one item of a bench channel, (repeat,), all above 0."""
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
        raise InputError(f"{stage}/{channel}", "record", found, f"expected {kind}")
    return record
