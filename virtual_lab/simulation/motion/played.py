"""What came of the shots of a scene: pieces of free motion from one contact to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.simulation.motion.scene import ShotScene, ShotState
from virtual_lab.simulation.motion.touch import moved
from virtual_lab.units import Array


class Target(StrEnum):
    """What the ball, or the bat at its stop, has struck."""

    START = ""  # nothing: the shot begins
    BAT = "bat"
    BAT_AGAIN = "bat again"
    STOP = "stop"
    FRAME = "frame"


class Pieces(NamedTuple):
    """Pieces of free motion, a row each (k,): all between contacts is exact."""

    shot: NDArray[np.int_]
    time: Array  # it begins [s]
    struck: NDArray[np.str_]  # what then was struck
    place: Array  # of the bat, from its tip [m]; NaN of anything else
    speed: Array  # of approach to the bat, normal [m/s]; NaN of anything else
    state: ShotState  # after the contact

    @classmethod
    def of(
        cls, shot: ArrayLike, time: Array, struck: Target, state: ShotState, *hit: Array
    ) -> Pieces:
        """Return pieces that begin alike; `hit` are place and speed on the bat."""
        place, speed = hit or (np.full(time.shape, np.nan),) * 2
        number = np.asarray(shot, dtype=np.int_)
        return cls(number, time, np.full(time.shape, struck), place, speed, state)

    @classmethod
    def joined(cls, parts: Sequence[Pieces]) -> Pieces:
        """Return all pieces in the order of shot and time."""

        def whole(name: str) -> Any:
            return np.concatenate([getattr(part, name) for part in parts])

        names = ("shot", "time", "struck", "place", "speed")
        state = ShotState.joined([part.state for part in parts])
        unsorted = cls(**{name: whole(name) for name in names}, state=state)
        return unsorted.part(np.lexsort((unsorted.time, unsorted.shot)))

    def part(self, chosen: Any) -> Pieces:
        """Return some of the pieces."""
        columns: Any = self[:-1]
        return Pieces._make([*(each[chosen] for each in columns), self.state.part(chosen)])


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedShots:
    """Of n shots the pieces; a refused shot has none.

    `refused` is the sentence that says why a shot could not be played, empty where it could.
    """

    refused: NDArray[np.str_]
    pieces: Pieces

    def first(self, struck: str) -> Pieces:
        """Return, of every shot that strikes this thing, the piece that first begins so."""
        own = np.flatnonzero(self.pieces.struck == struck)
        return self.pieces.part(own[np.unique(self.pieces.shot[own], return_index=True)[1]])

    def at(self, scene: ShotScene, times: ArrayLike) -> ShotState:
        """Return the states at times [s], (s,): arrays (n, s), NaN of refused shots.

        At a contact it is the state after it.
        """
        moments = np.atleast_1d(np.asarray(times, dtype=float))
        whole = np.full((len(ShotState._fields), scene.shots, len(moments)), np.nan)
        for column, moment in enumerate(moments):
            # pieces stand in the order of time, so that the last one begun is what stays
            begun = self.pieces.part(self.pieces.time <= moment)
            here = moved(scene, begun.state, moment - begun.time, begun.shot)
            whole[:, begun.shot, column] = np.array(here)
        return ShotState(*whole)
