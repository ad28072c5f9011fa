"""The whole way of ball and bat: pieces of free motion from one contact to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.relations.flight import time_after
from virtual_lab.simulation.motion.scene import Scene, State
from virtual_lab.simulation.motion.touch import moved

__all__ = ["PlaneCrossings", "Track"]

Array = NDArray[np.float64]


class PlaneCrossings(NamedTuple):
    """Balls' centres going through planes across the line of fire, a row each (k,)."""

    shot: NDArray[np.int_]
    plane: NDArray[np.int_]  # which of those asked for
    time: Array  # [s]
    state: State  # of the passage


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """Pieces of free motion (k,) by shot and time; a refused shot has none.

    All between contacts is exact, so a track tells everything of its scene at any time.
    """

    shot: NDArray[np.int_]
    begins: Array  # [s]
    ends: Array
    state: State  # at the beginning

    @classmethod
    def of(cls, scene: Scene, rows: Sequence[tuple[NDArray[np.int_], Array, State]]) -> Self:
        """Return the track of pieces given as shots, times they begin, and states."""
        shot = np.concatenate([row[0] for row in rows])
        begins = np.concatenate([row[1] for row in rows])
        order = np.lexsort((np.arange(len(shot)), begins, shot))
        shot, begins = shot[order], begins[order]
        ends = np.full(len(shot), scene.duration)
        same = np.flatnonzero(shot[1:] == shot[:-1])
        ends[same] = begins[same + 1]
        names = State.__slots__
        columns = {n: np.concatenate([getattr(row[2], n) for row in rows])[order] for n in names}
        return cls(shot=shot, begins=begins, ends=ends, state=State(**columns))

    def rows(self, shots: NDArray[np.int_] | None = None) -> tuple[NDArray[np.int_], Array, State]:
        """Return the pieces as `of` takes them, shot i named `shots[i]`."""
        return self.shot if shots is None else shots[self.shot], self.begins, self.state

    def part(self, chosen: NDArray[np.bool_]) -> Self:
        """Return some of the pieces."""
        return type(self)(
            shot=self.shot[chosen],
            begins=self.begins[chosen],
            ends=self.ends[chosen],
            state=self.state.part(chosen),
        )

    def at(self, scene: Scene, times: ArrayLike) -> State:
        """Return the states at times [s], (s,): arrays (n, s), NaN of refused shots.

        At a contact it is the state after it.
        """
        moments = np.atleast_1d(np.asarray(times, dtype=float))
        whole = np.full((len(State.__slots__), len(scene), len(moments)), np.nan)
        for column, moment in enumerate(moments):
            # pieces stand in the order of time, so that the last one begun is what stays
            begun = np.flatnonzero((self.begins <= moment) & (moment <= self.ends))
            shots = self.shot[begun]
            here = moved(scene, self.state.part(begun), moment - self.begins[begun], shots)
            whole[:, shots, column] = [getattr(here, name) for name in State.__slots__]
        return State(**dict(zip(State.__slots__, whole, strict=True)))

    def passages(self, scene: Scene, planes: ArrayLike) -> PlaneCrossings:
        """Return when balls' centres go through the planes x = `planes` [m], (p,), either way.

        A gate that times the edge of a ball has its plane a radius before or behind.
        """
        found = []
        for index, plane in enumerate(np.atleast_1d(planes)):
            state = self.state
            speed = np.hypot(state.vx, state.vz)
            with np.errstate(divide="ignore", invalid="ignore"):
                way = (plane - state.x) / state.vx * speed
            goes = np.flatnonzero((way > 0) & np.isfinite(way))
            after = time_after(way[goes], speed[goes], scene.balls.drag[self.shot[goes]])
            time = self.begins[goes] + after
            within = time <= self.ends[goes]
            goes, time = goes[within], time[within]
            here = moved(scene, state.part(goes), time - self.begins[goes], self.shot[goes])
            found.append((self.shot[goes], np.full(len(goes), index), time, here))
        shot, number, time = (np.concatenate([row[i] for row in found]) for i in range(3))
        order = np.lexsort((number, time, shot))
        names = State.__slots__
        columns = {n: np.concatenate([getattr(row[3], n) for row in found])[order] for n in names}
        return PlaneCrossings(shot[order], number[order], time[order], State(**columns))
