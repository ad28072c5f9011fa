"""A scene of motion that several tests vary."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.simulation.motion.scene import Balls, Barrel, Bat, Scene, State
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.units import INCH

Array = NDArray[np.float64]
BODY = catalog.load_bat("r161").spec.body
AXIS = BODY.length - 6 * INCH
INERTIA = beam_of(BODY).inertia(AXIS)
RADIUS = 0.0366


def rigid(place: Array, speed: Array, mass: Array, e0: Array) -> Array:
    """Return the e_A of a rigid pivoted bat whose e is that of the ball on a wall."""
    r = mass * (AXIS - place) ** 2 / INERTIA
    return (e0 - r) / (1 + r) + 0 * speed


def scene(friction: bool = True, **other: Any) -> Scene:
    """Return shots at an ordinary pivoted bat: keys of the start and the ball, or of a scene."""
    start = {"x": -0.9, "y": 0.0, "z": 6 * INCH, "vx": 26.8, "vy": 0.0, "vz": 0.0}
    start |= {"angle": 0.0, "rate": 0.0}
    state = State.of(**{name: other.pop(name, value) for name, value in start.items()})
    ball = {"mass": 0.145, "restitution": 0.5, "drag": 0.006 if friction else 0.0}
    arrays = {name: np.full(len(state), other.pop(name, value)) for name, value in ball.items()}
    torques = {"constant_torque": 0.02, "viscous_torque": 0.002, "air_torque": 0.0021}
    bat = Bat(
        barrel=Barrel(BODY.profile),
        axis=AXIS,
        inertia=INERTIA,
        **(torques if friction else {}),
    )
    usual: dict[str, Any] = {"efficiency": rigid, "duration": 0.2, "gravity": 9.80665}
    return Scene(
        start=state,
        balls=Balls(**arrays, radius=RADIUS),
        bat=bat,
        **(usual | other),
    )


def scattered(count: int, seed: int, **other: Any) -> Scene:
    """Return random shots: a bat at rest or swung, a ball aslant, high, low or wide."""
    rng = np.random.default_rng(seed)
    rate = -rng.uniform(0, 45, count) * (rng.uniform(size=count) > 0.3)
    arrival = 0.9 / 30
    given: dict[str, Any] = {
        "y": rng.uniform(-0.05, 0.05, count),
        "z": rng.uniform(2, 12, count) * INCH,
        "vx": rng.uniform(24, 36, count),
        "vz": rng.uniform(-2, 2, count),
        "vy": rng.uniform(-1, 1, count),
        "angle": -rate * arrival + rng.uniform(-0.1, 0.1, count),
        "rate": rate,
        "mass": rng.uniform(0.14, 0.15, count),
        "restitution": rng.uniform(0.4, 0.6, count),
        "drag": rng.uniform(0, 0.01, count),
        "duration": 0.12,
    }
    return scene(**(given | other))
