"""Blobs joined to pieces of smooth motion: each next one where constant acceleration expects it.

A piece may miss some frames, and between two of its places up to three frames may have been left
out of the file though its time stamps are even: the ball is then ahead by as many steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.find.blobs import CLEAN, Blobs

Ints = NDArray[np.intp]
FAR_U = 4.0  # standard uncertainties: what lies farther off is no chance


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceGrowth:
    """Which blobs make a piece."""

    gap_frames: int = 4  # in a row that need not show the ball
    lost_frames: int = 3  # that may have been left out at one place
    least_places: int = 5
    travel: float = 0.25  # radii it covers: a low hop is a flight, too
    recent_places: int = 6  # that show where the next one is
    seeds: int = 4  # triples tried from a blob
    # radii and steps that a place may be off where the ones before it lead: where g is not known
    # three times that of the third, which is off a line, and twice that of the fourth
    room: tuple[float, float] = (0.25, 0.12)
    size_ratio: float = 1.6  # of the radii of one ball's blobs
    colour: float = 70.0  # DN between its blobs
    # of a piece that shows its own acceleration; asked of shorter ones too, a short flight in a
    # thinned clip is lost (test_frames_left_out_of_a_phone_s_file)
    shown_places: int = 8
    # of its misfit, that is left where a piece is given other times, or is cut at a contact
    better: float = 0.5
    turn_u: float = 6.0  # of the velocity's change at a cut: a shutter that rolls bends ways, too
    mended_radii: float = 0.3  # that the misfit shrinks by with each change of times


GROWTH = PieceGrowth()


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A stretch of one ball's way."""

    blobs: Ints  # (place,) into the blobs
    frames: Ints
    t: Array  # (place,) time in steps of a frame, lost ones counted
    xy: Array  # (place, 2) [pixels]
    radius: float
    u: Array | None = None  # (place,) of x and y each, from noise [pixels]; None: by their scatter
    pattern_u: float = 0.0  # the same from the ball's own pattern, alike in neighbouring frames

    @classmethod
    def of(cls, found: Blobs, blobs: Ints, t: Array) -> Piece:
        """Piece of some blobs at times."""
        some = found[blobs]
        return cls(
            blobs=blobs,
            frames=some["frame"].astype(np.intp),
            t=t,
            xy=np.stack([some["x"], some["y"]], axis=1),
            radius=float(np.median(some["radius"])),
        )

    def part(self, which: NDArray[np.bool_] | slice) -> Piece:
        """Piece of some of the places."""
        u = None if self.u is None else self.u[which]
        names = ("blobs", "frames", "t", "xy")
        return replace(self, u=u, **{name: getattr(self, name)[which] for name in names})


def parabola(t: Array, xy: Array) -> tuple[Array, float, float]:
    """Acceleration (2,), the u of each part, and the rms residual of a parabola."""
    solved, solver, rms = _polynomial(t - t.mean(), xy, 2)
    return 2 * solved[2], 2 * rms * float(np.linalg.norm(solver[2])), rms


def _polynomial(t: Array, xy: Array, degree: int) -> tuple[Array, Array, float]:
    """Polynomial's coefficients, what takes places to them, and the rms residual."""
    design, solver = _solver(t.tobytes(), degree)
    solved = solver @ xy
    left = xy - design @ solved
    return solved, solver, float(np.sqrt((left**2).sum() / max(1, 2 * (len(t) - degree - 1))))


@lru_cache(maxsize=4096)
def _solver(times: bytes, degree: int) -> tuple[Array, Array]:
    """Polynomial's powers at times and their inverse: growth meets few sets of times."""
    design = np.vander(np.frombuffer(times), degree + 1, increasing=True)
    return design, np.asarray(np.linalg.pinv(design), np.float64)


def pieces(found: Blobs, time: Array, pull: Array | None = None) -> list[Piece]:
    """Pieces of smooth motion among blobs, in order of time.

    Parameters
    ----------
    found
        Blobs of all frames in order, an array of `find.blobs.BLOB`.
    time
        Of each frame in steps of a frame, NaN: a repeat that does not count, (frame,).
    pull
        Acceleration that all share, (2,) [pixels/frame²], where it is known.
    """
    whole = [p for p in _Growth(found, time, pull).all() if len(p.t) >= GROWTH.least_places]
    return sorted(whole, key=lambda each: each.frames[0])


