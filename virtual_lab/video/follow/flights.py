"""Pieces to flights and contacts: which share one gravity, which places belong, where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.follow.joint import DRAG, DRAG_U, Fit, Way, fit_flights
from virtual_lab.video.follow.pieces import DIRTY, Piece, parabola

__all__ = [
    "FEWEST",
    "SIDE",
    "FlightScene",
    "Meeting",
    "beside",
    "flights_of",
    "joint_fit",
    "meetings",
    "readout_of",
]

Array = NDArray[np.float64]

FEWEST = 6  # places of a flight
SIDE = 4  # places on each side of a contact, to state a restitution
ALIKE = 0.25  # of the acceleration that flights may differ by before drag and tilt are known
UNSURE = 0.5  # of it: a piece that may differ by more shows none
BENDS = 0.05  # radii by which a flight may bend otherwise: few places scatter little by chance
UPRIGHT = 0.5  # radians that g may be off the picture's downward direction
SAG = 1.0  # radii that gravity must bend a way by, for its direction to be asked for
SHOWS = 0.3  # the same, for gravity to be missed where there is none
SIZE = 1.35  # ratio of the radii of one ball's flights
MISSED = 4  # frames in a row at which a flight ends
NEAR = (0.2, 5.0)  # radii, and standard deviations, that a place may be off its flight
END = (0.1, 4.0)  # the same beyond the places that a piece had
HELD = 0.75  # of the ring: a place on a flight may have this much beside it
BETWEEN = 6.0  # frames between two flights that a contact joins
FAR_OFF = 1000  # frames: no flight before or after
FAR = 4.0  # radii that a second ball goes
HALF = 0.5  # of the ball's contrast: what has less is its shadow or mirror image
ROUNDS = 4
ASIDE = 0.45  # radii, median (the worst: twice that), off another flight's way: they are one
APART = 0.6  # radii that two flights may miss each other by at a contact
SMOOTH = (0.12, 0.7)  # radii, or pixels of a small ball, rms: a flight's places lie on its way
SHARP = 0.04  # radii, likewise, where the acceleration is far from g; or, of a way that bends by
CLEAN, DEEP = 0.015, 3.0  # so many radii, a share of its sag: no hand draws such a parabola
CODED = 0.4  # pixels, that a codec leaves of that with a small ball
READOUTS = (0.0, 0.25, 0.5, 0.75, 1.0)  # frames, tried
GOOD = 0.015  # radii: a spread that no other readout need mend
SURELY, LOOSELY = 4.0, 1.5  # factors of the misfit: to say so, and to decide which places belong


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightScene:
    """What is known of a clip, in pixels and frames."""

    found: Blobs  # blobs
    time: Array  # of each frame [frames], NaN: a repeat
    stamped: Array  # the same by the time stamps, repeats counted
    size: tuple[int, int]  # columns, rows
    exposure: float | None  # [frames]
    fall: float | None = None  # g, in radii a frame² by the ball's size or in px/frame²
    fall_in_radii: bool = True
    readout: float | None = 0.0  # [frames]; None: unknown, up to one
    doubled: bool = False  # every frame is stored twice
    readout_axis: tuple[int, int] = (1, 1)  # axis of the picture (0: x), and its sense

    def expected(self, radius: float) -> float | None:
        """Return g [px/frame²] where scale and rate are known, for a ball of a radius [pixels]."""
        if self.fall is None:
            return None
        return self.fall * radius if self.fall_in_radii else self.fall

    def lost(self, ways: Sequence[Piece]) -> dict[int, int]:
        """Return how many frames were left out before some frames of flights."""
        found: dict[int, int] = {}
        for way in ways:
            more = np.diff(way.t) - np.diff(self.time[way.frames])
            found |= {int(way.frames[k + 1]): round(more[k]) for k in np.flatnonzero(more > 0.5)}
        for one, other in pairwise(ways):
            if (between := self.ahead(one, other)) > 0.5:
                found[int(other.frames[0])] = round(between)
        return found

    def ahead(self, one: Piece, other: Piece) -> float:
        """Return how many frames were left out between two flights."""
        passed = self.time[other.frames[0]] - self.time[one.frames[-1]]
        return float(other.t[0] - one.t[-1] - passed)

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


def flights_of(scene: FlightScene, pieces: Sequence[Piece]) -> tuple[list[Piece], Fit | None]:
    """Return the flights among pieces, of one ball and one gravity, and their fit; or none."""
    chosen = _of_one_gravity(scene, [each for each in pieces if len(each.t) >= FEWEST - 1])
    flights = _once(chosen)
    if not flights:
        return [], None
    readout = readout_of(scene, flights, LOOSELY)
    for _ in range(ROUNDS):
        flights = _merged(scene, flights, joint_fit(scene, flights, readout=readout))
        fit = joint_fit(scene, flights, readout=readout)
        flights = _aligned(scene, flights, fit)
        before = [each.frames.tolist() for each in flights]
        flights = _refilled(scene, flights, joint_fit(scene, flights, readout=readout))
        flights = _parted(scene, flights)
        flights = [each for each in flights if len(each.t) >= SIDE]
        if not flights or [each.frames.tolist() for each in flights] == before:
            break
    flights = [each for each in flights if len(each.t) >= FEWEST]
    while flights:
        fit = joint_fit(scene, flights, readout=readout_of(scene, flights, LOOSELY))
        if _holds(scene, flights, fit):
            return flights, fit
        flights.pop(int(np.argmax([(left**2).mean() for left in fit.residuals])))
    return [], None


def _holds(scene: FlightScene, flights: Sequence[Piece], fit: Fit) -> bool:
    """Return whether flights fitted together still fall as gravity lets them."""
    longest = max(flights, key=lambda each: len(each.t))
    u = np.sqrt(np.diagonal(fit.covariance)[:2])
    rms = fit.spread if len(flights) > 1 else SHARP / SMOOTH[0] * fit.spread
    return _smooth(fit.spread, longest) and _falls(scene, longest, fit.pull[0], u, rms)


def beside(scene: FlightScene, flights: Sequence[Piece], pieces: Sequence[Piece]) -> list[Piece]:
    """Return pieces that fly as a second ball does, beside the flights and at the same time."""
    found = []
    taken = {int(one) for each in flights for one in each.blobs}
    bright = min(float(np.median(scene.found["contrast"][each.blobs])) for each in flights)
    for piece in pieces:
        pull, u, rms = _bent(scene, piece)
        bent = float(np.hypot(*pull)) * np.ptp(piece.t) ** 2 / 8
        if len(piece.t) < FEWEST + 2 or rms > max(SHARP * piece.radius, CODED, CLEAN * bent):
            continue
        if taken & set(piece.blobs.tolist()) or np.ptp(piece.xy, axis=0).max() < FAR * piece.radius:
            continue
        if float(np.median(scene.found["contrast"][piece.blobs])) < HALF * bright:
            continue  # a shadow on a wall goes as its ball does
        count = 0
        for flight in flights:
            both, here, there = np.intersect1d(piece.frames, flight.frames, return_indices=True)
            apart = np.hypot(*(piece.xy[here] - flight.xy[there]).T)
            count += int((apart > 2 * flight.radius).sum()) if both.size else 0
        if count >= FEWEST // 2 and _falls(scene, piece, pull, u, rms):
            found.append(piece)
    return found


def joint_fit(scene: FlightScene, flights: Sequence[Piece], **ways: bool | float) -> Fit:
    """Return the joint fit of flights; ways as `fit_flights` takes them."""
    radius = float(np.median([each.radius for each in flights]))
    given = {"readout": scene.readout or 0.0} | ways
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
                place=(fit.seen(k, t[best]) + fit.seen(k + 1, t[best]))[0] / 2,
                before=before[best, 2:],
                after=after[best, 2:],
            )
        )
    return found


def readout_of(scene: FlightScene, flights: Sequence[Piece], surely: float = SURELY) -> float:
    """Return the readout [frames]; where it is unknown 0, unless the flights speak against it.

    Their misfit must then shrink by a factor with another one.
    """
    if scene.readout is not None:
        return scene.readout
    plain = joint_fit(scene, flights, readout=0.0)
    if plain.spread < GOOD * float(np.median([each.radius for each in flights])):
        return 0.0
    costs = {0.0: plain.cost}
    costs |= {each: joint_fit(scene, flights, readout=each).cost for each in READOUTS[1:]}
    best = min(costs, key=lambda each: costs[each])
    return best if costs[0.0] > surely * costs[best] else 0.0


def _aligned(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return flights, later ones shifted by frames that were left out at a contact."""
    aligned, shift = [flights[0]], 0.0
    for k, (one, other) in enumerate(pairwise(flights)):
        shift -= scene.ahead(one, other)
        if other.t[0] + shift - aligned[-1].t[-1] <= BETWEEN:
            apart = []
            late = shift + one.t[-1] - aligned[-1].t[-1]
            for lost in range(4):
                t = np.linspace(one.t[-1] - 0.5, other.t[0] + late + lost + 0.5, 201)
                off = fit.at(k, t)[:, :2] - fit.at(k + 1, t - late - lost)[:, :2]
                apart.append(float(np.hypot(*off.T).min()))
            best = int(np.argmin(apart))
            if apart[0] > 0.4 * one.radius and apart[best] < 0.3 * apart[0]:
                shift += best
        aligned.append(replace(other, t=other.t + shift))
    return aligned


