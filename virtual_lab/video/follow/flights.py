"""Pieces to flights and contacts: which share one gravity, which places belong, where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.follow.joint import Fit, Way, fit_flights
from virtual_lab.video.follow.pieces import Piece, parabola

__all__ = ["FEWEST", "Meeting", "Scene", "flights_of", "joined", "meetings"]

Array = NDArray[np.float64]

FEWEST = 6  # places of a flight
SIDE = 4  # places on each side of a contact, to tell a restitution
ALIKE = 0.25  # of the acceleration that flights may differ by before drag and tilt are known
UPRIGHT = 0.5  # radians that g may be off the picture's downward direction
SAG = 1.0  # radii that gravity must bend a way by, for its direction to be asked for
SIZE = 1.35  # ratio of the radii of one ball's flights
MISSED = 4  # frames in a row at which a flight ends
NEAR = (0.2, 5.0)  # radii, and standard deviations, that a place may be off its flight
HELD = 0.75  # of the ring: a place on a flight may have this much beside it
BETWEEN = 6.0  # frames between two flights that a contact joins
ROUNDS = 4
APART = 0.6  # radii that two flights may miss each other by at a contact
SMOOTH = 0.12  # radii, rms: a flight's places lie on its way


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What is known of a clip, in pixels and frames."""

    found: NDArray  # blobs
    time: Array  # of each frame [frames], NaN: a repeat
    size: tuple[int, int]  # columns, rows
    exposure: float | None  # [frames]
    expected: float | None  # g [px/frame²], where scale and rate are known
    readout: float = 0.0  # [frames] along `rows`
    readout_axis: tuple[int, int] = (1, 1)  # axis of the picture (0: x), and its sense

    def way(self, piece: Piece) -> Way:
        """Return a piece's places as the joint fit takes them."""
        return Way(t=piece.t, xy=piece.xy, late=self.late(piece.blobs))

    def late(self, blobs: NDArray[np.intp]) -> Array:
        """Return the share of the readout at which blobs were read."""
        axis, sense = self.readout_axis
        at = self.found["picture_x" if axis == 0 else "picture_y"][blobs]
        share = np.clip(at / (self.size[axis] - 1), 0, 1)
        return np.asarray(share if sense > 0 else 1 - share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """Two flights meet: a contact."""

    first: int  # number of the flight in
    t: float  # [frames]
    apart: float  # pixels that they miss each other by
    place: Array  # (2,)
    before: Array  # (2,) velocities [px/frame]
    after: Array


def flights_of(scene: Scene, pieces: Sequence[Piece]) -> list[Piece]:
    """Return the flights among pieces: of one ball, of one gravity; empty where there is none."""
    chosen = _of_one_gravity(scene, [each for each in pieces if len(each.t) >= FEWEST - 1])
    flights = sorted(chosen, key=lambda each: each.t[0])
    for _ in range(ROUNDS):
        if not flights:
            return []
        flights = _once(flights)
        fit = joined(scene, flights)
        flights = _merged(scene, flights, fit)
        fit = joined(scene, flights)
        before = [each.frames.tolist() for each in flights]
        flights = _refilled(scene, flights, fit)
        flights = _parted(scene, flights)
        flights = [each for each in flights if len(each.t) >= SIDE]
        if [each.frames.tolist() for each in flights] == before:
            break
    return [each for each in flights if len(each.t) >= FEWEST]


def joined(scene: Scene, flights: Sequence[Piece], **ways: bool | float) -> Fit:
    """Return the joint fit of flights; ways as `fit_flights` takes them."""
    radius = float(np.median([each.radius for each in flights]))
    given = {"readout": scene.readout} | ways
    return fit_flights([scene.way(each) for each in flights], radius, scene.size, **given)  # type: ignore[arg-type]


def meetings(flights: Sequence[Piece], fit: Fit) -> list[Meeting]:
    """Return where neighbouring flights meet."""
    found = []
    for k in range(len(flights) - 1):
        one, other = flights[k], flights[k + 1]
        start, end = one.t[-1], other.t[0]
        if end - start > BETWEEN:
            continue
        t = np.linspace(start - 1, end + 1, 401)
        before, after = fit.at(k, t), fit.at(k + 1, t)
        apart = np.hypot(*(before - after)[:, :2].T)
        best = int(np.argmin(apart))
        room = APART * one.radius + 0.5 * float(np.hypot(*(after - before)[best, 2:]))
        if apart[best] > room or not 0 < best < 400:
            continue
        found.append(
            Meeting(
                first=k,
                t=float(t[best]),
                apart=float(apart[best]),
                place=(before[best, :2] + after[best, :2]) / 2,
                before=before[best, 2:],
                after=after[best, 2:],
            )
        )
    return found


def _of_one_gravity(scene: Scene, pieces: list[Piece]) -> list[Piece]:
    """Return the pieces that share the acceleration with the most places behind it."""
    told = [(each, *parabola(each.t, each.xy)) for each in pieces]
    told = [each for each in told if each[3] < SMOOTH * each[0].radius]
    best: tuple[float, list[Piece]] = (0.0, [])
    for piece, pull, u, _ in told:
        if len(piece.t) < FEWEST or not _falls(scene, piece, pull, u):
            continue
        like = []
        for other, own, own_u, _ in told:
            room = max(3 * float(np.hypot(u[0], own_u[0])), ALIKE * float(np.hypot(*pull)))
            small = max(other.radius, piece.radius) / min(other.radius, piece.radius) < SIZE
            colour = np.abs(_colour(scene, other) - _colour(scene, piece)).max() < 60
            if np.hypot(*(own - pull)) < room and small and colour:
                like.append(other)
        # many short pieces of a hand's way agree by chance; long ones do not
        support = float(sum((len(each.t) - 3) ** 1.5 for each in like))
        if support > best[0]:
            best = (support, like)
    return best[1]


def _falls(scene: Scene, piece: Piece, pull: Array, u: Array) -> bool:
    """Return whether an acceleration may be gravity's, as far as scale and direction tell."""
    size, span = float(np.hypot(*pull)), float(np.ptp(piece.t))
    bent = size * span**2 / 8
    expected = scene.expected
    if expected is not None and expected * span**2 / 8 > 2 * SAG * piece.radius:
        # gravity would show: is it there, or does a wrong frame rate make it look larger or less?
        ratio = size / expected
        down = float(np.arctan2(abs(pull[0]), pull[1]))
        if 0.5 < ratio < 2.0:
            return down < UPRIGHT
        long = len(piece.t) >= 2 * FEWEST and size > 8 * u[0]
        return long and down < UPRIGHT and bent > SAG * piece.radius and ratio > 1e-3
    if bent < SAG * piece.radius:
        return True
    return float(np.arctan2(abs(pull[0]), pull[1])) < UPRIGHT


def _colour(scene: Scene, piece: Piece) -> Array:
    return np.asarray(np.median(scene.found["colour"][piece.blobs], axis=0))


def _once(flights: list[Piece]) -> list[Piece]:
    """Return flights that do not share frames: of two at a time the longer stays."""
    kept: list[Piece] = []
    for piece in sorted(flights, key=lambda each: -len(each.t)):
        first, last = piece.frames[0], piece.frames[-1]
        shared = [f for f in kept if f.frames[0] <= last and first <= f.frames[-1]]
        if shared:
            taken = np.zeros(len(piece.t), bool)
            for other in shared:
                taken |= (piece.frames >= other.frames[0]) & (piece.frames <= other.frames[-1])
            piece = piece.part(~taken)
            if len(piece.t) < SIDE or np.diff(piece.frames).max() > MISSED + 2:
                continue
        kept.append(piece)
    return sorted(kept, key=lambda each: each.frames[0])


def _merged(scene: Scene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return flights, neighbours that one parabola explains made one; lost frames are tried."""
    merged = [flights[0]]
    pull = fit.pull[0]
    for piece in flights[1:]:
        last = merged[-1]
        best: tuple[float, Piece] | None = None
        if piece.t[0] - last.t[-1] <= 3 * BETWEEN:
            # a piece that began its count anew may lie up to three frames ahead
            for lost in range(4):
                whole = Piece(
                    blobs=np.concatenate([last.blobs, piece.blobs]),
                    frames=np.concatenate([last.frames, piece.frames]),
                    t=np.concatenate([last.t, piece.t + lost]),
                    xy=np.concatenate([last.xy, piece.xy]),
                    radius=(last.radius + piece.radius) / 2,
                )
                rms = _rms(whole, pull)
                if best is None or rms < 0.5 * best[0]:
                    best = (rms, whole)
        apart = max(_rms(last, pull), _rms(piece, pull), fit.spread)
        if best is not None and best[0] < min(2.0 * apart, 0.5 * SMOOTH * last.radius):
            merged[-1] = best[1]
        else:
            merged.append(piece)
    return merged


def _rms(piece: Piece, pull: Array) -> float:
    s = piece.t - piece.t.mean()
    level = piece.xy - 0.5 * np.outer(s**2, pull)
    return parabola(piece.t, level, 1)[2]


def _refilled(scene: Scene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return flights with every place that lies on their way, and none that does not."""
    counted = np.flatnonzero(np.isfinite(scene.time))
    refilled = []
    frames = scene.found["frame"]
    for k, piece in enumerate(flights):
        before = flights[k - 1].frames[-1] if k else -1
        after = flights[k + 1].frames[0] if k + 1 < len(flights) else len(scene.time)
        ahead = dict(zip(piece.frames.tolist(), (piece.t - scene.time[piece.frames]).tolist(), strict=True))
        places: list[tuple[int, int, float]] = []
        middle = int(np.searchsorted(counted, piece.frames[len(piece.frames) // 2]))
        for order in (counted[middle:], counted[:middle][::-1]):
            missed, shift = 0, ahead[int(piece.frames[len(piece.frames) // 2])]
            for frame in order.tolist():
                if not before < frame < after or missed > MISSED:
                    break
                shift = ahead.get(frame, shift)
                t = float(scene.time[frame]) + shift
                one = _nearest(scene, piece, fit, k, frame, t, frames)
                if one is None:
                    missed += 1
                    continue
                missed = 0
                places.append((frame, one, t))
        if len(places) < SIDE:
            continue
        places.sort()
        blobs = np.array([one for _, one, _ in places])
        some = scene.found[blobs]
        refilled.append(
            Piece(
                blobs=blobs,
                frames=np.array([frame for frame, _, _ in places]),
                t=np.array([t for _, _, t in places]),
                xy=np.stack([some["x"], some["y"]], axis=1),
                radius=float(np.median(some["radius"])),
            )
        )
    return refilled


def _nearest(
    scene: Scene, piece: Piece, fit: Fit, k: int, frame: int, t: float, frames: Array
) -> int | None:
    """Return the blob on a flight's way in a frame, None without."""
    first, last = np.searchsorted(frames, [frame, frame + 1])
    there = np.arange(first, last)
    some = scene.found[there]
    ratio = some["radius"] / piece.radius
    good = (some["dirty"] < HELD) & ~some["cut"] & (ratio > 0.6) & (ratio < 1.6)
    there, some = there[good], some[good]
    if not there.size:
        return None
    late = t + fit.readout * scene.late(there)
    expected = fit.seen(k, late)
    off = np.hypot(some["x"] - expected[:, 0], some["y"] - expected[:, 1])
    best = int(np.argmin(off))
    beyond = max(0.0, float(piece.t[0] - t), float(t - piece.t[-1]))
    room = max(NEAR[0] * piece.radius, NEAR[1] * fit.spread) * (1 + 0.3 * beyond)
    return int(there[best]) if off[best] < min(room, 0.5 * piece.radius) else None


def _parted(scene: Scene, flights: list[Piece]) -> list[Piece]:
    """Return flights without places whose exposure spans a contact."""
    if len(flights) < 2:
        return flights
    fit = joined(scene, flights)
    half = (1.0 if scene.exposure is None else scene.exposure) / 2
    kept = list(flights)
    for each in meetings(flights, fit):
        before, after = kept[each.first], kept[each.first + 1]
        kept[each.first] = before.part(before.t < each.t - half)
        kept[each.first + 1] = after.part(after.t > each.t + half)
    return [replace(each) for each in kept if len(each.t)]
