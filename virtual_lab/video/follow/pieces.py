"""Blobs joined to pieces of smooth motion: each next one where constant acceleration expects it.

A piece may miss some frames, and between two of its places up to three frames may have been left
out of the file though its time stamps are even: the ball is then ahead by as many steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.find.blobs import Blobs

__all__ = ["Piece", "parabola", "pieces"]

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

GAP = 4  # frames in a row that need not show the ball
LOST = 3  # frames that may have been left out at one place
SURE = 4  # places before a step may be read as lost frames
STEP = 0.25  # radii of it, at least
EXACT = 0.1  # of it, that a place may be off if it is less than twice that
LEAST = 5  # places of a piece
TRAVEL = 1.0  # radii it covers
SHORT, STEADY = 0.5, 0.01  # radii, if it strays off a parabola by so little: no noise does
RECENT = 6  # places that show where the next one is
NEW = (0.9, 0.35)  # radii and steps that the third place may be off a line
SEEN = (0.4, 0.1)  # the same where gravity is known, off its parabola
NEXT = (0.25, 0.12)  # radii and steps that any later one may be off a parabola
FASTEST = 9.0  # radii a frame
SLOWEST = 0.01
SIZE = 1.6  # ratio of the radii of one ball's blobs
COLOUR = 70.0  # DN between its blobs
SEEDS = 4  # triples tried from a blob
DIRTY = 0.35  # of the ring: more is a hand, or the ball on something
BREAK = 0.22  # of the speed that it must change by for a contact
BREAK_PULL = 3.0  # of what gravity adds in a frame: less than that leaves no flight behind it
BENT = 0.1  # radii, rms off a parabola: no flight, or not all of it
BREAK_U = 6.0  # standard uncertainties, likewise
BETTER, CLEARLY = 0.5, 0.3  # share of the misfit, and radii it shrinks by: times are mended
STRAY, FEW = 0.15, 0.15  # radii off the others' parabola, of so small a share of the places
ENDS = 4.0  # scatters that the first or last place may be off the others' parabola


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A stretch of one ball's way."""

    blobs: Ints  # (place,) into the blobs
    frames: Ints
    t: Array  # (place,) time in steps of a frame, lost ones counted
    xy: Array  # (place, 2) [pixels]
    radius: float

    @classmethod
    def of(cls, found: Blobs, blobs: Ints, t: Array) -> Piece:
        """Return the piece of some blobs at times."""
        some = found[blobs]
        return cls(
            blobs=blobs,
            frames=some["frame"].astype(np.intp),
            t=t,
            xy=np.stack([some["x"], some["y"]], axis=1),
            radius=float(np.median(some["radius"])),
        )

    def part(self, which: NDArray[np.bool_] | slice) -> Piece:
        """Return some of the places."""
        return Piece(
            blobs=self.blobs[which],
            frames=self.frames[which],
            t=self.t[which],
            xy=self.xy[which],
            radius=self.radius,
        )


def parabola(t: Array, xy: Array) -> tuple[Array, Array, float]:
    """Return acceleration, its u (one number) and the rms residual of constant acceleration."""
    solved, solver, rms = _smooth(t - t.mean(), xy, 2)
    return 2 * solved[2], np.full(2, 2 * rms * np.linalg.norm(solver[2])), rms


def _smooth(t: Array, xy: Array, degree: int) -> tuple[Array, Array, float]:
    """Return a polynomial's coefficients, what takes places to them, and the rms residual."""
    design = np.vander(t, degree + 1, increasing=True)
    solver = np.asarray(np.linalg.pinv(design), np.float64)
    left = xy - design @ (solver @ xy)
    return solver @ xy, solver, float(np.sqrt((left**2).sum() / max(1, 2 * (len(t) - degree - 1))))


def pieces(found: Blobs, time: Array, pull: Array | None = None) -> list[Piece]:
    """Return the pieces of smooth motion among blobs, in order of time.

    Parameters
    ----------
    found
        Blobs of all frames in order, an array of `find.blobs.BLOB`.
    time
        Of each frame in steps of a frame, NaN: a repeat that does not count, (frame,).
    pull
        Acceleration that all share, (2,) [pixels/frame²], where it is known.
    """
    grown = _Growth(found, time, pull).all()
    if pull is not None:
        grown = [_retimed(each, time, pull) for each in grown]
    whole = [each for one in grown for each in _broken(one)]
    whole = [each for each in map(_trimmed, map(_cleaned, whole)) if len(each.t) >= LEAST]
    return sorted(whole, key=lambda each: each.frames[0])


