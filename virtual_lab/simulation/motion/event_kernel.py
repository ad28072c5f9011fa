"""Compiled event-driven motion of the shots, one shot at a time.

An event is a contact of the ball with the bat, a bar or a post, or of the bat with its stop.
Between events the motion is known in closed form, so the time of an event is the root of a
function. For a bar or post this function is a quadratic, because the ball flies straight in the
horizontal plane. For the bat it is the gap; its root is exact except for rounding.
"""

from __future__ import annotations

from math import cos, expm1, hypot, inf, log1p, nan, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.motion.played import Target
from virtual_lab.simulation.motion.touch import TOUCHING, Obstacle
from virtual_lab.units import INNER, Array

_, BAT, BAT_AGAIN, STOP, FRAME = range(len(Target))
PLAYED, EDGE, GRAZED, FOLLOWED, MANY = range(len(Obstacle) + 1)
MOST = 100  # largest number of contacts in one record
NEAR, PARTING, SHARP = TOUCHING.near, TOUCHING.parting, TOUCHING.sharp
NEWTONS = 20  # largest number of Newton steps; each multiplies the error by the taper's slope
OVER = 1e-6  # overlap with a bar or post above which the ball is on top of it [m]


class Own(NamedTuple):
    """Constants of one shot [SI]."""

    mass: float  # mass of the ball
    drag: float
    radius: float
    gravity: float
    duration: float
    axis: float
    inertia: float


class Moving(NamedTuple):
    """State of ball and bat in one shot, as in `ShotState`."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    angle: float
    rate: float


class Near(NamedTuple):
    """Gap and relative motion of ball and bat in one shot, as in `Nearness`."""

    gap: float
    place: float
    lever: float
    approach: float
    sliding: float
    normal: tuple[float, float, float]
    turning: float


class Solid(NamedTuple):
    """Columns of the table of bars and posts, (shot, solid, 10)."""

    x: int = 0
    low: int = 1  # lower z of the axis
    high: int = 2  # upper z of the axis, equal to `low` for a post
    reach: int = 3  # distance between the axis and the center of a touching ball
    restitution: int = 4
    kind: int = 5
    under: int = 6  # height below which a ball passes under the lower bar, NaN for a post
    bottom: int = 7  # lowest height of a ball between the bars
    top: int = 8  # highest height of a ball between the bars
    over: int = 9  # height above which a ball passes over the upper bar


SOLID = Solid()


class Scene(NamedTuple):
    """Properties common to all shots, and the tables of each shot [SI]."""

    knots: Array  # (k + 1,), distances from the tip
    cubics: Array  # (4, k), cubics of the bat's radius from each knot, highest power first
    steepest: float  # largest slope of the radius
    stop: float  # angle of the bat at its stop, inf without a stop
    restitution: float  # restitution of the bat at its stop
    constants: Array  # (shot, 7), columns of `Own`
    solids: Array  # (shot, solid, 10)


class Log(NamedTuple):
    """Motion of the shots: the start in the first row, then one row per contact."""

    rows: NDArray[np.int64]  # (shot,), number of rows so far
    kind: NDArray[np.int8]  # (row, shot)
    time: Array
    place: Array  # impact position on the bat
    speed: Array  # normal speed of approach to the bat
    state: Array  # (row, shot, 8), after the event, or before it if the shot `waits`
    waits: NDArray[np.bool_]  # (shot,), whether the e_A of the contact is needed to continue
    refused: NDArray[np.int8]


@njit(**INNER, error_model="numpy")
def _radius(place: float, scene: Scene) -> float:
    """Return the bat's radius [m]; beyond an end it is the radius of that end."""
    last = scene.knots.size - 1
    at = min(max(place, scene.knots[0]), scene.knots[last])
    k = 0
    while k < last - 1 and at >= scene.knots[k + 1]:
        k += 1
    past, radius = at - scene.knots[k], 0.0
    for power in range(4):
        radius = radius * past + scene.cubics[power, k]
    return radius


@njit(**INNER, error_model="numpy")
def _move(state: Moving, time: float, shot: Own) -> Moving:
    """Return the state after a `time` [s] of free motion."""
    loss = shot.drag * hypot(state.vx, state.vz) * time
    path = time * log1p(loss) / loss if loss > 0 else time
    return Moving(
        state.x + state.vx * path,
        state.y + (state.vy - shot.gravity / 2 * time) * time,
        state.z + state.vz * path,
        state.vx / (1 + loss),
        state.vy - shot.gravity * time,
        state.vz / (1 + loss),
        state.angle + state.rate * time,
        state.rate,
    )


