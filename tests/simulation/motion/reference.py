"""An independent solution of a scene of motion: scipy steps all equations; contacts are events.

It shares only the scene with the tested models: positions are vectors, the contact follows from its
impulse, and nothing is in closed form. It misses a contact that begins and ends within one step, so
it is no oracle for a ball that clips an edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.motion.scene import FrameSpec, GateFrame, ShotScene

__all__ = ["Reference", "reference"]

Array = NDArray[np.float64]
UP = np.array([0.0, 1.0, 0.0])
TOLERANCE, LONGEST_STEP = 1e-13, 2e-3  # longest step [s], short enough for an exact interpolant
LONGEST_WAY = 0.06  # longest distance per step [m], so that no bar is skipped


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Outcome of one shot; contacts are (time, kind, position, speed)."""

    contacts: list[tuple[float, str, float, float]]
    efficiency: float
    ball_velocity: Array  # velocity after the first contact with the bat, (3,)
    bat_rate: float
    place: Array  # position of the ball at the end, (3,)
    velocity: Array  # velocity of the ball at the end, (3,)
    angle: float
    rate: float


def reference(scene: ShotScene, shot: int) -> Reference:
    """Return the outcome of one shot of a scene."""
    from scipy.integrate import solve_ivp

    state, now = np.array(scene.start)[:, shot], 0.0
    contacts: list[tuple[float, str, float, float]] = []
    first: tuple[float, Array, float] = (np.nan, np.full(3, np.nan), np.nan)
    watched = _watched(scene)
    while now < scene.duration:
        events = [event for event, _ in watched]
        solution: Any = solve_ivp(
            lambda _, y: _slope(scene, shot, y),
            (now, scene.duration),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=TOLERANCE,
            max_step=min(LONGEST_STEP, LONGEST_WAY / np.linalg.norm(state[3:6])),
            events=events,
        )
        now, state = float(solution.t[-1]), solution.y[:, -1]
        if solution.status == 0:
            break
        struck = next(i for i, times in enumerate(solution.t_events) if len(times))
        now, state = float(solution.t_events[struck][0]), solution.y_events[struck][0].copy()
        kind, place, speed, efficiency = watched[struck][1](shot, state)
        if kind == "bat" and np.isnan(first[0]):
            first = efficiency, state[3:6].copy(), float(state[7])
        elif kind == "bat":
            kind = "bat again"
        if kind:
            contacts.append((now, kind, place, speed))
    return Reference(
        contacts=contacts,
        efficiency=first[0],
        ball_velocity=first[1],
        bat_rate=first[2],
        place=state[:3],
        velocity=state[3:6],
        angle=float(state[6]),
        rate=float(state[7]),
    )


def _slope(scene: ShotScene, shot: int, state: Array) -> Array:
    velocity, rate = state[3:6], state[7]
    plan = velocity * (1, 0, 1)
    pull = -scene.ball_drag[shot] * np.linalg.norm(plan) * plan - scene.gravity * UP
    return np.array([*velocity, *pull, rate, 0.0])


def _watched(scene: ShotScene) -> list[tuple[Any, Callable[..., Any]]]:
    """Return pairs of an event, falling through zero at a contact, and its effect on the state."""
    pairs: list[tuple[Any, Callable[..., Any]]] = [
        (_falling(lambda y: _gap(scene, y)), lambda shot, y: _hit(scene, shot, y))
    ]
    if stop := scene.stop:

        def turn(_: int, y: Array) -> tuple[str, float, float, float]:
            y[6], y[7] = stop.angle, -stop.restitution * y[7]
            return "stop", np.nan, np.nan, np.nan

        pairs.append((_falling(lambda y: float(stop.angle - y[6])), turn))
        direction = stop.angle + np.arcsin(max(scene.bat.profile.outer_diameter) / 2 / stop.reach)
        post = FrameSpec(
            bottom=-1.0, top=1.0, tip_side=0.0, knob_side=1.0,
            radius=stop.radius, restitution=stop.restitution,
        )  # fmt: skip
        where = float(scene.bat.axis - stop.reach * np.cos(direction))
        frame = GateFrame(post, float(stop.reach * np.sin(direction)))
        pairs.append(_solid(scene, frame, where, where, "stop"))
    for frame in scene.frames:
        ends = frame.spec.tip_side - frame.spec.radius, frame.spec.knob_side + frame.spec.radius
        for low, high in (ends, ends[:1] * 2, ends[1:] * 2):  # both bars, then each post
            pairs.append(_solid(scene, frame, low, high))
    return pairs