class _Growth:
    def __init__(self, found: Blobs, time: Array, pull: Array | None) -> None:
        usable = (found["dirty"] < DIRTY) & ~found["cut"] & np.isfinite(time[found["frame"]])
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
            grown = [self._grown(seed) for seed in self._seeds(start)]
            best = max(grown, key=lambda each: len(each[0]), default=None)
            if best is None or len(best[0]) < LEAST:
                continue
            places, t = best
            way, radius = self.xy[places], float(np.median(self.radius[places]))
            travel = np.ptp(way, axis=0).max() / radius
            stray = parabola(np.array(t), way)[2] / radius
            if travel < TRAVEL and (travel < SHORT or stray > STEADY):
                continue
            self.used[places] = True
            found.append(Piece.of(self.found, self.index[places], np.array(t)))
        return found

    def _in(self, frame: int) -> Ints:
        there = np.arange(self.first[frame], self.first[frame + 1])
        return np.asarray(there[~self.used[there]])

    def _like(self, one: int, others: Ints, radius: float) -> Ints:
        ratio = self.radius[others] / radius
        near = (ratio < SIZE) & (ratio > 1 / SIZE)
        near &= np.abs(self.colour[others] - self.colour[one]).max(axis=1) < COLOUR
        return np.asarray(others[near])

    def _seeds(self, a: int) -> Iterator[tuple[int, int, int]]:
        """Yield the triples from a blob that are nearest to a line."""
        radius, here = float(self.radius[a]), self.place[int(self.frame[a])]
        tried: list[tuple[float, tuple[int, int, int]]] = []
        frames = [int(each) for each in self.counted[here + 1 : here + 4]]
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if j >= len(frames):
                continue
            second = self._like(a, self._in(frames[i]), radius)
            third = self._like(a, self._in(frames[j]), radius)
            if not second.size or not third.size:
                continue
            t0, t1, t2 = (self.time[k] for k in (self.frame[a], frames[i], frames[j]))
            speed = (self.xy[second] - self.xy[a]) / (t1 - t0)
            fast = np.hypot(*speed.T)
            good = (fast < FASTEST * radius) & (fast > SLOWEST * radius)
            expected = self.xy[second] + speed * (t2 - t1)
            if self.pull is not None:
                expected += self.pull * (t2 - t0) * (t2 - t1) / 2
            off = np.linalg.norm(self.xy[third][None] - expected[:, None], axis=2)
            room = NEW if self.pull is None else SEEN
            most = (room[0] * radius + room[1] * fast) * (t2 - t1)
            off[(off > most[:, None]) | ~good[:, None]] = np.inf
            for k in np.argsort(off, axis=None)[:SEEDS]:
                m, n = np.unravel_index(k, off.shape)
                if np.isfinite(off[m, n]):
                    tried.append((float(off[m, n]), (a, int(second[m]), int(third[n]))))
        tried.sort()
        return (each for _, each in tried[:SEEDS])

    def _grown(self, seed: tuple[int, int, int]) -> tuple[list[int], list[float]]:
        places, t = list(seed), [float(self.time[self.frame[k]]) for k in seed]
        ahead = 0.0  # lost so far
        k = self.place[int(self.frame[seed[-1]])] + 1
        radius = float(np.median(self.radius[places]))
        while k < len(self.counted) and self.counted[k] - self.frame[places[-1]] <= GAP + 1:
            frame = int(self.counted[k])
            there = self._like(places[-1], self._in(frame), radius)
            k += 1
            if not there.size:
                continue
            best = self._next(places, t, there, float(self.time[frame]) + ahead, radius)
            if best is None:
                continue
            which, lost = best
            ahead += lost
            places.append(which)
            t.append(float(self.time[frame]) + ahead)
            if len(places) % 4 == 0:
                radius = float(np.median(self.radius[places]))
        return places, t

    def _next(
        self, places: list[int], t: list[float], there: Ints, time: float, radius: float
    ) -> tuple[int, int] | None:
        recent = np.array(t[-RECENT:])
        xy = self.xy[places[-RECENT:]]
        s = recent - recent[-1]
        if self.pull is None:
            solved, *_ = _smooth(s, xy, 2)
        else:
            fallen = s[:, None] ** 2 * self.pull / 2
            solved = np.vstack([_smooth(s, xy - fallen, 1)[0], self.pull / 2])
        speed = float(np.hypot(*(xy[-1] - xy[-2]))) / (recent[-1] - recent[-2])
        room = NEXT if len(places) > 3 or self.pull is not None else (0.5, 0.2)
        later = time - recent[-1]
        most = (room[0] * radius + room[1] * speed) * (1 + 0.5 * (later - 1))
        stray = 0.7 * most if speed > 2 * STEP * radius else EXACT * speed
        sure = len(places) >= (SURE if self.pull is None else SURE - 1)
        for lost in range(LOST + 1 if sure and speed > STEP * radius else 1):
            ahead = later + lost
            expected = np.array([1.0, ahead, ahead**2]) @ solved
            off = np.hypot(*(self.xy[there] - expected).T)
            k = int(np.argmin(off))
            if off[k] < (most if lost == 0 else stray):
                return int(there[k]), lost
        return None