@njit(**INNER, error_model="numpy")
def _nearness(state: Moving, shot: Own, scene: Scene) -> Near:
    """Return gap and relative motion of ball and bat. The ends of the bat are flat."""
    c, s = cos(state.angle), sin(state.angle)
    z = state.z - shot.axis
    beside, lever = state.x * c + z * s, state.x * s - z * c
    place = shot.axis - lever
    across = hypot(beside, state.y)
    deep = across - _radius(place, scene)
    beyond = max(scene.knots[0] - place, place - scene.knots[-1])
    gap = (hypot(max(deep, 0.0), beyond) if beyond > 0 else deep) - shot.radius
    in_plane, up = (beside / across, state.y / across) if across > 0 else (0.0, 0.0)
    outward = state.vx * c + state.vz * s - state.rate * lever
    return Near(
        gap,
        place,
        lever,
        -(outward * in_plane + state.vy * up),
        -(state.vx * s - state.vz * c + state.rate * beside),
        (in_plane * c, up, in_plane * s),
        -in_plane,
    )


@njit(**INNER, error_model="numpy")
def _kick(state: Moving, gain: float, normal: tuple[float, float, float], rate: float) -> Moving:
    """Return the state with the ball's velocity changed by `gain` along `normal`, and `rate`."""
    vx, vy, vz = state.vx + gain * normal[0], state.vy + gain * normal[1], state.vz
    return Moving(state.x, state.y, state.z, vx, vy, vz + gain * normal[2], state.angle, rate)


@njit(**INNER, error_model="numpy")
def _struck(state: Moving, efficiency: float, shot: Own, scene: Scene) -> tuple[Moving, int]:
    """Return the state after a frictionless contact with this e_A, and the obstacle, 0 if none."""
    near = _nearness(state, shot, scene)
    gain = (1 + efficiency) * near.approach
    rate = state.rate + shot.mass * gain * near.lever * near.turning / shot.inertia
    after = _kick(state, gain, near.normal, rate)
    if near.place < scene.knots[0] or near.place > scene.knots[-1]:
        return after, EDGE
    if near.approach <= 0:
        return after, GRAZED
    return after, FOLLOWED if _nearness(after, shot, scene).approach >= 0 else PLAYED


@njit(**INNER, error_model="numpy")
def _first_touch(state: Moving, until: float, shot: Own, scene: Scene) -> float:
    """Return the time of the first touch of ball and bat before `until` [s], inf if there is none.

    The steps are bounded as in `touch.first_touch`, so that even a very short touch is found.
    """
    near, time = _nearness(state, shot, scene), 0.0
    fast = hypot(state.vx, state.vz)
    if near.gap <= NEAR and near.approach < 0:  # if ball and bat are separating
        axis_distance = hypot(state.x, state.z - shot.axis)
        speeds = hypot(fast, state.vy) + abs(state.rate) * axis_distance
        contact_distance = shot.radius + _radius(shot.axis - axis_distance, scene)
        time = -PARTING * near.approach / (speeds**2 / contact_distance + shot.gravity)
    drop = abs(state.vy - shot.gravity * until)
    while time < until:
        state_then = _move(state, time, shot)
        near = _nearness(state_then, shot, scene)
        if near.gap <= NEAR:
            break
        spin = abs(state_then.rate)
        sliding = abs(near.sliding) + 2 * spin * near.gap
        turning = spin * (hypot(state_then.x, state_then.z - shot.axis) + near.gap)
        closing = hypot(hypot(state_then.vx, state_then.vz), max(abs(state_then.vy), drop))
        time += near.gap / (closing + turning + scene.steepest * sliding)
    if not time < until:
        return inf
    for _ in range(NEWTONS):
        near = _nearness(_move(state, time, shot), shot, scene)
        if near.approach <= SHARP * fast:
            break
        later = max(time + near.gap / near.approach, 0.0)
        if later == time:
            break
        time = later
    return time


