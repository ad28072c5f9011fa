"""Collisions at rigs that fire at bats: scenes, off-axis hits, and the true result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from types import EllipsisType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BatBody
from virtual_lab.simulation.collision.ladder import StruckBat
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.physics.ball import Event, PowerLaw
from virtual_lab.simulation.physics.beam import Free, Pinned, Support, outer_diameter
from virtual_lab.simulation.physics.mesh import gauss_points
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.simulation.physics.truth import TrueOutcome, TrueRecoil
from virtual_lab.simulation.stations.rig import ShotPlan, Specimen
from virtual_lab.units import Array

CONTACT_TIME = 0.7e-3  # typical duration of a contact, used for records of summary values [s]


class Impacts(NamedTuple):
    """Collisions of balls and bat, arrays (shot,); the bat's vibration only with full detail."""

    scenes: Scenes
    efficiency: Array  # e_A
    contact_time: Array  # [s]
    modes: Modes | None = None
    collisions: Collisions | None = None


def scenes_of(
    specimen: Specimen,
    ball: NDArray[np.int_] | EllipsisType,
    place: Array,
    speed: Array,
    e0: Array,
) -> Scenes:
    """Return the scenes of collisions, one per shot.

    `ball` is the index of the ball of each shot, (shot,). If it is the `Ellipsis` object, all balls
    of the lot are used in order, one per shot. `place` is the impact position from the barrel tip
    [m], `speed` the relative speed [m/s], and `e0` the restitution of the ball, all (shot,). Raises
    `InputError` for numbers outside the ranges of `Scenes`.
    """
    balls = specimen.balls
    return Scenes.of(
        impact_position=place,
        relative_speed=speed,
        ball_mass=balls.mass[ball],
        ball_restitution=e0,
        stiffness=balls.spec.stiffness,
        exponent=balls.spec.exponent,
    )


def contact_angle(specimen: Specimen, place: Array, across: Array) -> Array:
    """Return the angle between the line of fire and the line through ball and bat [rad], (shot,).

    The line through ball and bat connects the center of the ball with the axis of the bat at
    contact. `place` is the impact position from the barrel tip, and `across` the height of the
    ball's center above the bat's axis, both (shot,) [m]. The angle has the sign of `across`. It is
    NaN if the ball misses the bat.
    """
    barrel = outer_diameter(specimen.bat.body.profile, place) / 2
    return np.arcsin(across / (specimen.balls.spec.radius + barrel))


def compute_impacts(
    specimen: Specimen, detail: RecordDetail, scenes: Scenes, axis: TrueConstant, nominal: float
) -> Impacts:
    """Return the collisions of the balls with a bat on a pivot, one per scene, (shot,).

    There are two cases:

    * `detail` requests only summary values (not every gate edge). Only the collision efficiency e_A
      is computed. The contact time is a typical value, and there is no vibration. The pivot is at
      its nominal position. A shift of the pivot by a fraction of a millimeter hardly changes e_A.
    * Otherwise, the contact time and the vibration are computed too. The pivot is at its true
      position.

    Parameters
    ----------
    axis
        True distance of the pivot from the knob [m].
    nominal
        Nominal distance of the pivot from the knob [m].

    Raises
    ------
    InputError
        A position is beyond the bat, or a scene gives no result.
    """
    body = specimen.bat.body
    if detail is RecordDetail.SUMMED:
        support = Pinned(body.length - nominal)
        efficiency = specimen.collision.efficiencies(
            specimen.bat.groups(len(scenes)), support, scenes
        )
        return Impacts(scenes, efficiency, np.full(efficiency.shape, CONTACT_TIME))
    model = specimen.collision(body, Pinned(body.length - axis))
    collisions = model.collide(scenes)
    e_A, contact_time = collisions.collision_efficiency, collisions.contact_time
    return Impacts(scenes, e_A, contact_time, model.modes, collisions)


def rebound_velocity(
    efficiency: Array, tilt: Array, relative_speed: Array, bat_speed: Array | float
) -> tuple[Array, Array]:
    """Return the rebound speed of the ball [m/s] and the slope of its rebound [m/m], both (shot,).

    The rebound speed is the component along the line of fire. The slope is the component across the
    line of fire divided by the rebound speed. It is NaN if the rebound speed is 0.

    There is no friction. The speed along the surface of the barrel does not change. The normal
    speed relative to the bat is reversed and multiplied by the collision efficiency e_A.

    Parameters
    ----------
    efficiency
        e_A of each contact.
    tilt
        Contact angle [rad]. The slope has the sign of this angle if the ball rebounds.
    relative_speed
        Speed of the ball relative to the bat, along the line of fire [m/s].
    bat_speed
        Speed of the bat, which is added to the rebound speed [m/s].
    """
    cosine, sine = np.cos(tilt), np.sin(tilt)
    across, along = relative_speed * cosine, relative_speed * sine
    rebound_speed = efficiency * across * cosine - along * sine + bat_speed
    up = efficiency * across * sine + along * cosine
    return rebound_speed, np.asarray(up / np.where(rebound_speed == 0, np.nan, rebound_speed))


