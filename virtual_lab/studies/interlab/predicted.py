"""Scatter of results that each factor alone should cause, to first order, without a simulation.

All effects are computed for one nominal test. The effect of calibration errors is taken from its
uncertainty budget. The derivatives of e with respect to the properties of the ball are computed by
the reference model of the collision, which shares no solver with the simulated tests. All other
effects are closed forms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from typing import Any, Self

import numpy as np

from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab import BlockTest
from virtual_lab.lab.certify import certify_block
from virtual_lab.lab.true_metric import TrueCurve
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Pinned, rigid_bat
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.studies.interlab.playing import FOUND, NORMALISED, Play
from virtual_lab.studies.interlab.study import OF_LOTS

STEP = 1e-5  # step of the derivatives with respect to e and e0


@dataclass(frozen=True, kw_only=True)
class NominalTest:
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
    calibrations: Mapping[str, float]  # effect of all calibration errors, by result
    radii: Mapping[str, float]  # effect of the radius of the lot

    @classmethod
    def of(cls, play: Play) -> Self:
        """Return the nominal test of a study's bat and procedure."""
        study = play.study.spec
        nominal = [name for name in study.named if name not in ("wall", "clamp")]
        with play.round_robin(nominal, ()) as shared:
            setup = replace(shared.setup, seed=study.seed, number=np.zeros(1, int))
            tested = certify_block(setup)
        certified, rules, ball = tested.certified, setup.rules.spec, setup.ball.spec
        value = {name: float(each.value[0]) for name, each in certified.results.items()}
        bat, place = certified.reduced.preparation.bat, float(certified.hit_weights.position[0])
        length, mass = float(np.ravel(bat.length)[0]), float(np.ravel(bat.mass)[0])
        axis = length - rules.pivot_from_knob
        lever = axis - float(np.ravel(bat.z_cm)[0])
        factors = study.factors
        bench: Any = tested.laboratory.stations[Stage.BENCH]
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
            calibrations=_effects(tested, set(tested.laboratory.calibration) - {*_LOT}),
            radii=_effects(tested, {_LOT[0]}),
        )

    def scatter(self, factor: str, result: str) -> float:
        """Return the standard deviation of a result that a factor alone causes [SI].

        Raises `KeyError` for an unknown factor or result.
        """
        rules, line, law = self.procedure, self.ball.restitution, self.ball.humidity
        by_e, by_e0 = self._slopes(result)
        follows, stiffer = self._derivatives if factor in OF_LOTS else (0.0, 0.0)
        of_ball = by_e * follows  # effect of the true e0
        measured = self.speed if len(rules.wall_speeds) > 1 else rules.wall_speeds[0]
        slope = of_ball * (self.speed - line.speed) + by_e0 * (measured - line.speed)
        level = of_ball + by_e0
        stored = 0.0 if law is None else abs(law.slope) * line.value * self.humidity_spread
        # The clamp has a share of the angular momentum, which the recoil of the bat then lacks.
        clamp = by_e * (1 + self.e) / self.inertia if rules.reads == "recoil" else 0.0
        effects = {
            "lot": hypot(
                level * self._admitted(line.value_u), slope * line.slope_u, self.radii[result]
            ),
            "stiffness": by_e * stiffer * self.ball.stiffness_spread,
            "store": level * self.e0 / line.value * self._admitted(stored),
            "calibration": self.calibrations[result],
            "wall": by_e0 * self.e0 * self.wall_spread,
            "clamp": clamp * self.clamp_spread,
        }
        return abs(effects[factor])

    def _admitted(self, spread: float) -> float:
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
    def _derivatives(self) -> tuple[float, float]:
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
        curve = TrueCurve(
            procedure=self.procedure if result == NORMALISED else self.procedure.as_found,
            bat=rigid_bat(self.bat.body),
            position=np.array([self.place]),
            collision_efficiency=np.array([(e - self.r) / (1 + self.r)]),
            restitution=np.array([e]),
            recoil_factor=np.array([self.r]),
            ball_restitution=np.array([e0]),
        )
        return float(curve.metric()[0])


_LOT = ("ball.radius", "ball.restitution_slope")  # constants of a lot


def _effects(tested: BlockTest, names: set[str]) -> dict[str, float]:
    """Return the joint effect of the given constants of the budget, keyed by result name."""
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