def _of_one_gravity(scene: FlightScene, pieces: list[Piece]) -> list[Piece]:
    """Return the pieces that share the acceleration with the most places behind it."""
    told = [(each, *_bent(scene, each)) for each in pieces]
    told = [each for each in told if _smooth(each[3], each[0])]
    best: tuple[float, list[Piece]] = (0.0, [])
    for piece, pull, u, rms in told:
        if len(piece.t) < FEWEST or not _falls(scene, piece, pull, u, rms):
            continue
        like: list[Piece] = []
        loose: list[Piece] = []
        size = float(np.hypot(*pull))
        shows = size > _chance(piece, u)
        for other, own, own_u, _ in told:
            chance = _chance(other, own_u)
            slowed = (DRAG + DRAG_U) / piece.radius * max(_fast(piece), _fast(other)) ** 2
            room = max(chance, slowed, ALIKE * size)
            small = max(other.radius, piece.radius) / min(other.radius, piece.radius) < SIZE
            colour = np.abs(_colour(scene, other) - _colour(scene, piece)).max() < 60
            if np.hypot(*(own - pull)) < room and small and colour:
                sure = other is piece or chance < UNSURE * size or not shows
                (like if sure else loose).append(other)
        # of a few places any acceleration may be gravity's: they must lie beside a flight
        like += [o for o in loose if any(_gap(o, each) <= BETWEEN for each in like)]
        # many short pieces of a hand's way agree by chance; long ones do not
        support = float(sum((len(each.t) - 3) ** 1.5 for each in like))
        if support > best[0]:
            best = (support, like)
    return best[1]


