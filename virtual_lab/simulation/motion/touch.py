"""Free motion of ball and bat, how far apart they are, and when they first touch."""

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
    """When ball and bat count as touching, and how the moment is found."""

    near: float = 1e-7  # m, that no barrel is round to
    # A gap that opens at a rate stays open while this share of its radii, over the square of all
    # speeds, times the rate passes: its curvature would have to be 8 of those squares over them.
    parting: float = 0.25
    polishing: int = 4  # steps of Newton from within `near`, the taper left out of their slope
    sharp: float = 1e-2  # of the ball's speed, at which a gap must close to be polished


TOUCHING = Touching()


class Obstacle(StrEnum):
    """Why a contact cannot be done, in the order of precedence."""

    EDGE = "the ball strikes the edge of the bat's end, where no collision model holds"
    GRAZED = "the ball grazes the bat by less than its roundness is known"
    FOLLOWED = "the bat follows faster than the ball leaves it: no such e_A can be"
    MANY = "more than 100 contacts in one record"


class Nearness(NamedTuple):
    """Ball and bat at a moment, each (n,)."""

    gap: Array  # between the surfaces [m]
    place: Array  # of the ball's centre along the bat, from the tip [m]
    lever: Array  # from the axis of rotation [m]
    approach: Array  # normal speed, without the taper [m/s]
    sliding: Array  # rate of the place [m/s]
    normal: Array  # (3, n), from the bat to the ball
    turning: Array  # share of the normal that turns the bat, positive in recoil


def moved(scene: ShotScene, state: ShotState, time: Array, shots: Shots) -> ShotState:
    """Return the state a `time` [s] later if nothing is touched, of these `shots` of the scene.

    Drag slows the ball along its way in the plan, gravity bends its height: exact in both.
    """
    speed = np.hypot(state.vx, state.vz)
    drag = scene.ball_drag[shots]
    gravity = np.broadcast_to(scene.gravity, (scene.shots,))[shots]
    # a resting ball flies nowhere in any direction
    share = 1 / np.where(speed > 0, speed, 1.0)
    way = distance_after(time, speed, drag) * share
    kept = np.where(speed > 0, speed_after(time, speed, drag) * share, 1.0)
    return ShotState(
        x=state.x + state.vx * way,
        y=state.y + (state.vy - gravity / 2 * time) * time,
        z=state.z + state.vz * way,
        vx=state.vx * kept,
        vy=state.vy - gravity * time,
        vz=state.vz * kept,
        angle=state.angle + state.rate * time,
        rate=state.rate + 0 * time,
    )


def nearness(scene: ShotScene, state: ShotState) -> Nearness:
    """Return how near ball and bat are. Beyond its ends the bat is cut off flat."""
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


def parted(
    scene: ShotScene, state: ShotState, near: Nearness, efficiency: Array, shots: Shots
) -> ShotState:
    """Return the state after smooth contacts of these efficiencies, of these `shots`.

    The ball's normal speed is reversed times e_A, its speed along the surface stays; the bat
    takes the angular momentum about its axis.
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
    """Return why contacts that leave ball and bat in states `after` cannot be, (n,); "": they can.

    `near` is how near they were before.
    """
    edge = (near.place < 0) | (near.place > scene.bat.length)
    follows = nearness(scene, after).approach >= 0
    why = [Obstacle.EDGE, Obstacle.GRAZED, Obstacle.FOLLOWED]
    return np.select([edge, near.approach <= 0, follows], why, "")


def time_to_stop(scene: ShotScene, state: ShotState) -> Array:
    """Return when the bat comes to its stop [s]; inf where it does not."""
    if scene.stop is None:
        return np.full(state.rate.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.maximum(scene.stop.angle - state.angle, 0.0) / state.rate
    return np.where(state.rate > 0, time, np.inf)


def first_touch(
    scene: ShotScene, state: ShotState, until: Array, shots: Shots, *, parting: bool = False
) -> Array:
    """Return when ball and bat first touch [s] from `state`, before `until`; inf where they do not.

    Conservative advancement: they cannot meet before their gap divided by the greatest speed at
    which it may close, so no touch is ever passed, however short. `parting`: they may touch at
    the start, where their gap opens.
    """
    bat, start = scene.bat, np.zeros(len(until))
    drop = state.vy - scene.gravity * until
    if parting:
        apart = np.hypot(state.x, state.z - bat.axis)
        speeds = np.hypot(np.hypot(state.vx, state.vz), state.vy) + np.abs(state.rate) * apart
        reach = scene.ball_radius + bat.radius(bat.axis - apart)
        opening = np.maximum(-nearness(scene, state).approach, 0.0)
        start = TOUCHING.parting * opening / (speeds**2 / reach + scene.gravity)
    time = np.where(start < until, start, np.inf)
    still = np.flatnonzero(start < until)
    while len(still):
        here = moved(scene, state.part(still), time[still], shots[still])
        near = nearness(scene, here)
        going = near.gap > TOUCHING.near
        # gravity alone can raise it; places change by no more than the gap before it closes
        upright = np.maximum(np.abs(here.vy), np.abs(drop[still]))
        spin, wide = np.abs(here.rate), np.maximum(near.gap, 0.0)
        sliding = np.abs(near.sliding) + 2 * spin * wide
        turning = spin * (np.hypot(here.x, here.z - bat.axis) + wide)
        closing = np.hypot(np.hypot(here.vx, here.vz), upright) + turning + bat.steepest * sliding
        still = still[going]
        with np.errstate(divide="ignore"):
            time[still] += near.gap[going] / closing[going]
        late = time[still] >= until[still]
        time[still[late]] = np.inf
        still = still[~late]
    met = np.flatnonzero(np.isfinite(time))
    fast = np.hypot(state.vx[met], state.vz[met])
    for _ in range(TOUCHING.polishing):
        near = nearness(scene, moved(scene, state.part(met), time[met], shots[met]))
        sharp = near.approach > TOUCHING.sharp * fast
        later = np.where(sharp, near.gap / np.where(sharp, near.approach, 1.0), 0.0)
        time[met] = np.maximum(time[met] + later, 0.0)
    return time
