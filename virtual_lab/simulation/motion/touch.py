"""Free motion of ball and bat, how far apart they are, and when they first touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after, speed_after
from virtual_lab.simulation.motion.scene import Obstacle, Scene, State
from virtual_lab.simulation.physics.coasting import slowed, turned

__all__ = [
    "Nearness",
    "after_contact",
    "first_touch",
    "first_zero",
    "moved",
    "nearness",
    "obstacle_gap",
]

Array = NDArray[np.float64]
Shots = NDArray[np.int_] | slice
Gap = Callable[[Array, NDArray[np.int_]], tuple[Array, Array]]
ALL = slice(None)
NEAR = 1e-7  # m, that no barrel is round to
# A gap that opens at a rate stays open while this share of its radii, over the square of all
# speeds, times the rate passes: its curvature would have to be 8 of those squares over the radii.
PARTING = 0.25
POLISHING = 3  # steps of Newton from within `NEAR`
SHARP = 1e-2  # of the ball's speed, at which a gap must close to be polished


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearness:
    """Ball and bat at a moment, each (n,)."""

    gap: Array  # between the surfaces [m]
    place: Array  # of the ball's centre along the bat, from the tip [m]
    lever: Array  # from the axis of rotation [m]
    approach: Array  # normal speed, without the taper [m/s]
    opening: Array  # rate of the gap beside the bat [m/s]
    sliding: Array  # rate of the place [m/s]
    normal: Array  # (n, 3), from the bat to the ball
    turning: Array  # share of the normal that turns the bat, positive in recoil


def moved(scene: Scene, state: State, time: Array, shots: Shots = ALL) -> State:
    """Return the state a `time` [s] later if nothing is touched, of these `shots` of the scene.

    Drag slows the ball along its way in the plan, gravity bends its height: exact in both.
    """
    speed = np.hypot(state.vx, state.vz)
    drag = scene.balls.drag[shots]
    # a resting ball flies nowhere in any direction
    share = 1 / np.where(speed > 0, speed, 1.0)
    way = distance_after(time, speed, drag) * share
    kept = np.where(speed > 0, speed_after(time, speed, drag) * share, 1.0)
    friction = scene.bat.friction
    return State(
        x=state.x + state.vx * way,
        y=state.y + (state.vy - scene.gravity / 2 * time) * time,
        z=state.z + state.vz * way,
        vx=state.vx * kept,
        vy=state.vy - scene.gravity * time,
        vz=state.vz * kept,
        angle=state.angle + turned(state.rate, time, **friction),
        rate=slowed(state.rate, time, **friction),
    )


def nearness(scene: Scene, state: State) -> Nearness:
    """Return how near ball and bat are. Beyond its ends the bat is cut off flat."""
    bat, radius = scene.bat, scene.balls.radius
    cos, sin = np.cos(state.angle), np.sin(state.angle)
    z = state.z - bat.axis
    beside = state.x * cos + z * sin
    lever = state.x * sin - z * cos
    place = bat.axis - lever
    outline = bat.barrel.radius(place)
    across = np.hypot(beside, state.y)
    beyond = np.maximum(np.maximum(-place, place - bat.barrel.length), 0.0)
    inside = np.hypot(np.maximum(across - outline, 0.0), beyond)
    gap = np.where(beyond > 0, inside, across - outline) - radius
    away = 1 / np.where(across > 0, across, np.inf)
    in_plane, up = beside * away, state.y * away
    outward = state.vx * cos + state.vz * sin - state.rate * lever
    leaving = outward * in_plane + state.vy * up
    sliding = -(state.vx * sin - state.vz * cos + state.rate * beside)  # along the bat, of place
    return Nearness(
        gap=gap,
        place=place,
        lever=lever,
        approach=-leaving,
        opening=leaving - bat.barrel.slope(place) * sliding,
        sliding=sliding,
        normal=np.stack([in_plane * cos, up, in_plane * sin], axis=-1),
        turning=-in_plane,
    )


def after_contact(
    scene: Scene, state: State, near: Nearness, efficiency: Array, shots: Shots = ALL
) -> State:
    """Return the state after smooth contacts of these efficiencies, of these `shots`.

    The ball's normal speed is reversed times e_A, its speed along the surface stays; the bat
    takes the angular momentum about its axis.
    """
    gain = (1 + efficiency) * near.approach
    kick = near.normal * gain[:, None]
    momentum = scene.balls.mass[shots] * gain * near.lever * near.turning
    return replace(
        state,
        vx=state.vx + kick[:, 0],
        vy=state.vy + kick[:, 1],
        vz=state.vz + kick[:, 2],
        rate=state.rate + momentum / scene.bat.inertia,
    )


def first_touch(
    scene: Scene, state: State, until: Array, *, parting: bool = False, shots: Shots = ALL
) -> Array:
    """Return when ball and bat first touch [s] from `state`, before `until`; inf where they do not.

    Parameters
    ----------
    until : (n,) array
    parting : bool
        They may touch at the start, where their gap opens.
    """
    bat = scene.bat
    of_scene = np.arange(len(scene))[shots]
    drop = state.vy - scene.gravity * until

    def gap(time: Array, part: NDArray[np.int_]) -> tuple[Array, Array]:
        here = moved(scene, state.part(part), time, of_scene[part])
        near = nearness(scene, here)
        wide = np.maximum(near.gap, 0.0)
        upright = np.maximum(np.abs(here.vy), np.abs(drop[part]))  # gravity alone can raise it
        plan, spin = np.hypot(here.vx, here.vz), np.abs(here.rate)
        # places change by no more than the gap before it closes
        sliding = np.abs(near.sliding) + 2 * spin * wide
        turning = spin * (np.hypot(here.x, here.z - bat.axis) + wide)
        return near.gap, np.hypot(plan, upright) + turning + bat.barrel.steepest * sliding

    start = np.zeros(len(state))
    if parting:
        apart = np.hypot(state.x, state.z - bat.axis)
        speeds = np.hypot(np.hypot(state.vx, state.vz), state.vy) + np.abs(state.rate) * apart
        reach = scene.balls.radius + bat.barrel.radius(bat.axis - apart)
        pull = scene.gravity + bat.friction["constant"] * apart
        opening = np.maximum(nearness(scene, state).opening, 0.0)
        start = PARTING * opening / (speeds**2 / reach + pull)
    time = first_zero(gap, start, until)
    met = np.flatnonzero(np.isfinite(time))
    for _ in range(POLISHING):
        near = nearness(scene, moved(scene, state.part(met), time[met], of_scene[met]))
        sharp = near.opening < -SHARP * np.hypot(state.vx[met], state.vz[met])
        nearer = np.where(sharp, near.gap / np.where(sharp, near.opening, 1.0), 0.0)
        time[met] = np.maximum(time[met] - nearer, 0.0)
    return time


def obstacle_gap(obstacle: Obstacle, scene: Scene, state: State) -> Array:
    """Return the gap of balls and an obstacle in the plan [m], (n,)."""
    (x0, x1), (z0, z1) = obstacle.x, obstacle.z
    dx, dz = x1 - x0, z1 - z0
    square = dx**2 + dz**2
    along = ((state.x - x0) * dx + (state.z - z0) * dz) / (square or 1.0)
    at = np.clip(along, 0.0, 1.0) if square else 0.0
    far = np.hypot(state.x - x0 - at * dx, state.z - z0 - at * dz)
    return np.asarray(far - obstacle.radius - scene.balls.radius)


def first_zero(gap: Gap, start: Array, until: Array) -> Array:
    """Return when gaps first close to `NEAR`, from `start` to `until` [s]; inf if not at all.

    Conservative advancement: the bodies cannot meet before the gap divided by the greatest
    speed at which it may close, so no touch is ever passed, however short.

    Parameters
    ----------
    gap : callable
        Takes times (k,) and shots (k,); returns gaps and bounds on their rates, each (k,).
        A bound need hold only until the gap so divided has passed.
    """
    time = np.where(start < until, start, np.inf)
    still = np.flatnonzero(start < until)
    while len(still):
        left, rate = gap(time[still], still)
        going = left > NEAR
        still, left, rate = still[going], left[going], rate[going]
        with np.errstate(divide="ignore"):
            time[still] += left / rate
        late = time[still] >= until[still]
        time[still[late]] = np.inf
        still = still[~late]
    return time