def _smooth(rms: float, piece: Piece) -> bool:
    return rms < max(SMOOTH[0] * piece.radius, SMOOTH[1])


def _chance(piece: Piece, u: Array) -> float:
    """Return the acceleration that a piece may show by chance [pixels/frame²]."""
    return 3 * float(u[0]) + 8 * BENDS * piece.radius / float(np.ptp(piece.t)) ** 2


def _gap(one: Piece, other: Piece) -> int:
    """Return how many frames lie from one piece to another."""
    return int(max(one.frames[0] - other.frames[-1], other.frames[0] - one.frames[-1]))


def _fast(piece: Piece) -> float:
    """Return the mean speed along a piece [pixels/frame]."""
    return float(np.hypot(*(piece.xy[-1] - piece.xy[0])) / np.ptp(piece.t))


def _bent(scene: FlightScene, piece: Piece) -> tuple[Array, Array, float]:
    """Return `parabola` of a piece, by the readout that it goes with best."""
    if scene.readout is not None:
        return parabola(piece.t + scene.readout * scene.late(piece.blobs), piece.xy)
    late = scene.late(piece.blobs)
    tried = [parabola(piece.t + each * late, piece.xy) for each in READOUTS]
    best = min(tried, key=lambda each: each[2])
    return best if LOOSELY * best[2] ** 2 < tried[0][2] ** 2 else tried[0]


def _falls(scene: FlightScene, piece: Piece, pull: Array, u: Array, rms: float) -> bool:
    """Return whether an acceleration may be gravity's, as far as scale and direction show."""
    size, span = float(np.hypot(*pull)), float(np.ptp(piece.t))
    bent = size * span**2 / 8
    expected = scene.expected(piece.radius)
    if expected is not None and expected * span**2 / 8 > max(SHOWS * piece.radius, 6 * rms):
        # gravity would show: is it there, or does a wrong frame rate make it look larger or less?
        ratio = size / expected
        if scene.doubled and 0.125 < ratio < 0.5:
            ratio *= 4  # stored twice, and played at the rate it was filmed with
        down = float(np.arctan2(abs(pull[0]), pull[1]))
        if 0.5 < ratio < 2.0:
            return down < UPRIGHT
        sharp = len(piece.t) >= 2 * FEWEST and rms < SHARP * piece.radius
        sharp |= bent > DEEP * piece.radius and rms < CLEAN * bent
        return sharp and size > 8 * u[0] and down < UPRIGHT and bent > SAG * piece.radius
    if bent < SAG * piece.radius:
        return True
    return float(np.arctan2(abs(pull[0]), pull[1])) < UPRIGHT


def _colour(scene: FlightScene, piece: Piece) -> Array:
    return np.asarray(np.median(scene.found["colour"][piece.blobs], axis=0))


def _once(flights: list[Piece]) -> list[Piece]:
    """Return flights that do not share frames: of two at a time the longer stays."""
    kept: list[Piece] = []
    for whole in sorted(flights, key=lambda each: -len(each.t)):
        piece = whole
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


