"""The algebra of the test: constants and readings to r, e_A, e, e0 and BPF.

Every function here broadcasts: a constant may be a number or a column of numbers (k, 1), a
reading is a row (n,), and what comes out is (n,) or (k, n). The uncertainty budget is made by
calling the very same functions with each constant a little off, so what is propagated is
what is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.reduction.observations import BallReadings, ImpactReadings
from virtual_lab.relations.flight import drag_rate, speed_from_passages
from virtual_lab.relations.kinematics import (
    bat_performance_factor,
    efficiency_from_restitution,
    parallel_axis,
    rebound_speed_from_recoil,
    recoil_factor_pivoted,
    restitution_from_efficiency,
)
from virtual_lab.relations.pendulum import inertia_from_period, mean_amplitude_factor

__all__ = [
    "BatProperties",
    "MeasuredBalls",
    "ShotResults",
    "bat_properties",
    "measured_balls",
    "shot_results",
]

Array = NDArray[np.float64]
Constants = Mapping[str, Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class BatProperties:
    """Measured inertial properties, numbers or columns of them [SI]."""

    mass: Array
    length: Array
    z_cm: Array
    inertia_cm: Array
    barrel_radius: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredBalls:
    """Measured balls, shape (..., ball); e0 is carried to the nominal speed."""

    mass: Array
    restitution: Array
    nominal_speed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotResults:
    """What each shot gave, shape (..., shot)."""

    speed: Array  # of the ball at the bat [m/s]
    recoil_rate: Array  # of the bat about the pivot, at the end of contact [rad/s]
    ball_mass: Array  # [kg]
    recoil_factor: Array  # about the pivot
    ball_restitution: Array  # of the ball, at the shot's own speed
    collision_efficiency: Array  # from the recoil, freed of the offset across the bat
    restitution: Array
    bat_performance_factor: Array
    nominal_ball_restitution: Array  # of the ball, at the nominal speed
    lot_ball_restitution: Array  # these four: with the lot's mean ball at the nominal speed
    lot_recoil_factor: Array
    lot_restitution: Array
    lot_collision_efficiency: Array
    rebound_efficiency: Array  # e_A from the ball's own rebound, NaN: the gates did not see it


def bat_properties(x: Constants) -> BatProperties:
    """Return mass, balance and inertia from the bench's readings and calibrations."""
    mass = (x["bat.mass"] - x["bench.scale.zero"]) / x["bench.scale.span"]
    length = x["bat.length"] - x["bench.rule.offset"]
    z_cm = x["bat.balance"] - x["bench.stand.offset"]
    return BatProperties(
        mass=mass,
        length=length,
        z_cm=z_cm,
        inertia_cm=_inertia_cm(x, mass, length, z_cm),
        barrel_radius=x["bat.barrel_radius"] - x["bench.rule.offset"],
    )


def _inertia_cm(x: Constants, mass: Array, length: Array, z_cm: Array) -> Array:
    """Return the inertia about the centre of mass, from the period of bat and clamp together."""
    lever = length - x["bench.pendulum.pivot_from_knob"] - z_cm
    first, last = x["bat.first_amplitude"], x["bat.last_amplitude"]
    swings = int(x["bat.swings"].flat[0])
    offset = x["bench.pendulum.amplitude_offset"]
    period = (
        x["bat.period"]
        / x["bench.pendulum.clock"]
        * mean_amplitude_factor(first, last, swings)
        / mean_amplitude_factor(first - offset, last - offset, swings)
    )
    moment = mass * lever + x["bench.pendulum.clamp_moment"]
    both = inertia_from_period(period, moment, x["bench.pendulum.gravity"])
    return both - x["bench.pendulum.clamp_inertia"] - parallel_axis(0.0, mass, lever)


