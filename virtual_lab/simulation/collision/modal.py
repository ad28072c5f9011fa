"""The modal model: the ball against the lowest modes of the bat, integrated in time.

Modes too stiff to vibrate during the contact deflect statically. Together they act as one spring
in series with the ball (residual flexibility; R. H. MacNeal, Comput. Struct. 1 (1971) 581). With
twenty modes the error of e_A is 3e-3 without this spring and 1e-4 with it.

There is no damping during the millisecond of contact. Afterward the damping ratio of the bat acts
on the vibration, and the torques of the bearing on the rotation. A dashpot at the pivot, weak or
strong, would change e_A by 1e-5 at 8 in from the tip and by 8e-5 at 12 in, according to a test with
the reference model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numba import config

from virtual_lab.catalog.specs import BatBody
from virtual_lab.simulation.collision.patch import PATCH, PatchTable, patch_shapes
from virtual_lab.simulation.collision.scene import Collisions, EnergySplit, Scenes, concatenate
from virtual_lab.simulation.collision.stepping import STEPPER, CollisionBatch, FinalStates, Stepper
from virtual_lab.simulation.physics.ball import unloading_exponent
from virtual_lab.simulation.physics.beam import Support, support_words
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.units import Array

BENDING_MODES = 20


@dataclass(frozen=True, kw_only=True)
class ModalModel:
    """A bat described by its lowest modes and struck over a patch."""

    modes: Modes
    stiff: Modes  # modes that deflect statically
    patch: float = PATCH  # full width of the patch [m]
    stepper: Stepper = STEPPER
    held: str = ""  # description of the support for error messages
    name: str = "modal"

    @classmethod
    def of(cls, body: BatBody, support: Support, bending_modes: int = BENDING_MODES) -> Self:
        """Return the model of a bat with `bending_modes` integrated modes.

        All other modes of the mesh deflect statically. Raises `InputError` if the support lies
        beyond the bat or the mesh has fewer modes.
        """
        return cls.within(modes_of(body, support), bending_modes, held=support_words(support))

    @classmethod
    def within(cls, modes: Modes, bending_modes: int, **other: Any) -> Self:
        """Return the model with the first `bending_modes` modes integrated, the rest static."""
        return cls(modes=modes.first(bending_modes), stiff=modes.above(bending_modes), **other)

    @cached_property
    def table(self) -> PatchTable:
        """Splines over the impact position: shape of each mode, then compliance of stiff modes."""

        def values(z: Array) -> Array:
            shapes, stiff = patch_shapes((self.modes, self.stiff), z, self.patch)
            yielding = stiff / self.stiff.angular_frequencies
            return np.column_stack((shapes, np.sum(yielding**2, axis=1)))

        return PatchTable(values, self.modes.length, self.patch)

    def collide(self, scenes: Scenes) -> Collisions:
        """Return the collisions of the scenes.

        Raises `InputError` for a position beyond the bat or a scene that gives no result.
        """
        part_size = 16_384  # scenes per part, which limits the memory of intermediate arrays
        parts = [scenes.part(slice(i, i + part_size)) for i in range(0, len(scenes), part_size)]
        return concatenate([collide_bats([(self, part)])[0] for part in parts])


def collide_bats(
    batch: Sequence[tuple[ModalModel, Scenes]], tables: Sequence[Array] = ()
) -> list[Collisions]:
    """Return the collisions of several bats, one result per pair of model and scenes in `batch`.

    All collisions are integrated together, by the stepper of the first model.

    `tables` holds the values of `ModalModel.table` at the n impact positions, one array (n, N + 1)
    per pair. The first N columns are the shapes of the N modes of the model [kg^-1/2], with the
    rigid modes first and the hoop mode last. The last column is the static compliance of all higher
    modes [m/N], which are too stiff to vibrate during the contact. Without `tables` these values
    are interpolated by splines. For a few scenes this is slower, because the splines must be built
    first.

    Raises `InputError` for a position beyond the bat. It is also raised for a scene that does not
    end, that violates the energy balance, or for which the collision efficiency does not converge
    as the steps are halved.
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
    final = batch[0][0].stepper.follow(struck)
    for (model, scenes), rows in zip(batch, struck.by_bat(), strict=True):
        scenes.require_sound(final.failure[rows], model.held)
    return [
        _collisions(model, scenes, shape, struck.part(rows), final.part(rows))
        for (model, scenes), shape, rows in zip(batch, shapes, struck.by_bat(), strict=True)
    ]


def _struck(model: ModalModel, scenes: Scenes, table: Array, most: int) -> CollisionBatch:
    rigid, flexible = model.modes.rigid, model.modes.count - model.modes.rigid
    squares, shapes = np.zeros((1, most)), np.zeros((len(scenes), most))
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
    model: ModalModel, scenes: Scenes, shape: Array, struck: CollisionBatch, final: FinalStates
) -> Collisions:
    modes = model.modes
    rigid, flexible = modes.rigid, modes.count - modes.rigid
    states, most = final.states, struck.shapes.shape[1]
    s, s_rate = states[:, -2], states[:, -1]
    # The impulse determines all rigid motion.
    impulse = (struck.speed - s_rate) / struck.inverse_mass
    drift = (struck.speed * final.time - s) / struck.inverse_mass
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
        contact_time=final.time,
        impulse=impulse,
        contacts=final.contacts,
        reloads=final.reloads,
        redone=final.redone,
        energy=energy_split(
            modes, displacements, velocities, e_A, final.loss, momentum * struck.speed / 2
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
    """Return the energy of ball and bat at separation, in shares of the ball's initial energy.

    The fields of the result have the shape (n,), one value per collision, and are dimensionless.

    Parameters
    ----------
    modes
        Modes of the bat.
    displacements, velocities
        Modal displacements [kg^1/2 m] and velocities [kg^1/2 m/s] at separation, (n, N), in the
        order of `modes`.
    e_A
        Collision efficiency, (n,).
    losses, energy
        Energy lost in the ball, and initial energy of the ball, (n,) [J].
    """
    strained = modes.angular_frequencies * displacements
    beam = modes.deflections.shape[1]

    def share(modes: slice) -> Array:
        parts = (velocities[:, modes], strained[:, modes])
        return np.asarray(sum(np.einsum("ij,ij->i", part, part) for part in parts) / (2 * energy))

    return EnergySplit(
        ball=e_A**2,
        rigid=share(slice(modes.rigid)),
        bending=share(slice(modes.rigid, beam)),
        hoop=share(slice(beam, None)),
        hysteresis=losses / energy,
    )


def kernel_is_compiled() -> bool:
    """Return True if the kernel of the modal models is compiled, in this process or on disk.

    The result is also True if numba's compiler is disabled.
    """
    from virtual_lab.simulation.collision.modal_kernel import collide

    if config.DISABLE_JIT or collide.overloads:  # type: ignore[attr-defined]
        return True
    return any(Path(str(collide.stats.cache_path)).glob("modal_kernel.collide-*.nbi"))
