"""An independent answer to a scene of motion: all equations stepped by scipy, contacts as events.

It shares the scene and nothing else with the rungs: positions are vectors, the contact is solved
from its impulse, and nothing is in closed form. It sees no contact that begins and would end
within one of its steps: a ball that clips an edge is not its business.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.motion.scene import Obstacle, Scene

__all__ = ["Reference", "reference"]

Array = NDArray[np.float64]
UP = np.array([0.0, 1.0, 0.0])
TOLERANCE, LONGEST_STEP = 1e-13, 2e-3  # s, so that the interpolant between steps is as good


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """What one shot came to; contacts are (time, kind, place, speed)."""

    contacts: list[tuple[float, str, float, float]]
    efficiency: float
    ball_velocity: Array  # (3,), just after the first contact with the bat
    bat_rate: float
    place: Array  # (3,), of the ball at the end
    velocity: Array  # (3,)
    angle: float
    rate: float


def reference(scene: Scene, shot: int) -> Reference:
    """Return what a shot of a scene comes to."""
    from scipy.integrate import solve_ivp

    start = scene.start.part(shot)
    names = ("x", "y", "z", "vx", "vy", "vz", "angle", "rate")
    state, now = np.array([getattr(start, name) for name in names]), 0.0
    contacts: list[tuple[float, str, float, float]] = []
    first: tuple[float, Array, float] = (np.nan, np.full(3, np.nan), np.nan)
    watched = _watched(scene)
    while now < scene.duration:
        events = [event for event, _ in watched]
        found: Any = solve_ivp(
            lambda _, y: _slope(scene, shot, y),
            (now, scene.duration),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=TOLERANCE,
            max_step=LONGEST_STEP,
            events=events,
        )
        now, state = float(found.t[-1]), found.y[:, -1]
        if found.status == 0:
            break
        struck = next(i for i, times in enumerate(found.t_events) if len(times))
        now, state = float(found.t_events[struck][0]), found.y_events[struck][0].copy()
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


def _slope(scene: Scene, shot: int, state: Array) -> Array:
    velocity, rate = state[3:6], state[7]
    plan = velocity * (1, 0, 1)
    pull = -scene.balls.drag[shot] * np.linalg.norm(plan) * plan - scene.gravity * UP
    bat = scene.bat
    torque = bat.constant_torque + bat.viscous_torque * abs(rate) + bat.air_torque * rate**2
    return np.array([*velocity, *pull, rate, -np.sign(rate) * torque / bat.inertia])


def _watched(scene: Scene) -> list[tuple[Any, Callable[..., Any]]]:
    """Return pairs of an event, falling through zero at a contact, and what it then does."""
    pairs: list[tuple[Any, Callable[..., Any]]] = [
        (_falling(lambda y: _gap(scene, y)), lambda shot, y: _hit(scene, shot, y))
    ]
    if stops := scene.stops:
        for limit, sign in ((stops.low, 1), (stops.high, -1)):

            def turn(_: int, y: Array, limit: float = limit) -> tuple[str, float, float, float]:
                speed = abs(y[7])
                y[6], y[7] = limit, -stops.restitution * y[7]
                return "stop", limit, speed, np.nan

            def angle(y: Array, limit: float = limit, sign: int = sign) -> float:
                return float(sign * (y[6] - limit))

            pairs.append((_falling(angle), turn))
    for obstacle in scene.obstacles:

        def bounce(_: int, y: Array, solid: Obstacle = obstacle) -> tuple[str, float, float, float]:
            away = _from(solid, y)
            normal = away / np.linalg.norm(away)
            speed = -float(y[3:6] @ normal)
            if not solid.low - scene.balls.radius < y[1] < solid.high + scene.balls.radius:
                return "", 0.0, 0.0, np.nan
            y[3:6] += (1 + solid.restitution) * speed * normal
            return solid.kind, float(y[2]), speed, np.nan

        def clear(y: Array, solid: Obstacle = obstacle) -> float:
            return float(np.linalg.norm(_from(solid, y))) - solid.radius - scene.balls.radius

        pairs.append((_falling(clear), bounce))
    return pairs


def _falling(gap: Callable[[Array], float]) -> Any:
    def event(_: float, state: Array) -> float:
        return gap(state)

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


def _from(obstacle: Obstacle, state: Array) -> Array:
    """Return the vector in the plan from the obstacle's middle line to the ball."""
    ends = np.array([[x, 0.0, z] for x, z in zip(obstacle.x, obstacle.z, strict=True)])
    ball, way = state[:3] * (1, 0, 1), ends[1] - ends[0]
    square = way @ way
    share = np.clip((ball - ends[0]) @ way / square, 0, 1) if square else 0.0
    return np.asarray(ball - ends[0] - share * way)


def _offset(scene: Scene, state: Array) -> tuple[Array, Array]:
    """Return the vector from the bat's axis to the ball, and that from the pivot to its foot."""
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])  # from the pivot to the tip
    arm = state[:3] - np.array([0.0, 0.0, scene.bat.axis])
    foot = (arm @ along) * along
    return arm - foot, foot


def _gap(scene: Scene, state: Array) -> float:
    offset, foot = _offset(scene, state)
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])
    place = np.array([scene.bat.axis - foot @ along])
    reach = scene.bat.barrel.radius(place)[0] + scene.balls.radius
    if not 0 <= place[0] <= scene.bat.barrel.length:
        return 1.0  # beside its ends
    return float(np.linalg.norm(offset) - reach)


def _hit(scene: Scene, shot: int, state: Array) -> tuple[str, float, float, float]:
    offset, foot = _offset(scene, state)
    normal = offset / np.linalg.norm(offset)
    turning = -state[7] * UP  # the angle grows from -z toward +x: about -y
    of_bat = np.cross(turning, foot)
    speed = float((of_bat - state[3:6]) @ normal)
    along = np.array([np.sin(state[6]), 0.0, -np.cos(state[6])])
    place = float(scene.bat.axis - foot @ along)
    mass = float(scene.balls.mass[shot])
    given = np.array([place]), np.array([speed]), np.array([mass])
    efficiency = float(scene.efficiency(*given, scene.balls.restitution[shot : shot + 1])[0])
    impulse = mass * speed * (1 + efficiency) * normal
    state[3:6] += impulse / mass
    state[7] -= np.cross(foot, -impulse)[1] / scene.bat.inertia
    return "bat", place, speed, efficiency
