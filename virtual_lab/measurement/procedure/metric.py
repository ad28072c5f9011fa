"""The metric of a procedure at each impact position, as a function of the collision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.measurement.procedure.rules import BallCorrection, Game, Procedure
from virtual_lab.measurement.reduction.kinematics import (
    bat_performance_factor,
    batted_speed,
    besr,
    efficiency_from_restitution,
    parallel_axis,
    restitution_of_standard_ball,
)
from virtual_lab.measurement.reduction.shot_algebra import BatProperties, SetResults
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A bat along its barrel at the test's speeds, with the mean ball of the lot, (..., n)."""

    position: Array  # distance from the barrel tip [m]
    collision_efficiency: Array
    recoil_factor: Array
    restitution: Array
    ball_restitution: Array

    @classmethod
    def from_shots(cls, shots: SetResults) -> Curve:
        """Return the curve of shots, with one impact position per shot."""
        return cls(
            position=shots.position,
            collision_efficiency=shots.lot_collision_efficiency,
            recoil_factor=shots.lot_recoil_factor,
            restitution=shots.lot_restitution,
            ball_restitution=shots.lot_ball_restitution,
        )


def metric_of(
    procedure: Procedure, *, control_ratio: Array | float = 1.0
) -> Callable[[Curve, BatProperties], Array]:
    """Return a function that computes the procedure's metric along the barrel of a bat [SI].

    The function takes a `Curve` and the bat's properties. It returns an array with the shape of the
    curve's arrays. The metric is dimensionless, except v_f [m/s].

    Parameters
    ----------
    procedure
        Test procedure. Only its metric, its ball correction, and its speeds of pitch and bat are
        used.
    control_ratio
        Measured e of the control bat with the test's lot of balls, divided by the known e of the
        control bat. Only the correction ``control-bat`` uses it.
    """

    def metric(curve: Curve, bat: BatProperties) -> Array:
        e = _convert_to_standard_ball(procedure.correction, curve, control_ratio)
        e_A = efficiency_from_restitution(e, curve.recoil_factor)
        match procedure.metric:
            case "restitution":
                return np.asarray(e)
            case "bat_performance_factor":
                return np.asarray(bat_performance_factor(e, curve.ball_restitution))
            case "besr":
                return np.asarray(besr(e_A))
            case "batted_speed":
                pitch, bat_speed = field_speeds(procedure, curve.position, bat)
                return np.asarray(batted_speed(e_A, pitch, bat_speed))
        raise NotImplementedError(procedure.metric)

    return metric


@dataclass(frozen=True, slots=True)
class Objective(AlignedArrays):
    """The quantity that a scan maximizes, and its derivative by the metric, arrays (..., shot)."""

    value: Array
    gain: Array

    aligned: ClassVar = EVERY_FIELD


def objective_of(
    procedure: Procedure, metric: Array, position: Array, bat: BatProperties
) -> Objective:
    """Return the quantity that a scan maximizes, and its derivative with respect to the metric.

    The quantity and its derivative have the shape of `metric`, (..., shot). If the scan seeks the
    batted-ball speed, the quantity is v_f [m/s] at the speeds of the procedure, and `metric` must
    be BESR. Otherwise, and without a scan, the quantity is the metric and its derivative is 1.
    `position` is the impact position from the barrel tip [m].
    """
    if procedure.scan is None or procedure.scan.seeks == "metric":
        return Objective(metric, np.ones_like(metric))
    pitch, bat_speed = field_speeds(procedure, position, bat)
    efficiency = metric - besr(0.0)
    return Objective(np.asarray(batted_speed(efficiency, pitch, bat_speed)), pitch + bat_speed)


def field_speeds(procedure: Procedure, position: Array, bat: BatProperties) -> tuple[float, Array]:
    """Return the pitch speed, a number, and the bat speed, an array like `position` [m/s].

    The two speeds are used to compute the batted-ball speed. `position` is the impact position from
    the barrel tip [m]. The bat speed is the speed at this position. If the procedure states game
    conditions, both are the speeds in the game. Otherwise both are the speeds in the test.
    """
    game = procedure.game
    if game is None:
        lever = bat.length - procedure.pivot_from_knob - position
        return procedure.ball_speed, np.asarray(procedure.turn_rate(bat.length) * lever)
    return game.pitch_speed, _game_speed(game, position, bat)


def _game_speed(game: Game, position: Array, bat: BatProperties) -> Array:
    if game.axis_from_knob is None:
        radius, inertia = np.ones_like(position), bat.inertia_cm
    else:
        axis = bat.length - game.axis_from_knob
        lever = axis - bat.z_cm
        radius = axis - position
        inertia = np.asarray(parallel_axis(bat.inertia_cm, bat.mass, lever))
    actual, reference = (
        (bat.mass, game.reference_mass)
        if game.scales_with == "mass"
        else (inertia, game.reference_inertia)
    )
    speed = game.bat_speed if game.angular_speed is None else game.angular_speed
    assert speed is not None  # checked by Game
    assert reference is not None
    return np.asarray(speed * radius * (reference / actual) ** game.exponent)


def _convert_to_standard_ball(
    correction: BallCorrection | None, curve: Curve, control_ratio: Array | float
) -> Array:
    """Return e converted to the standard ball."""
    e, e0 = curve.restitution, curve.ball_restitution
    if correction is None or correction.method == "none":
        return e
    if correction.method == "control-bat":
        return e / control_ratio
    if correction.method == "ratio":
        return e * correction.standard / e0
    return np.asarray(restitution_of_standard_ball(e, e0, correction.standard))
