"""The modal rung: the ball against the lowest modes of the bat, stepped in time.

Modes too stiff to ring during the contact follow the force at once: together they are one
spring in series with the ball (residual flexibility; R. H. MacNeal, Comput. Struct. 1 (1971)
581). Without it twenty modes err by 3e-3 in e_A; with it by 1e-4.

No damping acts during the millisecond of contact; the bat's damping ratio belongs to the
ringing afterwards, the bearing's torques to the coasting. A dashpot at the pivot, weak or
strong, would move e_A by 1e-5 at 8 in from the tip and 8e-5 at 12 in (a test of the reference).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from virtual_lab.catalog.specs import BatBody
from virtual_lab.simulation.collision.patch import PATCH, PatchTable, patch_shapes
from virtual_lab.simulation.collision.scene import Collisions, EnergySplit, Scenes, joined
from virtual_lab.simulation.collision.stepping import FINE, CollisionBatch, FinalStates, Stepper
from virtual_lab.simulation.physics.ball import unloading_exponent
from virtual_lab.simulation.physics.beam import Support, support_words
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.units import Array

BENDING_MODES = 20
STIFF_MODES = 100


@dataclass(frozen=True, kw_only=True)
class ModalModel:
    """A bat by its lowest modes, struck over a patch."""

    modes: Modes
    stiff: Modes  # those that follow at once
    patch: float = PATCH  # full width [m]
    stepper: Stepper = FINE
    held: str = ""  # in words, for errors
    rung: str = "modal"

    @classmethod
    def of(cls, body: BatBody, support: Support, bending_modes: int = BENDING_MODES) -> Self:
        """Return the model of a bat: so many modes stepped, the next `STIFF_MODES` follow at once.

        `InputError` where the support lies off the bat or there are fewer modes than asked for.
        """
        modes = modes_of(body, support, bending_modes + STIFF_MODES)
        return cls.within(modes, bending_modes, held=support_words(support))

    @classmethod
    def within(cls, modes: Modes, bending_modes: int, **other: Any) -> Self:
        """Return the model of so many of a bat's modes, the others following at once."""
        return cls(modes=modes.first(bending_modes), stiff=modes.above(bending_modes), **other)

    @cached_property
    def table(self) -> PatchTable:
        """Splines over the place of impact: the shape of each mode, then the stiff compliance."""

        def values(z: Array) -> Array:
            shapes, stiff = patch_shapes((self.modes, self.stiff), z, self.patch)
            yielding = stiff / self.stiff.angular_frequencies
            return np.column_stack((shapes, np.sum(yielding**2, axis=1)))

        return PatchTable(values, self.modes.length, self.patch)

    def collide(self, scenes: Scenes) -> Collisions:
        """Return what the scenes come to.

        `InputError` where a place lies off the bat or one cannot be followed.
        """
        few = 16_384  # at a time: what lies between kernel and result stays small
        parts = [scenes.part(slice(i, i + few)) for i in range(0, len(scenes), few)]
        return joined([collide_bats([(self, part)])[0] for part in parts])


def collide_bats(
    batch: Sequence[tuple[ModalModel, Scenes]], tables: Sequence[Array] = ()
) -> list[Collisions]:
    """Return what scenes of several bats come to, all stepped together as the first bat's are.

    `tables` stand in the place of what the models' own splines give at the scenes' places, (n, N +
    1) each: for a few scenes splines are not worth the building. `InputError` where a place lies
    off its bat, the energy of a scene does not close, its e_A does not settle as steps are halved,
    or it does not end.
    """
    for model, scenes in batch:
        scenes.require_on(model.modes.length)
    tables = tables or [np.asarray(model.table(s.impact_position)) for model, s in batch]
    shapes = [table[:, :-1] for table in tables]
    most = max(model.modes.count - model.modes.rigid for model, _ in batch)
    struck = CollisionBatch.together(
        [
            _struck(model, scenes, table, most)
            for (model, scenes), table in zip(batch, tables, strict=True)
        ]
    )
    followed = batch[0][0].stepper.follow(struck)
    for (model, scenes), own in zip(batch, struck.by_bat(), strict=True):
        scenes.require_sound(followed.failure[own], model.held)
    return [
        _collisions(model, scenes, shape, struck.part(own), followed.part(own))
        for (model, scenes), shape, own in zip(batch, shapes, struck.by_bat(), strict=True)
    ]


