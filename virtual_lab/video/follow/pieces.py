"""Pieces of smooth motion, made of blobs.

Each further blob of a piece is at the position that constant acceleration predicts. A piece may
have no blob in some frames. Up to five frames between two of its positions may be missing from the
file although the time stamps are even. The time of the later position is then increased by the
number of missing frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.find.blobs import Blobs, free

Ints = NDArray[np.intp]
FAR_U = 4.0  # largest deviation by chance [standard uncertainties]


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceGrowth:
    """Thresholds for the blobs that make a piece."""

    gap_frames: int = 4  # largest number of frames in a row that need not show the ball
    lost_frames: int = 5  # largest number of successive frames that are missing from the file
    least_places: int = 5
    recent_places: int = 6  # number of positions from which the next one is predicted
    # largest distance of a position from its prediction, as a sum of ball radii and steps. If g is
    # not known, it is three times as large for the third position, which is predicted by a line,
    # and twice as large for the fourth.
    room: tuple[float, float] = (0.25, 0.12)
    size_ratio: float = 1.6  # largest ratio of the radii of one ball's blobs
    colour: float = 70.0  # largest difference in color between one ball's blobs [DN]
    # u of the brightness at an outline, which changes slowly along a flight with the direction of
    # view and with the background [DN]; found with 60 synthetic clips
    shade: float = 1.25
    # largest ratio of the rms misfit of a piece cut at a contact to that of the whole piece
    better: float = 0.5


GROWTH = PieceGrowth()


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A part of one ball's path."""

    blobs: Ints  # (position,), indices of the blobs
    frames: Ints
    t: Array  # (position,), time in frames, lost frames counted
    xy: Array  # (position, 2) [pixels]
    radius: float
    # whether the positions were located by the ball's outline, so that their u is known
    sharp: bool = False
    # (position,), u of x, and of y, from noise [pixels]; 1 if it is estimated from the scatter
    u: Array
    # u of x, and of y, from the pattern of the ball, or from shade and background if not `sharp`;
    # correlated in neighboring frames [pixels]
    pattern_u: float

    @classmethod
    def of(cls, moving: Blobs, blobs: Ints, t: Array) -> Piece:
        """Return the piece of the given blobs at times."""
        some = moving[blobs]
        return cls(
            blobs=blobs,
            frames=some["frame"].astype(np.intp),
            t=t,
            xy=np.stack([some["x"], some["y"]], axis=1),
            radius=float(np.median(some["radius"])),
            u=np.ones(len(some)),
            pattern_u=GROWTH.shade * float(np.median(some["edge"] / np.fmax(some["contrast"], 1))),
        )

    def part(self, which: NDArray[np.bool_] | slice) -> Piece:
        """Return the piece with only the positions `which`."""
        names = ("blobs", "frames", "t", "xy", "u")
        return replace(self, **{name: getattr(self, name)[which] for name in names})


def polynomial(t: Array, xy: Array, degree: int) -> tuple[Array, Array, float]:
    """Return coefficients, solution matrix and rms residual of a polynomial fit to positions `xy`.

    The coefficients, (power, 2), begin with power 0. They are the product of the solution matrix,
    (power, position), and `xy`, (position, 2). The rms residual is a single number in the unit of
    `xy`. The squares of both coordinates are averaged, with a divisor that is corrected for the
    degrees of freedom. `t`, (position,), are the times.
    """
    design, solver = _solver(t.tobytes(), degree)
    solved = solver @ xy
    left = xy - design @ solved
    return solved, solver, float(np.sqrt((left**2).sum() / max(1, 2 * (len(t) - degree - 1))))


@lru_cache(maxsize=4096)
def _solver(times: bytes, degree: int) -> tuple[Array, Array]:
    """Return the powers of times and their pseudo-inverse, cached because sets of times recur."""
    design = np.vander(np.frombuffer(times), degree + 1, increasing=True)
    return design, np.asarray(np.linalg.pinv(design), np.float64)


def pieces(blobs: Blobs, time: Array, pull: Array | None = None) -> list[Piece]:
    """Return the pieces of smooth motion that blobs form, in the order of time.

    A blob is a region of a picture that differs from the background. Pieces of fewer than five
    positions are left out.

    Parameters
    ----------
    blobs
        Blobs of all frames in order, an array of `find.blobs.BLOB`.
    time
        Time of each frame in frame intervals, (frame,). A frame with NaN, a repeat, is ignored.
    pull
        Acceleration common to all pieces, (2,) [pixels/frame²]; None if it is unknown.
    """
    whole = [p for p in _Growth(blobs, time, pull).all() if len(p.t) >= GROWTH.least_places]
    return sorted(whole, key=lambda each: each.frames[0])