def _solid(
    scene: ShotScene, frame: GateFrame, low: float, high: float, kind: str = "frame"
) -> tuple[Any, Callable[..., Any]]:
    """Return the event and the rebound of a ball on an obstacle from `low` to `high` [m]."""

    def away(y: Array) -> Array:
        return np.array([y[0] - frame.x, 0.0, y[2] - min(max(y[2], low), high)])

    passing = False  # state: over or under the bar, until the ball is clear of it in plan view

    def bounce(_: int, y: Array) -> tuple[str, float, float, float]:
        nonlocal passing
        spec, radius, up = frame.spec, scene.ball_radius, y[1] - frame.up
        if low < high:
            bar = 2 * spec.radius + radius
            between = spec.bottom + radius < up < spec.top - radius
            past = not spec.bottom - bar <= up <= spec.top + bar
            if between or past:
                passing = True
                return "", 0.0, 0.0, np.nan
        normal = away(y) / np.linalg.norm(away(y))
        y[3:6] -= (1 + spec.restitution) * (y[3:6] @ normal) * normal
        return kind, np.nan, np.nan, np.nan

    contact_distance = frame.spec.radius + scene.ball_radius

    def gap(y: Array) -> float:
        nonlocal passing
        beside = low < high and not low < y[2] < high  # contacts of a post
        distance = float(np.linalg.norm(away(y))) - contact_distance
        passing &= distance < 1e-9
        return 1.0 if beside or passing else distance

    return _falling(gap), bounce


def _falling(gap: Callable[[Array], float]) -> Any:
    def event(_: float, state: Array) -> float:
        return gap(state)

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


def _offset(scene: ShotScene, state: Array) -> tuple[Array, Array]:
    """Return the vector from the bat's axis to the ball, and that from the pivot to its foot."""
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])  # pivot to tip
    arm = state[:3] - np.array([0.0, 0.0, scene.bat.axis])
    foot = (arm @ along) * along
    return arm - foot, foot


def _gap(scene: ShotScene, state: Array) -> float:
    offset, foot = _offset(scene, state)
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])
    place = np.array([scene.bat.axis - foot @ along])
    contact_distance = scene.bat.radius(place)[0] + scene.ball_radius
    if not 0 <= place[0] <= scene.bat.length:
        return 1.0  # ball beyond the ends
    return float(np.linalg.norm(offset) - contact_distance)


def _hit(scene: ShotScene, shot: int, state: Array) -> tuple[str, float, float, float]:
    offset, foot = _offset(scene, state)
    normal = offset / np.linalg.norm(offset)
    turning = -state[7] * UP  # angle from -z toward +x: about -y
    of_bat = np.cross(turning, foot)
    speed = float((of_bat - state[3:6]) @ normal)
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])
    place = float(scene.bat.axis - foot @ along)
    mass = float(scene.ball_mass[shot])
    arguments = np.array([place]), np.array([speed]), np.array([shot])
    efficiency = float(scene.efficiency(*arguments)[0])
    impulse = mass * speed * (1 + efficiency) * normal
    state[3:6] += impulse / mass
    state[7] -= np.cross(foot, -impulse)[1] / scene.bat.inertia
    return "bat", place, speed, efficiency