def _struck(model: ModalModel, scenes: Scenes, table: Array, most: int) -> CollisionBatch:
    rigid, flexible = model.modes.rigid, model.modes.count - model.modes.rigid
    squares, shapes = np.ones((1, most)), np.zeros((len(scenes), most))
    squares[0, :flexible] = model.modes.angular_frequencies[rigid:] ** 2
    shapes[:, :flexible] = table[:, rigid:-1] ** 2
    return CollisionBatch(
        squares=squares,
        bat=np.zeros(len(scenes), dtype=np.int64),
        shapes=shapes,
        ball_mass=scenes.ball_mass,
        inverse_mass=1 / scenes.ball_mass + np.sum(table[:, :rigid] ** 2, axis=1),
        stiffness=scenes.stiffness,
        exponent=scenes.exponent,
        restitution=scenes.ball_restitution,
        unloading=unloading_exponent(scenes.exponent, scenes.ball_restitution),
        compliance=np.maximum(table[:, -1], 0.0),
        speed=scenes.relative_speed,
    )


def _collisions(
    model: ModalModel, scenes: Scenes, shape: Array, struck: CollisionBatch, followed: FinalStates
) -> Collisions:
    modes = model.modes
    rigid, flexible = modes.rigid, modes.count - modes.rigid
    states, most = followed.states, struck.shapes.shape[1]
    s, s_rate = states[:, -2], states[:, -1]
    # all rigid motion is one integral of the force
    impulse = (struck.speed - s_rate) / struck.inverse_mass
    drift = (struck.speed * followed.time - s) / struck.inverse_mass
    displacements, velocities = np.empty_like(shape), np.empty_like(shape)
    np.multiply(shape[:, :rigid], drift[:, None], out=displacements[:, :rigid])
    np.multiply(shape[:, :rigid], impulse[:, None], out=velocities[:, :rigid])
    bends = shape[:, rigid:]
    np.multiply(bends, states[:, :flexible], out=displacements[:, rigid:])
    np.multiply(bends, states[:, most : most + flexible], out=velocities[:, rigid:])
    momentum = scenes.ball_mass * struck.speed
    e_A = impulse / momentum - 1
    return Collisions(
        collision_efficiency=e_A,
        modal_displacements=displacements,
        modal_velocities=velocities,
        contact_time=followed.time,
        impulse=impulse,
        contacts=followed.contacts,
        reloads=followed.reloads,
        redone=followed.redone,
        energy=energy_split(
            modes, displacements, velocities, e_A, followed.loss, momentum * struck.speed / 2
        ),
    )


def energy_split(
    modes: Modes,
    displacements: Array,
    velocities: Array,
    e_A: Array,
    losses: Array,
    energy: Array,
) -> EnergySplit:
    """Return the shares of the ball's `energy` [J] in a modal state (n, N) after release."""
    strained = modes.angular_frequencies * displacements
    beam = modes.deflections.shape[1]

    def share(own: slice) -> Array:
        parts = (velocities[:, own], strained[:, own])
        return np.asarray(sum(np.einsum("ij,ij->i", part, part) for part in parts) / (2 * energy))

    return EnergySplit(
        ball=e_A**2,
        rigid=share(slice(modes.rigid)),
        bending=share(slice(modes.rigid, beam)),
        hoop=share(slice(beam, None)),
        hysteresis=losses / energy,
    )


def kernel_is_compiled() -> bool:
    """Whether an earlier run left the compiled kernel on disk, or numba compiles nothing."""
    from virtual_lab.simulation.collision.batch_kernel import collide_lanes
    from virtual_lab.simulation.collision.powers import COMPILES

    if not COMPILES:
        return True
    return any(Path(str(collide_lanes.stats.cache_path)).glob("batch_kernel.*collide_lanes-*.nbi"))