class _Growth:
    def __init__(self, blobs: Blobs, time: Array, pull: Array | None) -> None:
        usable = free(blobs) & np.isfinite(time[blobs["frame"]])
        self.blobs, self.index, self.pull = blobs, np.flatnonzero(usable), pull
        some = blobs[usable]
        self.frame = some["frame"].astype(np.intp)
        self.xy = np.stack([some["x"], some["y"]], axis=1)
        self.radius, self.colour = some["radius"], some["colour"]
        self.time, self.used = time, np.zeros(len(some), bool)
        self.counted = np.flatnonzero(np.isfinite(time))
        self.first = np.searchsorted(self.frame, np.arange(len(time) + 1))

    def all(self) -> list[Piece]:
        result = []
        for start in range(len(self.frame)):
            if self.used[start]:
                continue
            grown = [self._grow(seed) for seed in self._seeds(start)]
            places, t = max(grown, key=lambda each: len(each[0]), default=([], []))
            if len(places) < GROWTH.least_places:
                continue
            piece = Piece.of(self.blobs, self.index[places], np.array(t))
            self.used[np.isin(self.index, piece.blobs)] = True
            result += _break_up(piece)
        return result

    def _like(self, one: int, frame: int) -> Ints:
        """Return the unused blobs of a frame with a size and color similar to blob `one`."""
        others = np.arange(self.first[frame], self.first[frame + 1])
        ratio = self.radius[others] / self.radius[one]
        near = ~self.used[others] & (ratio < GROWTH.size_ratio) & (ratio > 1 / GROWTH.size_ratio)
        near &= np.abs(self.colour[others] - self.colour[one]).max(axis=1) < GROWTH.colour
        return np.asarray(others[near])

    def _seeds(self, a: int) -> Iterator[list[int]]:
        """Yield triples of blob `a` and two blobs nearly on a line, from pairs of later frames."""
        here = np.searchsorted(self.counted, self.frame[a])
        for one, other in combinations(self.counted[here + 1 : here + 4].tolist(), 2):
            second, third = self._like(a, one), self._like(a, other)
            if not second.size or not third.size:
                continue
            t0, t1, t2 = self.time[[self.frame[a], one, other]]
            speed = (self.xy[second] - self.xy[a]) / (t1 - t0)
            expected = self.xy[second] + speed * (t2 - t1)
            if self.pull is not None:
                expected += self.pull * (t2 - t0) * (t2 - t1) / 2
            off = np.linalg.norm(self.xy[third] - expected[:, None], axis=2)
            room = self._room([a, a], np.hypot(*speed.T)) * (t2 - t1)
            m, n = np.unravel_index((off - room[:, None]).argmin(), off.shape)
            if off[m, n] < room[m]:
                yield [a, int(second[m]), int(third[n])]

    def _room(self, places: list[int], speed: Any) -> Any:
        """Return the largest distance of the next position from its prediction [pixels]."""
        wider = 1 if self.pull is not None else max(1, 5 - len(places))
        radius = median(self.radius[places[-GROWTH.recent_places :]].tolist())
        return wider * (GROWTH.room[0] * radius + GROWTH.room[1] * speed)

    def _grow(self, seed: list[int]) -> tuple[list[int], list[float]]:
        places, t = list(seed), self.time[self.frame[seed]].tolist()
        for frame in self.counted[np.searchsorted(self.counted, self.frame[seed[-1]]) + 1 :]:
            if frame - self.frame[places[-1]] > GROWTH.gap_frames + 1:
                break
            there = self._like(places[-1], frame)
            if there.size and (following := self._next(places, t, there)):
                places.append(following[0])
                t.append(following[1])
        if t[-1] - t[-2] > np.diff(self.time[self.frame[places[-2:]]])[0]:
            return places[:-1], t[:-1]  # one position alone is not evidence for missing frames
        return places, t

    def _next(self, places: list[int], t: list[float], there: Ints) -> tuple[int, float] | None:
        """Return the next blob of the motion, and its time. Frames before it may be missing."""
        recent, last = np.array(t[-GROWTH.recent_places :]), places[-1]
        xy = self.xy[places[-GROWTH.recent_places :]]
        s = recent - recent[-1]
        if self.pull is None:
            solved = polynomial(s, xy, 2)[0]
        else:
            fallen = s[:, None] ** 2 * self.pull / 2
            solved = np.vstack([polynomial(s, xy - fallen, 1)[0], self.pull / 2])
        speed = float(np.hypot(*(xy[-1] - xy[-2]))) / (recent[-1] - recent[-2])
        later = self.time[self.frame[there[0]]] - self.time[self.frame[last]]
        most = self._room(places, speed) * (1 + 0.5 * (later - 1))
        ahead = later + np.arange(GROWTH.lost_frames + 1.0)
        expected = np.vander(ahead, 3, increasing=True) @ solved
        off = np.linalg.norm(self.xy[there] - expected[:, None], axis=2)
        near = off.min(axis=1) < np.append(most, np.full(len(ahead) - 1, min(most, speed / 4)))
        if not near.any():
            return None
        lost = int(np.argmax(near))
        return int(there[off[lost].argmin()]), float(recent[-1] + ahead[lost])


def _break_up(piece: Piece) -> list[Piece]:
    """Return a piece cut at a contact, if two curves fit far better than one."""
    cuts = range(4, len(piece.t) - 3)
    left = [sum(_misfit(piece, part) for part in (slice(k), slice(k, None))) for k in cuts]
    if not left or min(left) > GROWTH.better**2 * _misfit(piece, slice(None)):
        return [piece]
    k = cuts[int(np.argmin(left))]
    return [*_break_up(piece.part(slice(k))), *_break_up(piece.part(slice(k, None)))]


def _misfit(piece: Piece, part: slice) -> float:
    """Return the sum of squared residuals of a parabola, or of a line for few positions."""
    t = piece.t[part]
    return len(t) * float(polynomial(t - t[0], piece.xy[part], 2 if len(t) > 4 else 1)[2] ** 2)
