"""The procedure's metric of an exact curve.

Simulation and measurement share only the numbers of the procedure. Every formula here is written
independently, so that a wrong formula on either side shows as an error of the test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import brentq

from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.physics.beam import Beam
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueCurve:
    """A bat along its barrel with the lot's mean ball at nominal speeds, arrays (place,)."""

    procedure: Procedure
    beam: Beam
    place: Array  # from the barrel tip [m]
    collision_efficiency: Array
    restitution: Array  # of ball and bat, on the support the procedure names
    recoil_factor: Array
    ball_restitution: Array

    @property
    def quantities(self) -> dict[str, Array]:
        """The other quantities of a certificate, by name."""
        return {
            "bat_performance_factor": self.restitution / self.ball_restitution,
            "collision_efficiency": self.collision_efficiency,
            "restitution": self.restitution,
            "recoil_factor": self.recoil_factor,
            "ball_restitution": self.ball_restitution,
        }

    def metric(self, control: float = 1.0) -> Array:
        """Return the metric. `control`: e of the control bat with this lot over its known e."""
        procedure = self.procedure
        e, efficiency = self._with_standard_ball(control)
        match procedure.metric:
            case "restitution":
                return e
            case "bat_performance_factor":
                return e / self.ball_restitution
            case "besr":
                return (1 + 2 * efficiency) / 2
            case "batted_speed":
                return self._batted(efficiency)

    def sought(self, control: float = 1.0) -> Array:
        """Return the quantity that a scan maximises: the metric, or v_f [m/s]."""
        scan = self.procedure.scan
        if scan is not None and scan.seeks == "batted_speed":
            return self._batted(self.collision_efficiency)
        return self.metric(control)

    def _batted(self, efficiency: Array) -> Array:
        """Return v_f [m/s]: in the bat's frame the ball comes with both speeds."""
        game, length = self.procedure.game, self.beam.length
        if game is None:
            pitch, rate = self.procedure.ball_speed, float(self.procedure.turn_rate(length))
            bat = rate * (length - self.procedure.pivot_from_knob - self.place)
            return bat + efficiency * (pitch + bat)
        axis = length - (game.axis_from_knob or 0.0)
        if game.angular_speed is None:
            assert game.bat_speed is not None
            bat = np.full(self.place.shape, game.bat_speed)
        else:
            bat = game.angular_speed * (axis - self.place)
        if game.scales_with == "mass":
            assert game.reference_mass is not None
            heavier = self.beam.mass / game.reference_mass
        else:
            assert game.reference_inertia is not None
            about = self.beam.z_cm if game.axis_from_knob is None else axis
            heavier = self.beam.inertia(about) / game.reference_inertia
        bat = bat / heavier**game.exponent
        return np.asarray(bat + efficiency * (game.pitch_speed + bat))

    def _with_standard_ball(self, control: float) -> tuple[Array, Array]:
        """Return e and e_A as the rules convert them to the standard ball."""
        correction, e, e0 = self.procedure.correction, self.restitution, self.ball_restitution
        if correction is None or correction.method == "none":
            return e, self.collision_efficiency
        if correction.method == "control-bat":
            e = e / control
        elif correction.method == "ratio":
            e = correction.standard * (e / e0)
        else:  # of the energy that the shell does not return, the ball's share goes with 1 - e0²
            lost = (1 - e**2) / (1 - e0**2)
            sprung = np.sqrt(1 - lost * (1 - correction.standard**2))
            e = np.where(e > e0, sprung, correction.standard * (e / e0))
        return e, (1 + e) / (1 + self.recoil_factor) - 1


def scan_result(
    procedure: Procedure, place: Array, valid: NDArray[np.bool_], sought: Array, metric: Array
) -> float:
    """Return the procedure's result of an exact curve at the places that a test visited.

    Parameters
    ----------
    procedure
        With or without a scan.
    place, valid
        Set [m], and which hits counted, (shot,).
    sought, metric
        Of the exact curve at each shot's place, (shot,).
    """
    scan = procedure.scan
    if scan is None:
        return float(metric[valid].mean())
    each, first, back = np.unique(np.round(place, 6), return_index=True, return_inverse=True)
    whole = np.bincount(back, valid) >= procedure.valid_hits
    at, looked, wanted = each[whole], sought[first][whole], metric[first][whole]
    best = int(np.argmax(looked))
    if scan.final_hits:
        return float(wanted[best])
    near = np.abs(at - at[best]) < scan.fit_half_width + 1e-3  # m, two steps in setting it
    degree = min(3, int(near.sum()) - 1)
    curve, value = (Polynomial.fit(at[near], own[near], degree) for own in (looked, wanted))
    slope, along = curve.deriv(), np.linspace(curve.domain[0], curve.domain[1], 64)
    falls = np.flatnonzero(np.diff(np.sign(slope(along))) < 0)
    turns = [brentq(slope, along[i], along[i + 1], xtol=1e-14) for i in falls]
    candidates = np.array([*curve.domain, *turns])
    return float(value(candidates[np.argmax(curve(candidates))]))
