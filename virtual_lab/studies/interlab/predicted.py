"""Scatter of results that each factor alone should cause, to first order, without a simulation.

The point of operation is one nominal test. The effect of calibration errors is that of its
uncertainty budget; all other effects are closed forms of the paper's Eqs. (2) to (12), of the
trampoline law e² = (e0² R + 1)/(R + 1), and of the energy that a half sine of force leaves in a
bending mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Any, Self

import numpy as np

from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab import BlockTest
from virtual_lab.lab.certify import certify_block
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.simulation.collision.patch import PATCH, patch_shape
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.studies.interlab.playing import FOUND, NORMALISED, Play

BENDING_MODES = 14
STEP = 1e-5  # step of the derivatives with respect to e and e0


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """Nominal test of a bat by a procedure. All values are in SI."""

    procedure: Procedure
    bat: BatSpec
    ball: BallSpec
    humidity_spread: float  # standard deviation of the store's relative humidity
    wall_spread: float
    clamp_spread: float
    place: float
    speed: float  # relative speed of ball and bat
    e: float
    e0: float
    r: float
    inertia: float  # moment of inertia of the bat about the pivot
    bat_speed: float  # speed in the game, for a batted speed
    calibrations: Mapping[str, float]  # effect of all calibration errors, by name of the result
    radii: Mapping[str, float]  # effect of the radius of the lot

    @classmethod
    def of(cls, play: Play) -> Self:
        """Return the point of operation of a study's bat and procedure."""
        study = play.study.spec
        nominal = [name for name in study.named if name not in ("wall", "clamp")]
        with play.round_robin(nominal, ()) as shared:
            setup = replace(shared.setup, seed=study.seed, number=np.zeros(1, int))
            tested = certify_block(setup)
        certified, rules, ball = tested.certified, setup.rules.spec, setup.ball.spec
        value = {name: float(each.value[0]) for name, each in certified.results.items()}
        bat, place = certified.reduced.preparation.bat, float(certified.outcome.place[0])
        length, mass = float(np.ravel(bat.length)[0]), float(np.ravel(bat.mass)[0])
        axis = length - rules.pivot_from_knob
        lever = axis - float(np.ravel(bat.z_cm)[0])
        e_A = value["collision_efficiency"]
        found = value[AS_FOUND] if rules.normalized else value["metric"]
        factors = study.factors
        bench: Any = tested.laboratories.stations[Stage.BENCH]
        store = bench.spec.store
        return cls(
            procedure=rules,
            bat=setup.bat.spec,
            ball=ball,
            humidity_spread=store.humidity_spread if store else 0.0,
            wall_spread=(factors.wall and factors.wall.spread) or 0.0,
            clamp_spread=(factors.clamp and factors.clamp.spread) or 0.0,
            place=place,
            speed=rules.ball_speed + float(rules.turn_rate(length)) * (axis - place),
            e=value["restitution"],
            e0=value["ball_restitution"],
            r=value["recoil_factor"],
            inertia=float(np.ravel(bat.inertia_cm)[0]) + mass * lever**2,
            bat_speed=(found - e_A * _pitch(rules)) / (1 + e_A),
            calibrations=_effects(tested, set(tested.laboratories.calibration) - {*_LOT}),
            radii=_effects(tested, {_LOT[0]}),
        )

    def scatter(self, factor: str, result: str) -> float:
        """Return the standard deviation of a result that a factor alone causes [SI]."""
        rules, line, law = self.procedure, self.ball.restitution, self.ball.humidity
        by_e, by_e0 = self._slopes(result)
        of_ball = by_e * self._follows  # effect of e0 on the collision
        measured = self.speed if len(rules.wall_speeds) > 1 else rules.wall_speeds[0]
        slope = of_ball * (self.speed - line.speed) + by_e0 * (measured - line.speed)
        level, damp = of_ball + by_e0, 0.0 if law is None else law.slope
        # the clamp takes its share of the angular momentum that recoil shows
        clamp = by_e * (1 + self.e) / self.inertia if rules.reads == "recoil" else 0.0
        effects = {
            "lot": hypot(level * line.value_u, slope * line.slope_u, self.radii[result]),
            "stiffness": by_e * self._stiffer * self.ball.stiffness_spread,
            "store": level * damp * self.e0 * self.humidity_spread,
            "calibration": self.calibrations[result],
            "wall": by_e0 * self.e0 * self.wall_spread,
            "clamp": clamp * self.clamp_spread,
        }
        return abs(effects[factor])

    @property
    def _follows(self) -> float:
        """∂e/∂e0: the ball loses a fixed share of the energy that the bat leaves to it."""
        if self.e <= self.e0:
            return self.e / self.e0
        return (1 - self.e**2) / (1 - self.e0**2) * self.e0 / self.e

    @property
    def _stiffer(self) -> float:
        """∂e/∂ln k of the ball: a wall that yields less, and a shorter blow on the bending modes.

        With R = shell over ball stiffness, ∂e²/∂ln k = R (1 - e0²)/(R + 1)². Bending takes the
        share μ (1 + e)² Σ (φ S)² of the energy of relative motion, with the reduced mass μ, the
        modes φ and the spectrum S of a half sine, and e² is lower by e0² times this share.
        """
        body, step = self.bat.body, 0.01
        support = Pinned(body.length - self.procedure.pivot_from_knob)
        modes = modes_of(body, support, BENDING_MODES)
        bends = slice(modes.rigid, modes.rigid + BENDING_MODES)
        shape = patch_shape(modes, np.array([self.place]), PATCH)[0, bends]
        reduced = self.ball.mass / (1 + self.r)
        blow = wall_contact(
            np.array(reduced),
            np.array(self.speed),
            self.ball.stiffness * np.exp([-step, 0.0, step]),
            np.array(self.ball.exponent),
            np.array(self.e0),
        ).time
        phase = modes.angular_frequencies[bends] * blow[:, None]
        left = np.cos(phase / 2) / (1 - (phase / np.pi) ** 2)
        soft, middle, stiff = reduced * (1 + self.e) ** 2 * np.sum((shape * left) ** 2, axis=1)
        bending = self.e0**2 * (stiff - soft) / (2 * step)
        if self.e <= self.e0:  # all of the loss is bending, so its size is known
            change = -bending * (1 - (self.e / self.e0) ** 2) / middle
        else:
            ratio = (1 - self.e**2) / (self.e**2 - self.e0**2)
            change = ratio * (1 - self.e0**2) / (ratio + 1) ** 2 - bending
        return float(change) / (2 * self.e)

    def _slopes(self, result: str) -> tuple[float, float]:
        """Return the derivatives of a result with respect to e and to the measured e0."""
        high, low = (
            (self._value(self.e + dx, self.e0, result), self._value(self.e, self.e0 + dx, result))
            for dx in (STEP, -STEP)
        )
        by_e, by_e0 = ((a - b) / (2 * STEP) for a, b in zip(high, low, strict=True))
        return by_e, by_e0

    def _value(self, e: float, e0: float, result: str) -> float:
        """Return a result, given e and the measured e0."""
        correction = self.procedure.correction
        if result == NORMALISED and correction is not None:
            if correction.method == "trampoline" and self.e > self.e0:
                lost = (1 - e**2) / (1 - e0**2)
                e = sqrt(1 - lost * (1 - correction.standard**2))
            else:
                e = correction.standard * e / e0
        e_A = (e - self.r) / (1 + self.r)
        match self.procedure.metric:
            case "restitution":
                return e
            case "bat_performance_factor":
                return e / e0
            case "besr":
                return e_A + 0.5
            case "batted_speed":
                return self.bat_speed + e_A * (_pitch(self.procedure) + self.bat_speed)


_LOT = ("ball.radius", "ball.restitution_slope")  # constants of a lot


def _pitch(rules: Procedure) -> float:
    return rules.game.pitch_speed if rules.game else rules.ball_speed


def _effects(tested: BlockTest, names: set[str]) -> dict[str, float]:
    """Return the joint effect of some constants of the budget, by name of the result."""
    results = tested.certified.results
    keys = {FOUND: "metric"}
    if tested.certified.procedure.normalized:
        keys = {FOUND: AS_FOUND, NORMALISED: "metric"}
    effects = {}
    for name, key in keys.items():
        parts = results[key].components
        chosen = [at for at, part in enumerate(parts.names) if part in names]
        effects[name] = float(np.linalg.norm(parts.effect[0, chosen]))
    return effects
