"""The rigid model in closed form: e is e0 of the ball, and e_A follows from the recoil factor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from virtual_lab.catalog.specs import BatBody
from virtual_lab.simulation.collision.scene import Collisions, EnergySplit, Scenes
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Support
from virtual_lab.simulation.physics.modes import Modes, modes_of


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidModel:
    """A rigid bat."""

    modes: Modes  # rigid modes only
    name: str = "rigid"

    @classmethod
    def of(cls, body: BatBody, support: Support) -> Self:
        """Return the model of a bat. Raises `InputError` if the support lies beyond the bat."""
        stiff = replace(body, hoop=None)
        return cls(modes=modes_of(stiff, support, 0))

    def collide(self, scenes: Scenes) -> Collisions:
        """Return the collisions of the scenes, with separation speeds of e0 times the approach."""
        scenes.require_on(self.modes.length)
        shape = self.modes.shape(scenes.impact_position)
        mass, speed, e0 = scenes.ball_mass, scenes.relative_speed, scenes.ball_restitution
        r = mass * np.sum(shape**2, axis=1)
        impulse = mass * speed * (1 + e0) / (1 + r)
        e_A = impulse / (mass * speed) - 1
        bat = impulse**2 * r / (mass * speed) ** 2
        contact = wall_contact(mass / (1 + r), speed, scenes.stiffness, scenes.exponent, e0)
        nothing = np.zeros(len(scenes))
        return Collisions(
            collision_efficiency=e_A,
            modal_displacements=np.zeros_like(shape),
            modal_velocities=shape * impulse[:, None],
            contact_time=contact.time,
            impulse=impulse,
            contacts=np.ones(len(scenes), dtype=np.int64),
            reloads=np.zeros(len(scenes), dtype=np.int64),
            redone=np.zeros(len(scenes), dtype=np.int64),
            energy=EnergySplit(
                ball=e_A**2, rigid=bat, bending=nothing, hoop=nothing, hysteresis=1 - e_A**2 - bat
            ),
        )