@njit(**INNER, error_model="numpy")
def _next_solid(
    state: Moving, shot: Own, solids: Array
) -> tuple[float, int, tuple[float, float, float]]:
    """Return the time of the next contact with a bar or post [s], its index and its normal."""
    first, ahead, normal = inf, -1, (0.0, 0.0, 0.0)
    speed = hypot(state.vx, state.vz)
    if speed == 0:
        return first, ahead, normal
    along_x, along_z = state.vx / speed, state.vz / speed
    for k in range(solids.shape[0]):
        x, low, high, contact_distance = solids[k, 0], solids[k, 1], solids[k, 2], solids[k, 3]
        beside = state.x - x
        if low < high:
            path = (abs(beside) - contact_distance) / abs(along_x) if beside * along_x < 0 else inf
            if not low <= state.z + along_z * path <= high:
                continue  # the posts are beyond the ends of a bar
        else:
            towards = -(beside * along_x + (state.z - low) * along_z)
            offset = beside * along_z - (state.z - low) * along_x
            path = (
                towards - sqrt(contact_distance**2 - offset**2)
                if towards > 0 and abs(offset) < contact_distance
                else inf
            )
        if not -OVER <= path < inf:
            continue
        path = max(path, 0.0)
        loss = shot.drag * path
        time = (expm1(loss) / loss if loss > 0 else 1.0) * path / speed
        y = state.y + (state.vy - shot.gravity / 2 * time) * time
        under, bottom, top, over = solids[k, 6], solids[k, 7], solids[k, 8], solids[k, 9]
        if time < first and not (y < under or bottom < y < top or y > over):
            first, ahead, at = time, k, state.z + along_z * path
            off_x, off_z = beside + along_x * path, at - min(max(at, low), high)
            normal = off_x / contact_distance, 0.0, off_z / contact_distance
    return first, ahead, normal


@njit(**INNER)
def _write(state: Moving, row: Array) -> None:
    for k in range(row.size):
        row[k] = state[k]


@njit(cache=True, error_model="numpy")
def carry_on(shots: NDArray[np.int64], efficiency: Array, scene: Scene, log: Log) -> None:
    """Simulate shots, each until its next contact with the bat or until the shot ends.

    A shot that was not paused starts at its beginning. A shot pauses at a contact with the bat,
    because the caller must compute the collision efficiency e_A of the contact. `log.waits` is then
    True for this shot. The next call with the shot resumes it. The events are added to `log`, which
    is changed in place.

    `shots` holds the indices of the shots. `efficiency`, (len(shots),), is the e_A of the contact
    at which each shot was paused. It is ignored for a shot that was not paused.
    """
    for number in range(shots.size):
        i = shots[number]
        row, constants, solids = log.rows[i] - 1, scene.constants[i], scene.solids[i]
        shot = Own(
            constants[0],
            constants[1],
            constants[2],
            constants[3],
            constants[4],
            constants[5],
            constants[6],
        )
        s, now = log.state[row, i], log.time[row, i]
        state = Moving(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
        if log.waits[i]:
            state, log.refused[i] = _struck(state, efficiency[number], shot, scene)
            _write(state, s)
            log.waits[i] = False
        while now < shot.duration and not (log.refused[i] or log.waits[i]):
            solid, ahead, normal = _next_solid(state, shot, solids)
            stop = inf
            if state.rate > 0:
                stop = max(scene.stop - state.angle, 0.0) / state.rate
            free = min(solid, stop, shot.duration - now)
            span = min(free, _first_touch(state, free, shot, scene))
            now += span
            state = _move(state, span, shot)
            row += 1
            log.place[row, i] = log.speed[row, i] = nan
            if span == solid:
                away = state.vx * normal[0] + state.vz * normal[2]
                gain = -(1 + solids[ahead, SOLID.restitution]) * away
                state = _kick(state, gain, normal, state.rate)
                log.kind[row, i] = int(solids[ahead, SOLID.kind])
            elif span == stop:
                rebound = -scene.restitution * state.rate
                flight = state.x, state.y, state.z, state.vx, state.vy, state.vz
                state = Moving(*flight, scene.stop, rebound)
                log.kind[row, i] = STOP
            elif span < free:
                near = _nearness(state, shot, scene)
                log.place[row, i], log.speed[row, i] = near.place, near.approach
                again = (log.kind[:row, i] == BAT).any()
                log.kind[row, i] = BAT_AGAIN if again else BAT
                log.waits[i] = True
            else:
                break
            log.time[row, i] = now
            _write(state, log.state[row, i])
            log.rows[i] = row + 1
            if row > MOST:
                log.refused[i], log.waits[i] = MANY, False
