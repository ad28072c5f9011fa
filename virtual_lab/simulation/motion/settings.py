"""How pymunk is set for a scene, and which settings are refused."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Self

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.simulation.motion.scene import Scene

__all__ = ["Settings"]

FEWEST_ITERATIONS, MOST_ITERATIONS = 10, 1000
SMALLEST_STEP = 1e-7  # s: a record of a tenth of a second in a million steps
LARGEST_SLOP = 1e-4  # m


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Of the pymunk space, SI: its own defaults are for pixels."""

    step: float = 1e-3  # [s]; a shorter one is dearer and no better
    iterations: int = 10
    slop: float = 1e-6  # overlap that is left alone [m]
    bias: float = 0.0018  # share of an overlap left after a second; pymunk's default

    @classmethod
    def safe(cls, scene: Scene) -> Self:
        """Return the usual settings, their step at most half of what a scene allows."""
        speed = cls.fastest(scene)
        most = cls.reach(scene) / speed / 2 if speed > 0 else np.inf
        return cls(step=min(cls().step, most))

    def check(self, scene: Scene) -> None:
        """Raise `InputError` where a setting is unsafe for a scene."""
        _require("step", self.step, self.step >= SMALLEST_STEP, f"{SMALLEST_STEP:g} s and up")
        wide, speed = self.reach(scene), self.fastest(scene)
        most = wide / speed if speed > 0 else np.inf
        why = f"below {most:.3g} s, in which ball and bat close by less than {wide:.3g} m"
        _require("step", self.step, self.step < most, why)
        few, many = FEWEST_ITERATIONS, MOST_ITERATIONS
        _require("iterations", self.iterations, few <= self.iterations <= many, f"{few} to {many}")
        slop = 0 <= self.slop <= LARGEST_SLOP
        _require("slop", self.slop, slop, f"0 to {LARGEST_SLOP:g} m")
        _require("bias", self.bias, 0 <= self.bias < 1, "0 and up, below 1")

    @staticmethod
    def reach(scene: Scene) -> float:
        """Return the least way [m] that lets a ball jump what it should strike."""
        barrel = scene.bat.barrel
        tip = float(np.min(barrel.radius(np.linspace(0.0, barrel.length / 3, 50))))
        return scene.balls.radius + min([tip, *(o.radius for o in scene.obstacles)])

    @staticmethod
    def fastest(scene: Scene) -> float:
        """Return the greatest speed [m/s] at which ball and tip may close at the start."""
        start = scene.start
        ball = np.hypot(start.vx, start.vz)
        return float(np.max(ball + np.abs(start.rate) * scene.bat.axis))


def _require(key: str, value: float, good: bool, allowed: str) -> None:
    if not (good and isfinite(value)):
        raise InputError("motion settings", key, value, f"allowed: {allowed}")
