"""Scatter of results that each factor alone should cause, to first order, without a simulation.

All effects are computed for one nominal test. The effect of calibration errors is taken from its
uncertainty budget. The derivatives of e with respect to the properties of the ball are computed by
the reference model of the collision, which shares no solver with the simulated tests. All other
effects are closed forms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab.true_metric import TrueCurve
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Pinned, rigid_bat

FOUND, NORMALIZED = "as found", "normalized"  # names of results
STEP = 1e-5  # step of the derivatives with respect to e and e0


@dataclass(frozen=True, kw_only=True)
class NominalTest:
    """Nominal test of a bat by a procedure. All values are in SI."""

    procedure: Procedure
    bat: BatSpec
    ball: BallSpec
    humidity_spread: float  # standard deviation of the store's relative humidity
    place: float
    speed: float  # relative speed of ball and bat
    e: float
    e0: float
    r: float
    inertia: float  # moment of inertia of the bat about the pivot
    calibrations: Mapping[str, float]  # effect of all calibration errors, by result
    radii: Mapping[str, float]  # effect of the radius of the lot

    def by_level(self, result: str) -> float:
        """Return the derivative of a result with respect to the level of the balls' e0."""
        by_e, by_e0 = self.slopes(result)
        return by_e * self.derivatives[0] + by_e0

    def by_slope(self, result: str) -> float:
        """Return the derivative of a result with respect to the slope of e0 over speed.

        e0 at the speed of its line stays the same. A test with one wall speed measures e0 there.
        """
        by_e, by_e0 = self.slopes(result)
        walls, speed = self.procedure.wall_speeds, self.ball.restitution.speed
        measured = self.speed if len(walls) > 1 else walls[0]
        return by_e * self.derivatives[0] * (self.speed - speed) + by_e0 * (measured - speed)

    def admitted_spread(self, spread: float) -> float:
        """Return the standard deviation of e0 between lots that the procedure's window admits."""
        from scipy.stats import truncnorm

        windows, line = self.procedure.windows, self.ball.restitution
        if not spread:
            return 0.0
        low, high = (
            (end - float(line.at(windows.ball_restitution_speed))) / spread
            for end in (windows.ball_restitution_low, windows.ball_restitution_high)
        )
        return spread * float(truncnorm(low, high).std())

    @cached_property
    def derivatives(self) -> tuple[float, float]:
        """∂e/∂e0 and ∂e/∂ln k by the reference model, at the position and speed of the test."""
        body, step = self.bat.body, 0.02
        away = step * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
        scenes = Scenes.of(
            impact_position=np.full(4, self.place),
            relative_speed=np.full(4, self.speed),
            ball_mass=np.full(4, self.ball.mass),
            ball_restitution=self.e0 + away[0],
            stiffness=self.ball.stiffness * np.exp(away[1]),
            exponent=np.full(4, self.ball.exponent),
        )
        support = Pinned(body.length - self.procedure.pivot_from_knob)
        e_A = ReferenceModel.of(body, support).collide(scenes).collision_efficiency
        by_e0, by_stiffness = (1 + self.r) * (e_A[::2] - e_A[1::2]) / (2 * step)
        return float(by_e0), float(by_stiffness)

    def slopes(self, result: str) -> tuple[float, float]:
        """Return the derivatives of a result with respect to e and to the measured e0."""
        high, low = (
            (self._value(self.e + dx, self.e0, result), self._value(self.e, self.e0 + dx, result))
            for dx in (STEP, -STEP)
        )
        by_e, by_e0 = ((a - b) / (2 * STEP) for a, b in zip(high, low, strict=True))
        return by_e, by_e0

    def _value(self, e: float, e0: float, result: str) -> float:
        """Return a result, given e and the measured e0."""
        curve = TrueCurve(
            procedure=self.procedure if result == NORMALIZED else self.procedure.as_found,
            bat=rigid_bat(self.bat.body),
            position=np.array([self.place]),
            collision_efficiency=np.array([(e - self.r) / (1 + self.r)]),
            restitution=np.array([e]),
            recoil_factor=np.array([self.r]),
            ball_restitution=np.array([e0]),
        )
        return float(curve.metric()[0])
