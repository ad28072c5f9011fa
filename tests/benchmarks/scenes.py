"""Random scenes and models for the benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.simulation.collision.modal import ModalModel, _struck
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.stepping import CollisionBatch
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.units import INCH, MPH, OUNCE

__all__ = ["BATS", "NARROW", "WIDE", "Ranges", "default_model", "eight_modes", "struck"]


BATS = ("r161", "ea70", "barrel-loaded", "knob-loaded")
BALL = 5.125 * OUNCE
WALL_TIME = (0.6e-3, 1.0e-3)  # time of a wall contact at the speed of the scene [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranges:
    """Ranges of uniformly drawn scenes. The exponent is 1 to 2, the wall contact time WALL_TIME."""

    z: tuple[float, float]  # in
    speed: tuple[float, float]  # mph
    restitution: tuple[float, float]

    def draw(self, count: int, seed: int) -> Scenes:
        """Return random scenes."""
        rng = np.random.default_rng(seed)
        speed = rng.uniform(*self.speed, count) * MPH
        e0, exponent = rng.uniform(*self.restitution, count), rng.uniform(1, 2, count)
        # scaling: the time of a wall contact goes as k^(-1/(a + 1))
        soft = wall_contact(np.array(BALL), speed, np.ones(count), exponent, e0).time
        stiffness = (soft / rng.uniform(*WALL_TIME, count)) ** (exponent + 1)
        return Scenes.of(
            impact_position=rng.uniform(*self.z, count) * INCH,
            relative_speed=speed,
            ball_mass=BALL,
            ball_restitution=e0,
            stiffness=stiffness,
            exponent=exponent,
        )


NARROW = Ranges(z=(1, 12), speed=(40, 180), restitution=(0.4, 0.6))
WIDE = Ranges(z=(0.5, 30), speed=(20, 180), restitution=(0.3, 0.8))


def default_model(bat: str) -> ModalModel:
    """Return the default model of a bat: 20 modes and residual flexibility."""
    return ModalModel.of(catalog.load_bat(bat).spec.body, Free())


def eight_modes(bat: str) -> ModalModel:
    """Return the model that is used with all peers: 8 modes without residual flexibility."""
    model = ModalModel.of(catalog.load_bat(bat).spec.body, Free(), 8)
    return replace(model, stiff=model.stiff.above(model.stiff.count))


def struck(model: ModalModel, scenes: Scenes) -> CollisionBatch:
    """Return the batch that the model passes to its stepper."""
    table = np.asarray(model.table(scenes.impact_position))
    return _struck(model, scenes, table, model.modes.count - model.modes.rigid)
