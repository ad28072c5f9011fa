"""What came of the shots of a scene."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.motion.scene import Scene, State
from virtual_lab.simulation.motion.track import Track

__all__ = ["BAT", "BAT_AGAIN", "STOP", "Events", "Outcome"]

Array = NDArray[np.float64]
Texts = NDArray[np.str_]
BAT, BAT_AGAIN, STOP = "bat", "bat again", "stop"  # an obstacle's own kind stands for itself


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """Contacts of all shots, a row each (k,), in the order of shot and time."""

    shot: NDArray[np.int_]
    time: Array  # [s]
    kind: Texts
    place: Array  # of the bat, from its tip; of an obstacle, z; of a stop, its angle [m, rad]
    speed: Array  # of approach, normal [m/s]; of a stop [rad/s]

    @classmethod
    def of(cls, rows: list[tuple[int, float, str, float, float]]) -> Self:
        """Return the rows (shot, time, kind, place, speed) sorted."""
        columns = list(zip(*sorted(rows), strict=True)) or [()] * 5
        return cls(
            shot=np.array(columns[0], dtype=np.int_),
            time=np.array(columns[1], dtype=float),
            kind=np.array(columns[2], dtype=np.str_),
            place=np.array(columns[3], dtype=float),
            speed=np.array(columns[4], dtype=float),
        )

    def rows(self) -> list[tuple[int, float, str, float, float]]:
        """Return the rows as `of` takes them."""
        columns = [getattr(self, field.name).tolist() for field in fields(self)]
        return list(zip(*columns, strict=True))

    def of_shots(self, shots: NDArray[np.int_]) -> Self:
        """Return the same events, their shots named anew: shot i becomes `shots[i]`."""
        return replace(self, shot=shots[self.shot])


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What n shots came to, NaN where there is no such thing or the rung refused.

    `refused` is the sentence that says why a rung could not do a shot, empty where it could.
    Speeds of the ball are vectors (n, 3) along x, y, z.
    """

    rung: Texts
    reason: Texts  # why this rung was taken
    refused: Texts
    time: Array  # of the first contact of ball and bat [s]
    place: Array  # of it, from the tip [m]
    relative_speed: Array  # normal, just before it [m/s]
    collision_efficiency: Array
    ball_velocity: Array  # (n, 3), just after it [m/s]
    bat_rate: Array  # just after it [rad/s]
    end: State  # at the end of the record
    pivot_drift: Array  # greatest way of the bat off its axis [m]
    events: Events
    track: Track

    def merged(self, scene: Scene, chosen: NDArray[np.int_], other: Outcome) -> Self:
        """Return this outcome, the chosen shots, refused here, as `other` has them."""
        arrays: dict[str, Any] = {}
        for field in fields(self):
            own = getattr(self, field.name)
            if isinstance(own, np.ndarray):
                theirs = getattr(other, field.name)
                # texts grow to the longer of both
                arrays[field.name] = own.astype(np.result_type(own, theirs))
                arrays[field.name][chosen] = theirs
        return replace(
            self,
            **arrays,
            end=self.end.with_part(chosen, other.end),
            events=Events.of(self.events.rows() + other.events.of_shots(chosen).rows()),
            track=Track.of(scene, [self.track.rows(), other.track.rows(chosen)]),
        )