def true_outcome(
    plan: ShotPlan, specimen: Specimen, support: Support, pivot_from_knob: float
) -> TrueOutcome:
    """Return the true results at the positions of the plan, for the mean ball of the lot, (shot,).

    The results are the relative speed, the collision efficiency e_A, the ball-wall restitution e0,
    the bat-ball restitution e and the recoil factor r. The relative speed is the nominal ball speed
    of the plan plus the speed of a swinging bat. In the collision that gives e_A, the bat is held
    by `support`.

    e and r are computed from the impulse of this collision as if the bat were rigid. They are
    computed twice, for any `support`:

    * The field `free` is for a rigid bat without a support.
    * The field `pivoted` is for a rigid bat on a pivot. The distance of the pivot from the knob is
      `pivot_from_knob` [m].

    No equation of the reduction is used.
    """
    mean, bat = specimen.balls.mean_ball(), specimen.bat.of_shots(plan.owner)
    axis = bat.body.length - pivot_from_knob
    speed = plan.speed + plan.turn_rate * (axis - plan.place)
    ball = mean.of_shots(plan.owner, np.zeros(plan.place.shape, dtype=int))
    e0 = ball.restitution_at(..., speed)
    scenes = scenes_of(replace(specimen, balls=ball), ..., plan.place, speed, e0)
    struck = list(bat.groups(len(scenes)))
    efficiency = specimen.collision.true_efficiencies(struck, support, scenes)
    impulse = scenes.ball_mass * speed * (1 + efficiency)
    return TrueOutcome(
        relative_speed=speed,
        collision_efficiency=efficiency,
        ball_restitution=wall_restitution(scenes),
        free=_recoil(struck, Free(), scenes, impulse),
        pivoted=_recoil(struck, Pinned(axis), scenes, impulse),
    )


@lru_cache(maxsize=64)
def _rigid_modes(body: BatBody, support: Support) -> Modes:
    return modes_of(replace(body, hoop=None), support, 0)


def _recoil(
    struck: Sequence[StruckBat], support: Support, scenes: Scenes, impulse: Array
) -> TrueRecoil:
    """Return e and r of rigid bats, from their rigid modes of unit mass."""
    speed, yielding = scenes.relative_speed, np.empty(len(scenes))  # 1 / effective mass
    for body, shots in struck:
        modes = _rigid_modes(body, support)
        # A rigid mode is a straight line: its mean over a patch is its value at the center.
        tip, knob = modes.deflections[[0, -1]]
        along = scenes.impact_position[shots, None] / modes.length
        yielding[shots] = np.sum((tip + along * (knob - tip)) ** 2, axis=1)
    bat_speed = impulse * yielding
    ball_speed = impulse / scenes.ball_mass - speed
    return TrueRecoil(
        restitution=(ball_speed + bat_speed) / speed,
        recoil_factor=scenes.ball_mass * bat_speed / impulse,
    )


def wall_restitution(scenes: Scenes) -> Array:
    """Return the ball-wall restitution e0 of the balls, computed from the force law, (n,).

    The square of e0 is the work of the force during unloading, divided by the work of the force
    during loading. e0 does not depend on the stiffness of the ball. The wall is rigid.
    """
    x, weights = gauss_points(64)  # exact to rounding for any ball
    share, width = ((1 + x) / 2) ** 4, ((1 + x) / 2) ** 3 * weights  # dense near zero compression
    # Balls that hit a bat at rest have the same e0 at all positions.
    balls, inverse = np.unique(scenes.exponent + 1j * scenes.ball_restitution, return_inverse=True)
    e0 = np.empty(balls.size)
    part_size = 256  # balls per part, so that their forces fit in the cache
    for first in range(0, balls.size, part_size):
        part = slice(first, first + part_size)
        exponent: Any = balls.real[part, None]
        restitution: Any = balls.imag[part, None]
        law = PowerLaw.of(stiffness=1.0, exponent=exponent, restitution=restitution, speed=1.0)
        loading = law.branch(Event.TOUCH, 0.0, None)
        unloading = law.branch(Event.TURN, 1.0, loading)
        nodes: Any = share
        work = [(width * branch.force(nodes, 0.0)).sum(axis=1) for branch in (loading, unloading)]
        e0[part] = np.sqrt(work[1] / work[0])
    return e0[inverse]