def measured_balls(x: Constants, readings: BallReadings) -> MeasuredBalls:
    """Return the balls' masses and their mean e0 over the wall hits, at the nominal speed."""
    mass = (readings.mass - x["bench.scale.zero"]) / x["bench.scale.span"]
    drag = drag_rate(
        x["hall.air.density"],
        x["hall.air.drag_coefficient"],
        x["ball.radius"],
        mass[..., readings.ball],
    )
    speed_in, speed_out = _gate_speeds(x, "balls", readings, drag)
    nominal = float(readings.nominal_speed.mean())
    hits = speed_out / speed_in - x["ball.restitution_slope"] * (speed_in - nominal)
    restitution = np.stack(
        [hits[..., readings.ball == ball].mean(axis=-1) for ball in range(len(readings.mass))],
        axis=-1,
    )
    return MeasuredBalls(
        mass=np.broadcast_to(mass, restitution.shape),
        restitution=restitution,
        nominal_speed=nominal,
    )


def shot_results(
    x: Constants, bat: BatProperties, balls: MeasuredBalls, readings: ImpactReadings
) -> ShotResults:
    """Return e_A by angular momentum about the pivot and Eq. (2), e by Eq. (6), BPF by Eq. (5)."""
    mass = balls.mass[..., readings.ball]
    drag = drag_rate(x["hall.air.density"], x["hall.air.drag_coefficient"], x["ball.radius"], mass)
    speed, rebound = _gate_speeds(x, "impact", readings, drag)
    axis = bat.length - x["impact.pivot.from_knob"]
    turning = parallel_axis(bat.inertia_cm, bat.mass, axis - bat.z_cm)
    lever = axis - readings.place - x["impact.cannon.along"]
    scale = x["impact.encoder.scale"] * x["impact.encoder.counts_per_turn"]
    rate = 2 * np.pi * readings.recoil.rate * x["impact.gates.clock"] / scale
    seen = rebound_speed_from_recoil(turning, rate, mass, lever, speed) / speed
    # mean of sin² of the contact angle: hits beside the axis only ever lower what is seen
    sine = x["impact.aim.across_square"] / (bat.barrel_radius + x["ball.radius"]) ** 2
    efficiency = (seen + sine) / (1 - sine)
    # the recoil factor is that of the axis and place asked for: e_A hardly knows where they are,
    # so what a misplaced axis or ball spoils is the angular momentum above and nothing here
    asked = bat.length - x["procedure.pivot_from_knob"]
    inertia = parallel_axis(bat.inertia_cm, bat.mass, asked - bat.z_cm)
    reach = asked - readings.place
    recoil = recoil_factor_pivoted(mass, inertia, reach)
    restitution = restitution_from_efficiency(efficiency, recoil)
    nominal_e0 = balls.restitution[..., readings.ball]
    e0 = nominal_e0 + x["ball.restitution_slope"] * (speed - balls.nominal_speed)
    factor = bat_performance_factor(restitution, e0)
    lot_e0 = balls.restitution.mean(axis=-1, keepdims=True) + x["balls.repeatability"]
    lot_recoil = recoil_factor_pivoted(balls.mass.mean(axis=-1, keepdims=True), inertia, reach)
    lot_restitution = factor * lot_e0
    return ShotResults(
        speed=speed,
        recoil_rate=rate,
        ball_mass=mass,
        recoil_factor=np.asarray(recoil),
        ball_restitution=e0,
        collision_efficiency=efficiency,
        restitution=np.asarray(restitution),
        bat_performance_factor=np.asarray(factor),
        nominal_ball_restitution=nominal_e0,
        lot_ball_restitution=np.broadcast_to(lot_e0, np.shape(factor)),
        lot_recoil_factor=np.broadcast_to(lot_recoil, np.shape(factor)),
        lot_restitution=np.asarray(lot_restitution),
        lot_collision_efficiency=np.asarray(
            efficiency_from_restitution(lot_restitution, lot_recoil)
        ),
        rebound_efficiency=rebound / speed,
    )


def _gate_speeds(
    x: Constants, stage: str, readings: BallReadings | ImpactReadings, drag: Array
) -> tuple[Array, Array]:
    """Return the speeds at the target, going in and coming back [m/s]."""
    gates = [key for key in x if key.startswith(f"{stage}.gates.distance_")]
    far, near = x[f"{stage}.gates.distance_0"], x[f"{stage}.gates.distance_{len(gates) - 1}"]
    clock = x[f"{stage}.gates.clock"]
    inward = speed_from_passages(far, near, readings.duration_in / clock, drag, outbound=False)
    outward = speed_from_passages(far, near, readings.duration_out / clock, drag, outbound=True)
    return inward, outward
