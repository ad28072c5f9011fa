"""What machines that fire at bats share: scenes, tilted hits, the error-free answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.kinematics import (
    efficiency_off_axis,
    offset_angle,
    recoil_factor_free,
    recoil_factor_pivoted,
)
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.instruments import Rung
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.physics.section import outer_diameter
from virtual_lab.simulation.physics.supports import Pinned, Support
from virtual_lab.simulation.rig import Order, Specimen
from virtual_lab.simulation.truth import TrueOutcome

__all__ = ["CONTACT_TIME", "contact_angle", "error_free", "scenes_of", "struck", "thrown_back"]

Array = NDArray[np.float64]
CONTACT_TIME = 0.7e-3  # s, where no record is fine enough to tell


def scenes_of(
    specimen: Specimen, ball: NDArray[np.int_], place: Array, speed: Array, e0: Array
) -> Scenes:
    """Return collisions of the balls indexed by `ball`, shape (shot,)."""
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
    """Return the angle between the line of fire and the line of centres [rad], (shot,)."""
    barrel = outer_diameter(specimen.bat.body.profile, place) / 2
    return np.asarray(offset_angle(across, specimen.balls.spec.radius, barrel))


def struck(
    specimen: Specimen, rung: Rung, scenes: Scenes, at: float, surveyed: float
) -> tuple[Array, Array]:
    """Return e_A and the contact times [s] of a bat whose axis is `at` [m] from its knob.

    Instruments that write sums need e_A alone, and e_A knows nothing of where exactly the axis
    is: all laboratories then share the support where the axis was `surveyed`.
    """
    body = specimen.bat.body
    if rung is Rung.SUMMED:
        support = Pinned(body.length - surveyed)
        efficiency = specimen.collision.efficiency(body, support, scenes)
        return efficiency, np.full(efficiency.shape, CONTACT_TIME)
    collisions = specimen.collision(body, Pinned(body.length - at)).collide(scenes)
    return collisions.collision_efficiency, collisions.contact_time


def thrown_back(
    efficiency: Array, tilt: Array, relative_speed: Array, bat_speed: Array | float
) -> tuple[Array, Array]:
    """Return the ball's speed back along the line of fire [m/s] and the height it gains a metre.

    A smooth ball keeps its speed along the barrel's surface; in the bat's frame it comes back
    with e_A of the speed across it.
    """
    back = relative_speed * np.asarray(efficiency_off_axis(efficiency, tilt)) + bat_speed
    up = relative_speed * (1 + efficiency) * np.sin(2 * tilt) / 2
    return back, np.asarray(up / np.where(back == 0, np.nan, back))


def error_free(
    order: Order, specimen: Specimen, support: Support, pivot_from_knob: float
) -> TrueOutcome:
    """Return what an error-free test would find at the order's places and nominal speeds.

    The lot's mean ball meets the bat on an axis exactly `pivot_from_knob` [m] from its knob.
    """
    ball, body = specimen.balls.mean_ball(), specimen.bat.body
    beam = beam_of(body)
    axis = beam.length - pivot_from_knob
    speed = order.speed + order.turn_rate * (axis - order.place)
    first = np.zeros(order.place.shape, dtype=int)
    e0 = ball.restitution_at(first, speed)
    scenes = scenes_of(replace(specimen, balls=ball), first, order.place, speed, e0)
    model = specimen.collision(body, support)
    return TrueOutcome(
        collision_efficiency=model.collide(scenes).collision_efficiency,
        recoil_pivoted=np.asarray(
            recoil_factor_pivoted(ball.mass, beam.inertia(axis), axis - order.place)
        ),
        recoil_free=np.asarray(
            recoil_factor_free(ball.mass, beam.mass, beam.inertia_cm, order.place - beam.z_cm)
        ),
        ball_restitution=e0,
        relative_speed=speed,
    )
