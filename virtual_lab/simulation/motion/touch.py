"""Free motion of ball and bat, the gap between them, and the time of their first touch."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after, speed_after
from virtual_lab.simulation.motion.scene import ShotScene, ShotState
from virtual_lab.units import Array

Shots = NDArray[np.int_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Touching:
    """Settings of the search for the first touch."""

    near: float = 1e-7  # largest gap of a touch, smaller than the deviations of a barrel [m]
    # shortest time for which an opening gap stays open [opening rate times radii / squared speeds].
    # To close earlier, the gap would need a curvature above 8 squared speeds per radius.
    parting: float = 0.25
    polishing: int = 4  # number of Newton steps within `near`, with a slope that omits the taper
    sharp: float = 1e-2  # smallest closing speed for Newton steps [share of the ball's speed]


TOUCHING = Touching()


class Obstacle(StrEnum):
    """Reason why a contact cannot be computed, in the order of precedence."""

    EDGE = "the ball strikes the edge of the bat's end, where no collision model holds"
    GRAZED = "the ball only grazes the bat: it does not approach the surface"
    FOLLOWED = "the bat would pass through the ball: no contact has such an e_A"
    MANY = "more than 100 contacts in one record"


class Nearness(NamedTuple):
    """Gap and relative motion of ball and bat, each (n,)."""

    gap: Array  # distance of the surfaces [m]
    place: Array  # position of the ball's center along the bat, from the tip [m]
    lever: Array  # distance of that position from the pivot [m]
    approach: Array  # normal speed of approach, without the taper [m/s]
    sliding: Array  # rate of change of `place` [m/s]
    normal: Array  # (3, n), unit vector from the bat to the ball
    turning: Array  # component of the normal that rotates the bat, positive in recoil


def move(scene: ShotScene, state: ShotState, time: Array, shots: Shots) -> ShotState:
    """Return the states of selected shots after a time of free motion, (n,) [SI].

    Drag slows the ball in the horizontal plane, and gravity changes its height. The bat keeps its
    angular rate. Contacts are ignored.

    Parameters
    ----------
    scene
        All shots.
    state
        States of the selected shots before the motion, (n,).
    time
        Duration of the motion, (n,) [s].
    shots
        Indices of the selected shots in the scene, (n,).
    """
    speed = np.hypot(state.vx, state.vz)
    drag = scene.ball_drag[shots]
    gravity = np.broadcast_to(scene.gravity, (scene.shots,))[shots]
    # This avoids 0 / 0 for a ball at rest.
    share = 1 / np.where(speed > 0, speed, 1.0)
    path = distance_after(time, speed, drag) * share
    share_of_speed = np.where(speed > 0, speed_after(time, speed, drag) * share, 1.0)
    return ShotState(
        x=state.x + state.vx * path,
        y=state.y + (state.vy - gravity / 2 * time) * time,
        z=state.z + state.vz * path,
        vx=state.vx * share_of_speed,
        vy=state.vy - gravity * time,
        vz=state.vz * share_of_speed,
        angle=state.angle + state.rate * time,
        rate=state.rate + 0 * time,
    )


def nearness(scene: ShotScene, state: ShotState) -> Nearness:
    """Return gap [m] and relative motion of ball and bat for each state.

    The arrays of the result have one element per state. The gap is negative if ball and bat
    overlap. The ends of the bat are flat.
    """
    bat = scene.bat
    cos, sin = np.cos(state.angle), np.sin(state.angle)
    z = state.z - bat.axis
    beside = state.x * cos + z * sin
    lever = state.x * sin - z * cos
    place = bat.axis - lever
    outline = bat.radius(place)
    across = np.hypot(beside, state.y)
    beyond = np.maximum(np.maximum(-place, place - bat.length), 0.0)
    inside = np.hypot(np.maximum(across - outline, 0.0), beyond)
    away = 1 / np.where(across > 0, across, np.inf)
    in_plane, up = beside * away, state.y * away
    outward = state.vx * cos + state.vz * sin - state.rate * lever
    return Nearness(
        gap=np.where(beyond > 0, inside, across - outline) - scene.ball_radius,
        place=place,
        lever=lever,
        approach=-(outward * in_plane + state.vy * up),
        sliding=-(state.vx * sin - state.vz * cos + state.rate * beside),
        normal=np.stack([in_plane * cos, up, in_plane * sin]),
        turning=-in_plane,
    )


def rebound(
    scene: ShotScene, state: ShotState, near: Nearness, efficiency: Array, shots: Shots
) -> ShotState:
    """Return the states of n shots after frictionless contacts with the bat, (n,).

    `shots` are the indices of these shots in `scene`. `state`, (n,), holds their states at the
    contact, and `near` holds the gap and the relative motion of ball and bat. `efficiency` is the
    collision efficiency e_A of each contact, (n,). The normal speed of the ball relative to the bat
    is reversed and multiplied by e_A. The speed of the ball along the surface does not change. The
    bat receives the angular momentum about its pivot that the ball loses.
    """
    gain = (1 + efficiency) * near.approach
    kick = near.normal * gain
    momentum = scene.ball_mass[shots] * gain * near.lever * near.turning
    return state._replace(
        vx=state.vx + kick[0],
        vy=state.vy + kick[1],
        vz=state.vz + kick[2],
        rate=state.rate + momentum / scene.bat.inertia,
    )


def obstacles(scene: ShotScene, near: Nearness, after: ShotState) -> NDArray[np.str_]:
    """Return why each contact cannot be computed, (n,), or an empty string if it can be computed.

    The reasons are the values of `Obstacle`. `near` holds gap and relative motion before the
    contact, and `after` is the state after it.
    """
    edge = (near.place < 0) | (near.place > scene.bat.length)
    follows = nearness(scene, after).approach >= 0
    why = [Obstacle.EDGE, Obstacle.GRAZED, Obstacle.FOLLOWED]
    return np.select([edge, near.approach <= 0, follows], why, "")


def time_to_stop(scene: ShotScene, state: ShotState) -> Array:
    """Return the time from `state` until the bat reaches its stop [s], (n,).

    The time is 0 if the bat has already reached the stop and still rotates in the same direction.
    The time is inf in three cases:

    * the bat is at rest;
    * the bat rotates away from the stop;
    * the scene has no stop.
    """
    if scene.stop is None:
        return np.full(state.rate.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.maximum(scene.stop.angle - state.angle, 0.0) / state.rate
    return np.where(state.rate > 0, time, np.inf)


def first_touch(
    scene: ShotScene, state: ShotState, until: Array, shots: Shots, *, parting: bool = False
) -> Array:
    """Return the time of the first touch of ball and bat, (n,) [s].

    The time is inf if they do not touch before `until`. Times are counted from `state`, and `shots`
    are the indices of its shots in the scene. The method is conservative advancement: ball and bat
    cannot meet before a time equal to their gap divided by the largest possible closing speed.
    Therefore even a very short touch is found. With `parting`, a contact at the start is ignored if
    the ball is moving away from the bat.
    """
    bat, start = scene.bat, np.zeros(len(until))
    drop = state.vy - scene.gravity * until
    if parting:
        axis_distance = np.hypot(state.x, state.z - bat.axis)
        speeds = (
            np.hypot(np.hypot(state.vx, state.vz), state.vy) + np.abs(state.rate) * axis_distance
        )
        contact_distance = scene.ball_radius + bat.radius(bat.axis - axis_distance)
        opening = np.maximum(-nearness(scene, state).approach, 0.0)
        start = TOUCHING.parting * opening / (speeds**2 / contact_distance + scene.gravity)
    time = np.where(start < until, start, np.inf)
    active = np.flatnonzero(start < until)
    while len(active):
        state_then = move(scene, state.part(active), time[active], shots[active])
        near = nearness(scene, state_then)
        going = near.gap > TOUCHING.near
        # Only gravity can increase the speed, and distances change by at most the gap.
        upright = np.maximum(np.abs(state_then.vy), np.abs(drop[active]))
        spin, gap = np.abs(state_then.rate), np.maximum(near.gap, 0.0)
        sliding = np.abs(near.sliding) + 2 * spin * gap
        turning = spin * (np.hypot(state_then.x, state_then.z - bat.axis) + gap)
        closing = (
            np.hypot(np.hypot(state_then.vx, state_then.vz), upright)
            + turning
            + bat.steepest * sliding
        )
        active = active[going]
        with np.errstate(divide="ignore"):
            time[active] += near.gap[going] / closing[going]
        late = time[active] >= until[active]
        time[active[late]] = np.inf
        active = active[~late]
    hits = np.flatnonzero(np.isfinite(time))
    fast = np.hypot(state.vx[hits], state.vz[hits])
    for _ in range(TOUCHING.polishing):
        near = nearness(scene, move(scene, state.part(hits), time[hits], shots[hits]))
        sharp = near.approach > TOUCHING.sharp * fast
        later = np.where(sharp, near.gap / np.where(sharp, near.approach, 1.0), 0.0)
        time[hits] = np.maximum(time[hits] + later, 0.0)
    return time
