"""A scene of motion that several tests vary."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.simulation.motion.closed_form import play_closed_form
from virtual_lab.simulation.motion.events import play_events
from virtual_lab.simulation.motion.played import PlayedShots
from virtual_lab.simulation.motion.pymunk_scene import play_pymunk
from virtual_lab.simulation.motion.scene import (
    FrameSpec,
    GateFrame,
    PivotedBat,
    ShotScene,
    ShotState,
    StopSpec,
)
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.units import INCH

Array = NDArray[np.float64]
BODY = catalog.load_bat("r161").spec.body
AXIS = BODY.length - 6 * INCH
INERTIA = beam_of(BODY).inertia(AXIS)
RADIUS, MASS, E0 = 0.0366, 0.145, 0.5
FRAME = FrameSpec(bottom=-0.2, top=0.2, tip_side=-0.1, knob_side=0.4, radius=0.02, restitution=0.6)


def rigid(place: Array, *_: Any) -> Array:
    """Return the e_A of a rigid pivoted bat whose e is the ball's restitution on a wall."""
    r = MASS * (AXIS - place) ** 2 / INERTIA
    return (E0 - r) / (1 + r)


def play(scene: ShotScene, model: str) -> PlayedShots:
    players = {"closed-form": play_closed_form, "events": play_events, "pymunk": play_pymunk}
    return players[model](scene)


def stop(angle: float, restitution: float = 0.5) -> StopSpec:
    return StopSpec(angle=angle, reach=0.4, radius=0.03, restitution=restitution)


def frame_at(x: float, **other: float) -> GateFrame:
    values = {name: getattr(FRAME, name) for name in FRAME.__slots__} | other
    return GateFrame(FrameSpec(**values), x)


def scene(**other: Any) -> ShotScene:
    """Return shots at an ordinary pivoted bat; `other` has keys of the start or of the scene."""
    start = {"x": -0.9, "z": 6 * INCH, "vx": 26.8}
    start |= {name: other.pop(name) for name in ShotState._fields if name in other}
    state = ShotState.of(**start)
    drag = other.pop("drag", 0.006)
    usual: dict[str, Any] = {"efficiency": rigid, "duration": 0.2, "gravity": 9.80665}
    return ShotScene(
        start=state,
        ball_mass=np.full(len(state.x), MASS),
        ball_drag=np.full(len(state.x), drag),
        ball_radius=RADIUS,
        bat=PivotedBat(BODY.profile, AXIS, INERTIA),
        **(usual | other),
    )


def scattered(count: int, seed: int, **other: Any) -> ShotScene:
    """Return random shots: bat at rest or swung, ball oblique, high, low or off the line."""
    rng = np.random.default_rng(seed)
    rate = -rng.uniform(0, 45, count) * (rng.uniform(size=count) > 0.3)
    arrival = 0.9 / 30
    values: dict[str, Any] = {
        "y": rng.uniform(-0.05, 0.05, count),
        "z": rng.uniform(2, 12, count) * INCH,
        "vx": rng.uniform(24, 36, count),
        "vz": rng.uniform(-2, 2, count),
        "vy": rng.uniform(-1, 1, count),
        "angle": -rate * arrival + rng.uniform(-0.1, 0.1, count),
        "rate": rate,
        "drag": rng.uniform(0, 0.01, count),
        "duration": 0.12,
    }
    return scene(**(values | other))
