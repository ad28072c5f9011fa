"""Motion of the shots of a scene: pieces of free motion between contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.simulation.motion.scene import ShotScene, ShotState
from virtual_lab.simulation.motion.touch import move
from virtual_lab.units import Array


class Target(StrEnum):
    """Object struck by the ball, or by the bat at its stop."""

    START = ""  # no object: start of the shot
    BAT = "bat"
    BAT_AGAIN = "bat again"
    STOP = "stop"
    FRAME = "frame"


class Pieces(NamedTuple):
    """Pieces of free motion, arrays (k,). The motion between contacts is exact."""

    shot: NDArray[np.int_]
    time: Array  # start of the piece [s]
    struck: NDArray[np.str_]  # object struck at the start
    place: Array  # impact position on the bat, from its tip [m], NaN for other objects
    speed: Array  # normal speed of approach to the bat [m/s], NaN for other objects
    state: ShotState  # state after the contact

    @classmethod
    def of(
        cls, shot: ArrayLike, time: Array, struck: Target, state: ShotState, *hit: Array
    ) -> Pieces:
        """Return pieces that begin at a contact with one object.

        `hit` are the impact position [m] and the speed [m/s] on the bat, NaN by default.
        """
        place, speed = hit or (np.full(time.shape, np.nan),) * 2
        number = np.asarray(shot, dtype=np.int_)
        return cls(number, time, np.full(time.shape, struck), place, speed, state)

    @classmethod
    def concatenate(cls, parts: Sequence[Pieces]) -> Pieces:
        """Return all pieces, sorted by shot and time."""

        def whole(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in parts])

        names = ("shot", "time", "struck", "place", "speed")
        state = ShotState.concatenate([part.state for part in parts])
        unsorted = cls(**{name: whole(name) for name in names}, state=state)
        return unsorted.part(np.lexsort((unsorted.time, unsorted.shot)))

    def part(self, chosen: Any) -> Pieces:
        """Return the `chosen` pieces."""
        columns: Any = self[:-1]
        return Pieces._make([*(each[chosen] for each in columns), self.state.part(chosen)])


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedShots:
    """The motion of n shots as pieces of free motion.

    `refused` holds the reason why a shot could not be simulated, or an empty string. A rejected
    shot has no pieces.
    """

    refused: NDArray[np.str_]
    pieces: Pieces

    def first(self, struck: str) -> Pieces:
        """Return the piece after the first contact with this object, for each shot that has one."""
        rows = np.flatnonzero(self.pieces.struck == struck)
        return self.pieces.part(rows[np.unique(self.pieces.shot[rows], return_index=True)[1]])

    def at(self, scene: ShotScene, times: ArrayLike) -> ShotState:
        """Return the states at `times` (s,) [s] as arrays (n, s), NaN for rejected shots.

        At the time of a contact it is the state after the contact.
        """
        moments = np.atleast_1d(np.asarray(times, dtype=float))
        whole = np.full((len(ShotState._fields), scene.shots, len(moments)), np.nan)
        for column, moment in enumerate(moments):
            # Pieces are sorted by time, so the last piece that has begun overwrites the others.
            current = self.pieces.part(self.pieces.time <= moment)
            here = move(scene, current.state, moment - current.time, current.shot)
            whole[:, current.shot, column] = np.array(here)
        return ShotState(*whole)