def _retimed(piece: Piece, time: Array, pull: Array) -> Piece:
    """Return a piece whose places have the times at which they lie on gravity's parabola best.

    Tried are frames left out before each place, and one place that came a step early or late.
    """
    count, even = len(piece.t), time[piece.frames]
    later = np.arange(count) >= np.arange(1, count)[:, None]
    moved = np.concatenate([later, np.eye(count, dtype=bool)])
    tried = [n * moved for n in range(-LOST, LOST + 1)]
    fast = np.hypot(*np.gradient(piece.xy, piece.t, axis=0).T) > STEP * piece.radius
    least, start = (CLEARLY * piece.radius) ** 2, np.stack([piece.t, even])
    before, plain = _off_parabola(start, piece.xy, pull).tolist()
    # frames are left out only where that explains clearly more
    t, cost = (even, plain) if plain < before + least else (piece.t, before)
    while True:
        steps = np.concatenate(tried)
        times = t + steps
        lost = np.diff(times - even, axis=1)
        good = (lost > -0.5).all(axis=1) & (lost < LOST + 0.5).all(axis=1)
        good &= ((steps != 0) & fast).any(axis=1)
        if not good.any():
            break
        costs = _off_parabola(times[good], piece.xy, pull)
        best = int(np.argmin(costs))
        if costs[best] > cost - least:
            break
        t, cost = times[good][best], float(costs[best])
    if cost > BETTER * min(plain, before):
        t = even if plain < before + least else piece.t
    return replace(piece, t=t)


def _off_parabola(t: Array, xy: Array, pull: Array) -> Array:
    """Return the squares off a parabola of known acceleration, summed, for times (try, place)."""
    t = t - t.mean(axis=1, keepdims=True)
    left = xy - pull * (t**2)[..., None] / 2
    left = left - left.mean(axis=1, keepdims=True)
    slope = np.einsum("tp,tpc->tc", t, left) / (t**2).sum(axis=1, keepdims=True)
    return np.asarray(((left - t[..., None] * slope[:, None]) ** 2).sum(axis=(1, 2)))


def _broken(piece: Piece) -> list[Piece]:
    """Return a piece cut where its velocity changes at once: a contact that growth went through."""
    count = len(piece.t)
    best: tuple[float, int] | None = None
    pull, _, whole = parabola(piece.t, piece.xy)
    least = BREAK_PULL * float(np.hypot(*pull))
    for k in range(4, count - 3):
        first, second = (_ending(piece.part(part)) for part in (slice(k), slice(k, count)))
        moment = (piece.t[k - 1] + piece.t[k]) / 2
        before, u_before, rms_before = first(moment)
        after, u_after, rms_after = second(moment)
        change = float(np.hypot(*(after - before)))
        fast = max(np.hypot(*before), np.hypot(*after))
        rms = float(np.sqrt((k * rms_before**2 + (count - k) * rms_after**2) / count))
        struck = change > max(BREAK * fast, BREAK_U * np.hypot(u_before, u_after), least)
        if not struck and whole < BENT * piece.radius:
            continue
        if rms < 0.5 * whole and (best is None or rms < best[0]):
            best = (rms, k)
    if best is None:
        return [piece]
    return [*_broken(piece.part(slice(best[1]))), *_broken(piece.part(slice(best[1], count)))]


def _ending(piece: Piece) -> Callable[[float], tuple[Array, float, float]]:
    """Return a function that shows velocity, its u and the rms at a moment."""
    degree = 2 if len(piece.t) > 4 else 1
    middle = piece.t.mean()
    solved, solver, rms = _smooth(piece.t - middle, piece.xy, degree)

    def at(moment: float) -> tuple[Array, float, float]:
        s = moment - middle
        slope = np.array([k * s ** (k - 1) if k else 0.0 for k in range(degree + 1)])
        return slope @ solved, rms * float(np.linalg.norm(slope @ solver)), rms

    return at


def _cleaned(piece: Piece) -> Piece:
    """Return a piece without single places that the others' parabola denies."""
    s = piece.t - piece.t.mean()
    off = np.hypot(*(piece.xy - np.vander(s, 3) @ np.polyfit(s, piece.xy, 2)).T)
    wild = off > max(ENDS * float(np.median(off)), STRAY * piece.radius)
    return piece.part(~wild) if wild.mean() < FEW else piece


def _trimmed(piece: Piece) -> Piece:
    """Return a piece without ends that its other places' parabola denies."""
    while len(piece.t) > LEAST:
        count = len(piece.t)
        off = []
        for end, rest in ((0, slice(1, None)), (count - 1, slice(count - 1))):
            others = piece.part(rest)
            s = others.t - piece.t[end]
            near = np.argsort(np.abs(s), kind="stable")[:8]
            degree = 2 if len(near) > 4 else 1
            solved, solver, rms = _smooth(s[near], others.xy[near], degree)
            own = max(rms, 0.02 * piece.radius) * np.hypot(1, np.linalg.norm(solver[0]))
            off.append(float(np.hypot(*(piece.xy[end] - solved[0]))) / own)
        worst = int(np.argmax(off))
        if off[worst] < ENDS:
            break
        piece = piece.part(slice(1, None) if worst == 0 else slice(count - 1))
    return piece
