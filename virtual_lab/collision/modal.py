"""The modal rung: the ball against the lowest modes of the bat, stepped in time.

Modes too stiff to ring during the contact follow the force at once: together they are one
spring in series with the ball (residual flexibility). Without it twenty modes err by 3e-3 in
e_A; with it by 1e-4.

No damping acts during the millisecond of contact; the bat's damping ratio belongs to the
ringing afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.collision.modal_kernel import collide
from virtual_lab.collision.patch import PATCH, patch_shape
from virtual_lab.collision.scene import Collisions, EnergySplit, Scenes
from virtual_lab.physics.ball import unloading_exponent, wall_contact
from virtual_lab.physics.modes import Modes, modes_of
from virtual_lab.physics.supports import Support
from virtual_lab.specs import BatBody

__all__ = ["BENDING_MODES", "ModalModel", "kernel_is_compiled"]

Floats = NDArray[np.float64]
BENDING_MODES = 20
STIFF_MODES = 100
MODE_STEP = 1.35  # step times the highest angular frequency
BALL_STEP = 0.27  # step times the angular frequency of the ball at its steepest
WINDOW = 0.02  # s: how long ball and bat are followed


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalModel:
    """A bat by its lowest modes, struck over a patch."""

    modes: Modes
    stiff: Modes  # those that follow at once
    patch: float = PATCH  # full width [m]
    refinement: float = 1.0  # divides the time step
    rung: str = "modal"

    @classmethod
    def of(
        cls,
        body: BatBody,
        support: Support,
        bending_modes: int = BENDING_MODES,
    ) -> Self:
        """Return the model of a bat.

        Parameters
        ----------
        body, support
            The bat and how it is held.
        bending_modes : int
            How many are stepped in time; the next `STIFF_MODES` follow at once.

        Raises
        ------
        InputError
            The support lies off the bat, or there are fewer modes than asked for.
        """
        modes = modes_of(body, support, bending_modes + STIFF_MODES)
        return cls(modes=modes.first(bending_modes), stiff=modes.above(bending_modes))

    def collide(self, scenes: Scenes) -> Collisions:
        """Return what the scenes come to. `InputError` where a place lies off the bat."""
        scenes.require_on(self.modes.length)
        shape = patch_shape(self.modes, scenes.impact_position, self.patch)
        rigid = self.modes.rigid
        inverse_mass = 1 / scenes.ball_mass + np.sum(shape[:, :rigid] ** 2, axis=1)
        b = unloading_exponent(scenes.exponent, scenes.ball_restitution)
        compliance = self._compliance(scenes.impact_position)
        ball = (scenes.stiffness, scenes.exponent, b, compliance, scenes.relative_speed)
        states, sums, counts = collide(
            self.modes.angular_frequencies[rigid:] ** 2,
            np.ascontiguousarray(shape[:, rigid:] ** 2),
            inverse_mass,
            np.stack(ball, axis=1),
            self._steps(scenes, inverse_mass, b),
            WINDOW,
        )
        return self._collisions(scenes, shape, inverse_mass, states, sums, counts)

    def _compliance(self, z: Floats) -> Floats:
        """Return the compliance (n,) of the stiff modes at places `z` (n,) [m/N]."""
        shape = patch_shape(self.stiff, z, self.patch)
        return np.asarray(np.sum((shape / self.stiff.angular_frequencies) ** 2, axis=1))

    def _steps(self, scenes: Scenes, inverse_mass: Floats, b: Floats) -> Floats:
        """Return the time steps (n,): the fastest mode and the steepest ball both resolved."""
        contact = wall_contact(
            1 / inverse_mass,
            scenes.relative_speed,
            scenes.stiffness,
            scenes.exponent,
            scenes.ball_restitution,
        )
        steepest = np.sqrt(b * contact.force / contact.compression * inverse_mass)
        fastest = self.modes.angular_frequencies.max(initial=0.0)
        rate = np.maximum(steepest / BALL_STEP, fastest / MODE_STEP)
        return np.asarray(1 / (rate * self.refinement))

    def _collisions(
        self,
        scenes: Scenes,
        shape: Floats,
        inverse_mass: Floats,
        states: Floats,
        sums: Floats,
        counts: NDArray[np.int64],
    ) -> Collisions:
        rigid, n_flexible = self.modes.rigid, self.modes.count - self.modes.rigid
        mass, speed = scenes.ball_mass, scenes.relative_speed
        times, losses = sums.T
        s, s_rate = states[:, -2], states[:, -1]
        # all rigid motion is one integral of the force
        impulse = (speed - s_rate) / inverse_mass
        drift = (speed * times - s) / inverse_mass
        displacements, velocities = shape * drift[:, None], shape * impulse[:, None]
        displacements[:, rigid:] = shape[:, rigid:] * states[:, :n_flexible]
        velocities[:, rigid:] = shape[:, rigid:] * states[:, n_flexible : 2 * n_flexible]
        e_A = impulse / (mass * speed) - 1
        return Collisions(
            rung=self.rung,
            collision_efficiency=e_A,
            modal_displacements=displacements,
            modal_velocities=velocities,
            contact_time=times,
            impulse=impulse,
            contacts=counts[:, 0],
            reloads=counts[:, 1],
            energy=energy_split(
                self.modes, displacements, velocities, e_A, losses, mass * speed**2 / 2
            ),
        )


def energy_split(
    modes: Modes,
    displacements: Floats,
    velocities: Floats,
    e_A: Floats,
    losses: Floats,
    energy: Floats,
) -> EnergySplit:
    """Return the shares of the ball's `energy` [J] in a modal state (n, N) after release."""
    parts = (velocities**2 + (modes.angular_frequencies * displacements) ** 2) / 2
    beam = modes.deflections.shape[1]
    return EnergySplit(
        ball=e_A**2,
        rigid=parts[:, : modes.rigid].sum(axis=1) / energy,
        bending=parts[:, modes.rigid : beam].sum(axis=1) / energy,
        hoop=parts[:, beam:].sum(axis=1) / energy,
        hysteresis=losses / energy,
    )


def kernel_is_compiled() -> bool:
    """Whether an earlier run left the compiled kernel on disk, so that loading it is quick."""
    from virtual_lab.collision.modal_kernel import collide

    return any(Path(str(collide.stats.cache_path)).glob("modal_kernel.collide-*.nbi"))