class _Growth:
    def __init__(self, found: Blobs, time: Array, pull: Array | None) -> None:
        usable = (found["dirty"] < CLEAN) & ~found["cut"]
        usable &= np.isfinite(time[found["frame"]])
        self.found, self.index, self.pull = found, np.flatnonzero(usable), pull
        some = found[usable]
        self.frame = some["frame"].astype(np.intp)
        self.xy = np.stack([some["x"], some["y"]], axis=1)
        self.radius, self.colour = some["radius"], some["colour"]
        self.time, self.used = time, np.zeros(len(some), bool)
        self.counted = np.flatnonzero(np.isfinite(time))
        self.first = np.searchsorted(self.frame, np.arange(len(time) + 1))
        self.place = {int(frame): k for k, frame in enumerate(self.counted)}

    def all(self) -> list[Piece]:
        found = []
        for start in range(len(self.frame)):
            if self.used[start]:
                continue
            grown = [self._grow(seed) for seed in self._seeds(start)]
            places, t = max(grown, key=lambda each: len(each[0]), default=([], []))
            if len(places) < GROWTH.least_places:
                continue
            piece = Piece.of(self.found, self.index[places], np.array(t))
            if np.ptp(piece.xy, axis=0).max() < GROWTH.travel * piece.radius:
                continue
            if self.pull is not None:
                piece = _retime(piece, self.time, self.pull)
            self.used[np.isin(self.index, piece.blobs)] = True
            found += _break_up(piece)
        return found

    def _like(self, one: int, frame: int, radius: float) -> Ints:
        """Unused blobs of a frame that look like one."""
        others = np.arange(self.first[frame], self.first[frame + 1])
        ratio = self.radius[others] / radius
        near = ~self.used[others] & (ratio < GROWTH.size_ratio) & (ratio > 1 / GROWTH.size_ratio)
        near &= np.abs(self.colour[others] - self.colour[one]).max(axis=1) < GROWTH.colour
        return np.asarray(others[near])

    def _seeds(self, a: int) -> list[tuple[int, int, int]]:
        """Triples from a blob that are nearest to a line."""
        radius, here = float(self.radius[a]), self.place[int(self.frame[a])]
        tried: list[tuple[float, tuple[int, int, int]]] = []
        for one, other in combinations(self.counted[here + 1 : here + 4].tolist(), 2):
            second, third = self._like(a, one, radius), self._like(a, other, radius)
            if not second.size or not third.size:
                continue
            t0, t1, t2 = (self.time[k] for k in (self.frame[a], one, other))
            speed = (self.xy[second] - self.xy[a]) / (t1 - t0)
            expected = self.xy[second] + speed * (t2 - t1)
            if self.pull is not None:
                expected += self.pull * (t2 - t0) * (t2 - t1) / 2
            off = np.linalg.norm(self.xy[third][None] - expected[:, None], axis=2)
            most = self._room(2, radius, np.hypot(*speed.T)) * (t2 - t1)
            off[off > most[:, None]] = np.inf
            for k in np.argsort(off, axis=None)[: GROWTH.seeds]:
                m, n = np.unravel_index(k, off.shape)
                if np.isfinite(off[m, n]):
                    tried.append((float(off[m, n]), (a, int(second[m]), int(third[n]))))
        return [each for _, each in sorted(tried)[: GROWTH.seeds]]

    def _room(self, places: int, radius: float, speed: Any) -> Any:
        """Distance that the next place may be off where so many lead [pixels]."""
        wider = 1 if self.pull is not None else max(1, 5 - places)
        return wider * (GROWTH.room[0] * radius + GROWTH.room[1] * speed)

    def _grow(self, seed: tuple[int, int, int]) -> tuple[list[int], list[float]]:
        places, t = list(seed), [float(self.time[self.frame[k]]) for k in seed]
        ahead = 0.0  # lost so far
        radius = median(self.radius[places].tolist())
        for frame in self.counted[self.place[int(self.frame[seed[-1]])] + 1 :].tolist():
            if frame - self.frame[places[-1]] > GROWTH.gap_frames + 1:
                break
            there = self._like(places[-1], frame, radius)
            time = float(self.time[frame]) + ahead
            following = self._next(places, t, there, time, radius) if there.size else None
            if following is None:
                continue
            which, lost = following
            ahead += lost
            places.append(which)
            t.append(time + lost)
            if len(places) % 4 == 0:
                radius = median(self.radius[places].tolist())
        return places, t

    def _next(
        self, places: list[int], t: list[float], there: Ints, time: float, radius: float
    ) -> tuple[int, int] | None:
        """Blob that goes on, and how many frames were left out before it."""
        recent = np.array(t[-GROWTH.recent_places :])
        xy = self.xy[places[-GROWTH.recent_places :]]
        s = recent - recent[-1]
        if self.pull is None:
            solved = _polynomial(s, xy, 2)[0]
        else:
            fallen = s[:, None] ** 2 * self.pull / 2
            solved = np.vstack([_polynomial(s, xy - fallen, 1)[0], self.pull / 2])
        speed = float(np.hypot(*(xy[-1] - xy[-2]))) / (recent[-1] - recent[-2])
        later = time - recent[-1]
        most = self._room(len(places), radius, speed) * (1 + 0.5 * (later - 1))
        for lost in range(GROWTH.lost_frames + 1):
            ahead = later + lost
            expected = np.array([1.0, ahead, ahead**2]) @ solved
            off = np.hypot(*(self.xy[there] - expected).T)
            k = int(np.argmin(off))
            if off[k] < (min(most, speed / 4) if lost else most):
                return int(there[k]), lost
        return None


