"""The procedure's metric for an exact curve.

Simulation and measurement share only the numbers of the procedure. All formulas here are written
independently, so that a wrong formula on either side appears as an error of the test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.physics.beam import RigidBat
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCurve:
    """True results of a bat along its barrel, for the mean ball of the lot, arrays (position,)."""

    procedure: Procedure
    bat: RigidBat[Any]
    position: Array  # distance from the barrel tip [m]
    collision_efficiency: Array
    restitution: Array  # e of ball and bat, with the support named by the procedure
    recoil_factor: Array
    ball_restitution: Array

    @property
    def quantities(self) -> dict[str, Array]:
        """The other quantities of a certificate, keyed by name."""
        return {
            "bat_performance_factor": self.restitution / self.ball_restitution,
            "collision_efficiency": self.collision_efficiency,
            "restitution": self.restitution,
            "recoil_factor": self.recoil_factor,
            "ball_restitution": self.ball_restitution,
        }

    def metric(self, control_ratio: float = 1.0) -> Array:
        """Return the metric at each position, (position,) [SI].

        `control_ratio` is the ratio of e of the control bat to its known e.
        """
        procedure = self.procedure
        e, efficiency = self._convert_to_standard_ball(control_ratio)
        match procedure.metric:
            case "restitution":
                return e
            case "bat_performance_factor":
                return e / self.ball_restitution
            case "besr":
                return (1 + 2 * efficiency) / 2
            case "batted_speed":
                return self._batted_speed(efficiency)
        raise NotImplementedError(procedure.metric)

    def objective(self, control_ratio: float = 1.0) -> Array:
        """Return the quantity that a scan maximizes: the metric, or v_f [m/s]."""
        scan = self.procedure.scan
        if scan is not None and scan.seeks == "batted_speed":
            return self._batted_speed(self._convert_to_standard_ball(control_ratio)[1])
        return self.metric(control_ratio)

    def _batted_speed(self, efficiency: Array) -> Array:
        """Return v_f [m/s], computed in the frame of the bat."""
        game, length = self.procedure.game, self.bat.length
        if game is None:
            pitch, rate = self.procedure.ball_speed, float(self.procedure.turn_rate(length))
            bat = rate * (length - self.procedure.pivot_from_knob - self.position)
            return bat + efficiency * (pitch + bat)
        axis = length - (game.axis_from_knob or 0.0)
        if game.angular_speed is None:
            assert game.bat_speed is not None
            bat = np.full(self.position.shape, game.bat_speed)
        else:
            bat = game.angular_speed * (axis - self.position)
        if game.scales_with == "mass":
            assert game.reference_mass is not None
            heavier = self.bat.mass / game.reference_mass
        else:
            assert game.reference_inertia is not None
            about = self.bat.z_cm if game.axis_from_knob is None else axis
            heavier = self.bat.inertia(about) / game.reference_inertia
        bat = bat / np.broadcast_to(heavier, bat.shape) ** game.exponent
        return np.asarray(bat + efficiency * (game.pitch_speed + bat))

    def _convert_to_standard_ball(self, control_ratio: float) -> tuple[Array, Array]:
        """Return e and e_A converted to the standard ball by the rules."""
        correction, e, e0 = self.procedure.correction, self.restitution, self.ball_restitution
        if correction is None or correction.method == "none":
            return e, self.collision_efficiency
        if correction.method == "control-bat":
            e = e / control_ratio
        elif correction.method == "ratio":
            e = correction.standard * (e / e0)
        else:  # the ball's share of the lost energy is proportional to 1 - e0²
            loss_ratio = (1 - e**2) / (1 - e0**2)
            sprung = np.sqrt(1 - loss_ratio * (1 - correction.standard**2))
            e = np.where(e > e0, sprung, correction.standard * (e / e0))
        return e, (1 + e) / (1 + self.recoil_factor) - 1


class Visits(NamedTuple):
    """Impact positions of the shots of a block, arrays (shot,)."""

    owner: NDArray[np.intp]  # laboratory of the shot
    position: Array  # set position [m]
    valid: NDArray[np.bool_]  # whether the hit is valid


def results_of_curves(
    procedure: Procedure, laboratories: int, visits: Visits, objective: Array, metric: Array
) -> Array:
    """Return the error-free result of a procedure in each laboratory, (laboratory,).

    `objective` is the quantity that a scan maximizes, and `metric` is the quantity of the result.
    Both are error-free values at the position of each shot, (shot,). `visits` states the laboratory
    and the position of each shot, and whether its hit is valid. The result has the unit of
    `metric`.

    Without a scan, the result is the mean of `metric` over the valid hits. It is NaN without a
    valid hit. A scan uses only positions that have all the valid hits that the procedure requires.
    The result is NaN without such a position.

    The best position of a scan has the largest `objective`. If the procedure requires final hits,
    which are further hits at the best position after the scan, the result is `metric` at this
    position. Otherwise, curves are fitted to `objective` and `metric` near the best position, as in
    the reduction of a test. The result is the fitted `metric` at the maximum of the fitted
    `objective`.
    """
    owner, position, valid = visits
    if procedure.scan is None:
        hits = np.bincount(owner, valid, laboratories)
        total = np.bincount(owner, np.where(valid, metric, 0.0), laboratories)
        return np.where(hits > 0, total / np.where(hits > 0, hits, 1), np.nan)
    pairs, first, inverse = np.unique(
        owner + 1j * np.round(position, 6), return_index=True, return_inverse=True
    )
    number = np.minimum(np.bincount(inverse, valid), procedure.valid_hits)
    hit = np.flatnonzero(number)
    whose = pairs.real[hit].astype(np.intp)  # sorted
    counts = np.bincount(whose, minlength=laboratories)
    turn = np.arange(hit.size) - (np.cumsum(counts) - counts)[whose]
    at, hits, objectives, metrics = np.zeros((4, laboratories, max(counts.max(initial=0), 1)))
    for table, column in ((at, pairs.imag), (hits, number)):
        table[whose, turn] = column[hit]
    for table, column in ((objectives, objective), (metrics, metric)):
        table[whose, turn] = column[first[hit]]
    complete = hits >= procedure.valid_hits
    best = np.where(complete, objectives, -np.inf).argmax(axis=1)[:, None]
    if procedure.scan.final_hits:
        top = np.where(complete, metrics, np.nan)
        return np.asarray(np.take_along_axis(top, best, axis=1)[:, 0])
    distance = np.abs(at - np.take_along_axis(at, best, axis=1))
    half_width, tolerance = procedure.scan.fit_half_width, 1e-3  # two steps of the setting [m]
    near = complete & (distance < half_width + tolerance)
    hits = np.where(distance < 2 * half_width + tolerance, hits, 0.0)
    return _value_at_maximum(at, hits, near, objectives, metrics)


def _value_at_maximum(
    at: Array, hits: NDArray[Any], near: NDArray[np.bool_], objectives: Array, metrics: Array
) -> Array:
    """Return the value of the curve `metrics` at the maximum of the curve `objectives`, (curve,).

    Both curves are cubics. `metrics` is fitted at the positions `near` the best one. `objectives`
    is fitted to all `hits` (the number at each position); its value and slope are then corrected by
    a line through its residuals at the positions `near`.
    """
    low = np.min(at, axis=1, where=near, initial=np.inf)[:, None]
    high = np.max(at, axis=1, where=near, initial=-np.inf)[:, None]
    along = (2 * at - low - high) / np.where(high > low, high - low, 1.0)
    powers = np.arange(4)

    def fit(values: Array, weights: Any, most: int = 3) -> Any:
        """Return the coefficients of weighted least squares, (curve, power, 1)."""
        degree = np.minimum((weights > 0).sum(axis=1) - 1, most)[:, None, None]
        scale = np.sqrt(weights)[..., None]
        used = (powers <= degree) & (scale > 0)
        rows = scale * np.where(used, along[..., None], 0.0) ** powers * used
        return np.linalg.pinv(rows) @ (scale * values[..., None])

    value, curve = fit(metrics, near), fit(objectives, hits)
    residual = objectives - (np.where(hits > 0, along, 0.0)[..., None] ** powers @ curve)[..., 0]
    curve = (curve + fit(residual, near, 1))[..., 0]
    flat, bend, twist = curve[:, 1:2], 2 * curve[:, 2:3], 3 * curve[:, 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -(bend + np.copysign(np.sqrt(bend**2 - 4 * twist * flat), bend)) / 2
        turns = np.concatenate([root / twist, flat / root], axis=1)
    inside = np.abs(turns) < 1  # False for NaN
    ends = np.broadcast_to([-1.0, 1.0], turns.shape)
    candidates = np.concatenate([ends, np.where(inside, turns, -1.0)], axis=1)
    rows = candidates[..., None] ** powers
    top = (rows @ curve[..., None])[..., 0].argmax(axis=1)
    top_value = (rows @ value)[np.arange(top.size), top, 0]
    return np.where(near.any(axis=1), top_value, np.nan)
