"""One shot as seen from above: where ball and bat are over time, and what is struck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from virtual_lab.simulation.arrays import Array
from virtual_lab.simulation.motion.played import PlayedShots
from virtual_lab.simulation.motion.scene import ShotScene

__all__ = ["PlanContact", "PlanView", "plan_view"]


class PlanContact(NamedTuple):
    """One contact: what was struck ("bat", "bat again", "stop", "frame"), where the ball was."""

    struck: str
    time: float  # [s]
    x: float  # [m]
    z: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanView:
    """Axes as in `scene`: x along the line of fire, z along the resting bat from its tip.

    The bat turns by `angle` about x = 0, z = `axis`, so its tip is at
    (`axis` sin angle, `axis` (1 - cos angle)).
    """

    time: Array  # (s,) [s]
    ball_x: Array  # (s,) [m]
    ball_z: Array
    angle: Array  # (s,) [rad]
    axis: float  # [m]
    contacts: tuple[PlanContact, ...]


def plan_view(scene: ShotScene, played: PlayedShots, shot: int, moments: int = 200) -> PlanView:
    """Return one shot of a scene at evenly spaced `moments` and at its contacts.

    Raises `ValueError` for a shot that the rung refused.
    """
    if played.refused[shot]:
        raise ValueError(str(played.refused[shot]))
    own = played.pieces.part(played.pieces.shot == shot)
    time = np.union1d(np.linspace(0.0, scene.duration, moments), own.time)
    seen = played.at(scene, time).part(shot)
    rows = zip(own.struck, own.time, own.state.x, own.state.z, strict=True)
    return PlanView(
        time=time,
        ball_x=seen.x,
        ball_z=seen.z,
        angle=seen.angle,
        axis=scene.bat.axis,
        contacts=tuple(PlanContact(str(s), float(t), float(x), float(z)) for s, t, x, z in rows)[
            1:
        ],
    )