def _retime(piece: Piece, time: Array, pull: Array) -> Piece:
    """Piece whose places have the times at which they lie on gravity's parabola best.

    Tried are frames left out before each place, and one place that came a step early or late.
    """
    count, even = len(piece.t), time[piece.frames]
    later = np.arange(count) >= np.arange(1, count)[:, None]
    moved = np.concatenate([later, np.eye(count, dtype=bool)])
    lost = np.arange(-GROWTH.lost_frames, GROWTH.lost_frames + 1)
    steps = (lost[:, None, None] * moved).reshape(-1, count)
    steps = steps[steps.any(axis=1)]
    least = (GROWTH.mended_radii * piece.radius) ** 2
    before, plain = _off_parabola(np.stack([piece.t, even]), piece.xy, pull).tolist()
    # frames are left out only where that explains clearly more
    start = (even, plain) if plain < before + least else (piece.t, before)
    t, cost = start
    while True:
        times = t + steps
        lost = np.diff(times - even, axis=1)
        good = ((lost > -0.5) & (lost < GROWTH.lost_frames + 0.5)).all(axis=1)
        if not good.any():
            break
        costs = _off_parabola(times[good], piece.xy, pull)
        best = int(np.argmin(costs))
        if costs[best] > cost - least:
            break
        t, cost = times[good][best], float(costs[best])
    # another acceleration, as in a hand, may explain it too
    if count >= GROWTH.shown_places:
        free = min(parabola(each, piece.xy)[2] for each in (piece.t, even))
        plain = min(plain, 2 * (count - 2) * free**2)
    mended = cost <= GROWTH.better * min(plain, before)
    return replace(piece, t=t if mended else start[0])


def _off_parabola(t: Array, xy: Array, pull: Array) -> Array:
    """Squares off a parabola of known acceleration, summed, for times (try, place)."""
    t = t - t.mean(axis=1, keepdims=True)
    left = xy - pull * (t**2)[..., None] / 2
    left = left - left.mean(axis=1, keepdims=True)
    slope = np.einsum("tp,tpc->tc", t, left) / (t**2).sum(axis=1, keepdims=True)
    return np.asarray(((left - t[..., None] * slope[:, None]) ** 2).sum(axis=(1, 2)))


def _break_up(piece: Piece) -> list[Piece]:
    """Piece cut where its velocity changes at once: a contact that growth went through."""
    count, cut = len(piece.t), 0
    least = GROWTH.better * parabola(piece.t, piece.xy)[2]
    for k in range(4, count - 3):
        moment = (piece.t[k - 1] + piece.t[k]) / 2
        before, u_before, rms_before = _velocity(piece.part(slice(k)), moment)
        after, u_after, rms_after = _velocity(piece.part(slice(k, count)), moment)
        turn = GROWTH.turn_u * np.hypot(u_before, u_after)
        rms = float(np.sqrt((k * rms_before**2 + (count - k) * rms_after**2) / count))
        if np.hypot(*(after - before)) > turn and rms < least:
            least, cut = rms, k
    if not cut:
        return [piece]
    return [*_break_up(piece.part(slice(cut))), *_break_up(piece.part(slice(cut, count)))]


def _velocity(piece: Piece, moment: float) -> tuple[Array, float, float]:
    """Velocity at a moment, its u and the rms residual."""
    solved, solver, rms = _polynomial(piece.t - moment, piece.xy, 2 if len(piece.t) > 4 else 1)
    return solved[1], rms * float(np.linalg.norm(solver[1])), rms