def _merged(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return flights, neighbours that one way explains made one; lost frames are tried."""
    merged, last = [flights[0]], 0
    for k, piece in enumerate(flights[1:], start=1):
        one = merged[-1]
        if (
            piece.t[0] - one.t[-1] <= 3 * BETWEEN
            and (lost := _one_way(fit, last, k, one, piece)) is not None
        ):
            both = np.concatenate([one.blobs, piece.blobs])
            merged[-1] = Piece.of(scene.found, both, np.concatenate([one.t, piece.t + lost]))
        else:
            merged.append(piece)
        last = k
    return merged


def _one_way(fit: Fit, one: int, other: int, before: Piece, after: Piece) -> int | None:
    """Return how many frames are left out between parts of one flight, None: they are two.

    Their velocities agree in the middle between them, and their places do; or the places of the
    shorter one, which another ball may have drawn aside, lie by the way of the longer one.
    """
    middle = (before.t[-1] + after.t[0]) / 2
    best: tuple[float, int] | None = None
    for lost in range(4):
        first, second = fit.at(one, middle)[0], fit.at(other, middle - lost)[0]
        turned = float(np.hypot(*(second - first)[2:]))
        least = 1.5 * float(np.hypot(*fit.pull[0]))
        off = np.array([(second - first)[:2]])
        if (
            turned > max(0.2 * float(np.hypot(*first[2:])), least)
            or np.hypot(*off[0]) > ASIDE * before.radius
        ):
            if len(before.t) < len(after.t):
                off = fit.seen(other, before.t - lost) - before.xy
            else:
                off = fit.seen(one, after.t + lost) - after.xy
        aside = np.hypot(*off.T) / before.radius
        apart = float(np.median(aside))
        if apart < ASIDE and aside.max() < 2 * ASIDE and (best is None or apart < 0.3 * best[0]):
            best = (apart, lost)
    return None if best is None else best[1]


def _refilled(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return flights with every place that lies on their way, and none that does not."""
    counted = np.flatnonzero(np.isfinite(scene.time))
    refilled = []
    frames = scene.found["frame"]
    for k, piece in enumerate(flights):
        before = flights[k - 1].frames[-1] if k else -FAR_OFF
        after = flights[k + 1].frames[0] if k + 1 < len(flights) else len(scene.time) + FAR_OFF
        ahead = dict(
            zip(piece.frames.tolist(), (piece.t - scene.time[piece.frames]).tolist(), strict=True)
        )
        places: list[tuple[int, int, float]] = []
        middle = int(np.searchsorted(counted, piece.frames[len(piece.frames) // 2]))
        for order in (counted[middle:], counted[:middle][::-1]):
            missed, shift = 0, float(ahead[int(piece.frames[len(piece.frames) // 2])])
            for frame in order.tolist():
                if not before < frame < after or missed > MISSED:
                    break
                shift = ahead.get(frame, shift)
                t = float(scene.time[frame]) + shift
                early = frame < piece.frames[0]
                struck = frame - before <= BETWEEN if early else after - frame <= BETWEEN
                one = _nearest(scene, piece, fit, k, frame, t, frames, struck)
                if one is None:
                    missed += 1
                    continue
                missed = 0
                places.append((frame, one, t))
        if len(places) < SIDE:
            continue
        _, blobs, t = map(np.array, zip(*sorted(places), strict=True))
        refilled.append(Piece.of(scene.found, blobs, t))
    return refilled


def _nearest(
    scene: FlightScene,
    piece: Piece,
    fit: Fit,
    k: int,
    frame: int,
    t: float,
    frames: Array,
    struck: bool,
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
    room = max(NEAR[0] * piece.radius, NEAR[1] * fit.spread)
    if beyond and not struck:  # a hand that lets go leads the ball on
        room = max(END[0] * piece.radius, END[1] * fit.spread) * (1 + 0.3 * min(beyond, 3.0))
        if some["dirty"][best] > DIRTY:
            return None
    return int(there[best]) if off[best] < min(room, 0.5 * piece.radius) else None


def _parted(scene: FlightScene, flights: list[Piece]) -> list[Piece]:
    """Return flights without places whose exposure spans a contact."""
    if len(flights) < 2:
        return flights
    fit = joint_fit(scene, flights)
    half = (1.0 if scene.exposure is None else scene.exposure) / 2
    kept = list(flights)
    for each in meetings(flights, fit):
        before, after = kept[each.first], kept[each.first + 1]
        kept[each.first] = before.part(before.t < each.t - half)
        kept[each.first + 1] = after.part(after.t > each.t + half)
    return [replace(each) for each in kept if len(each.t)]
