"""Pieces to flights and contacts: which share one gravity, which places belong, where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from virtual_lab.units import Array, Mask
from virtual_lab.video.find.blobs import CLEAN
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, fit_flights
from virtual_lab.video.follow.pieces import GROWTH, Piece, parabola
from virtual_lab.video.follow.scene import FlightScene


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSearch:
    """When pieces are flights, and of one ball."""

    least_places: int = 6  # of a flight
    side_places: int = 4  # on each side of a contact, to state a restitution
    contact_frames: float = 6.0  # between two flights that a contact joins
    # one gravity
    # that flights may differ by before drag and tilt are known; a piece whose acceleration is not
    # known to it shows none
    pull_share: float = 0.25
    chance_bend: float = 0.05  # radii that few places, by chance, seem to bend by
    upright: float = 0.5  # radians that g may be off the picture's downward direction
    sag: float = 1.0  # radii that gravity must bend a way by, for its direction to be asked for
    shown_sag: float = 0.3  # the same, for gravity to be missed where there is none
    # a flight's own scatter, rms: radii, pixels of a small ball, and a share of its sag
    smooth: tuple[float, float, float] = (0.12, 0.7, 0.015)
    # places on a flight's way
    place_room: tuple[float, float] = (0.2, 5.0)  # radii, and standard deviations, off it
    # the same beyond the places a piece had, and of the first and the last in the end
    end_room: tuple[float, float] = (0.07, 4.0)
    end_length: float = 1.25  # radii that these are long, but for what they move in a frame
    dirty: float = 0.75  # of the ring: so much may be beside a place on a flight
    # radii that two flights may miss each other by at a contact, or one that is broken its own way
    meeting_radii: float = 0.5
    # a second ball
    second_contrast: float = 0.5  # of the ball's: what has less is its shadow or mirror image
    # a readout that is not known
    readouts: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)  # frames, tried
    good_spread: float = 0.015  # radii, that no other readout need mend
    readout_gain: float = 4.0  # factor that the misfit must shrink by with another one


FLIGHTS = FlightSearch()


def flights_of(scene: FlightScene, pieces: Sequence[Piece]) -> tuple[list[Piece], Fit | None]:
    """Flights among pieces, of one ball and one gravity, and their fit; or none."""
    flights = _of_one_gravity(scene, pieces)
    if not flights:
        return [], None
    fit_of = partial(fit_flights, scene, readout=readout_of(scene, flights))
    for _ in range(2):
        flights = _merge(scene, flights, fit_of(flights))
        flights = _align(scene, flights, fit_of(flights))
        before = [each.frames.tolist() for each in flights]
        flights = without_contacts(scene, _refill(scene, flights, fit_of(flights)))
        flights = [each for each in flights if len(each.t) >= FLIGHTS.side_places]
        if not flights or [each.frames.tolist() for each in flights] == before:
            break
    flights = [each for each in flights if len(each.t) >= FLIGHTS.least_places]
    while flights:
        fit = fit_flights(scene, flights, readout=readout_of(scene, flights))
        ended = _cut_ends(scene, flights, fit)
        if [len(each.t) for each in ended] == [len(each.t) for each in flights]:
            return flights, fit
        flights = [each for each in ended if len(each.t) >= FLIGHTS.least_places]
        flights = [each for each in flights if _travel(each) >= GROWTH.travel * each.radius]
    return [], None


def _cut_ends(scene: FlightScene, flights: Sequence[Piece], fit: Fit) -> list[Piece]:
    """Flights without ends off their way, alone or longer: in a hand or on a table.

    Ends at a contact stay: there a rolling shutter draws the way out of shape.
    """
    free, (radii, spreads) = _free(flights), FLIGHTS.end_room
    ended = []
    for k, (piece, left) in enumerate(zip(flights, fit.residuals, strict=True)):
        room = max(radii * piece.radius, spreads * fit.spread)
        fast = np.hypot(*fit.at(k, piece.t)[:, 2:].T)
        long = scene.found["length"][piece.blobs] - FLIGHTS.end_length * piece.radius
        steps = np.diff(piece.t)
        near = steps < 1.5 * np.median(steps)
        beside = np.append(near, False) | np.append(False, near)
        good = np.flatnonzero((np.hypot(*left.T) < room) & (long < fast / 2) & beside)
        first = good[0] if free[k] and good.size else 0
        last = good[-1] if free[k + 1] and good.size else len(piece.t) - 1
        ended.append(piece.part(slice(first, last + 1)))
    return ended


def _free(flights: Sequence[Piece]) -> Mask:
    """Find the ends at no contact: each flight's start and the last one's end, (flight + 1,)."""
    gaps = [np.inf, *(two.t[0] - one.t[-1] for one, two in pairwise(flights)), np.inf]
    return np.asarray(np.array(gaps) > FLIGHTS.contact_frames)


def beside(scene: FlightScene, flights: Sequence[Piece], pieces: Sequence[Piece]) -> list[Piece]:
    """Pieces that fly as a second ball does, beside the flights and at the same time."""
    found = []
    taken = np.concatenate([each.blobs for each in flights])
    contrast = [np.median(scene.found["contrast"][each.blobs]) for each in flights]
    for piece in pieces:
        pull, u, rms = _bend(scene, piece)
        if len(piece.t) < FLIGHTS.least_places + 2 or not _smooth(piece, pull, rms):
            continue
        if _travel(piece) < piece.radius:
            continue
        if np.isin(piece.blobs, taken).any():
            continue
        own = np.median(scene.found["contrast"][piece.blobs])
        if own < FLIGHTS.second_contrast * min(contrast):
            continue  # a shadow on a wall goes as its ball does
        count = 0
        for flight in flights:
            _, here, there = np.intersect1d(piece.frames, flight.frames, return_indices=True)
            apart = np.hypot(*(piece.xy[here] - flight.xy[there]).T)
            count += int((apart > 2 * flight.radius).sum())
        if count >= FLIGHTS.least_places // 2 and _falls(scene, piece, pull, u, rms):
            found.append(piece)
    return found


def meetings(flights: Sequence[Piece], fit: Fit) -> list[tuple[int, float]]:
    """Where neighbouring flights meet: the number of the one in, and the time [frames]."""
    found = []
    for k, (one, other) in enumerate(pairwise(flights)):
        start, end = one.t[-1], other.t[0]
        if end - start > FLIGHTS.contact_frames and one.u is None:
            continue
        t = np.linspace(start - 1, end + 1, 401)
        change = fit.at(k + 1, t) - fit.at(k, t)
        apart = np.hypot(*change[:, :2].T)
        best = int(np.argmin(apart))
        room = FLIGHTS.meeting_radii * one.radius + 0.5 * float(np.hypot(*change[best, 2:]))
        if apart[best] <= room and 0 < best < 400:
            found.append((k, float(t[best])))
    return found


def readout_of(scene: FlightScene, flights: Sequence[Piece]) -> float:
    """Readout [frames]; where it is unknown 0, unless the flights speak against it.

    Their misfit must then shrink by a factor with another one.
    """
    if scene.readout is not None:
        return scene.readout
    plain = fit_flights(scene, flights, readout=0.0)
    if plain.spread < FLIGHTS.good_spread * float(np.median([each.radius for each in flights])):
        return 0.0
    others = [fit_flights(scene, flights, readout=each) for each in FLIGHTS.readouts[1:]]
    best = min([plain, *others], key=lambda each: each.cost)
    return best.readout if plain.cost > FLIGHTS.readout_gain * best.cost else 0.0


def _align(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Flights, later ones shifted by frames that were left out at a contact."""
    aligned, shift = [flights[0]], 0.0
    for k, (one, other) in enumerate(pairwise(flights)):
        shift -= scene.ahead(one, other)
        if other.t[0] + shift - aligned[-1].t[-1] <= FLIGHTS.contact_frames:
            apart = []
            late = shift + one.t[-1] - aligned[-1].t[-1]
            for lost in range(GROWTH.lost_frames + 1):
                t = np.linspace(one.t[-1] - 0.5, other.t[0] + late + lost + 0.5, 201)
                off = fit.at(k, t)[:, :2] - fit.at(k + 1, t - late - lost)[:, :2]
                apart.append(float(np.hypot(*off.T).min()))
            best = int(np.argmin(apart))
            if apart[0] > 0.4 * one.radius and apart[best] < 0.3 * apart[0]:
                shift += best
        aligned.append(replace(other, t=other.t + shift))
    return aligned


def _of_one_gravity(scene: FlightScene, pieces: Sequence[Piece]) -> list[Piece]:
    """Pieces, one at a time, that share the acceleration with most places behind it."""
    bends = [(each, *_bend(scene, each)) for each in pieces]
    # a shadow on the ground goes as its ball does, but across
    bends = [e for e in bends if _smooth(e[0], e[1], e[3]) and _may_fall(e[0], e[1])]
    falls = [_falls(scene, *each) for each in bends]
    best: tuple[float, list[Piece]] = (0.0, [])
    for (piece, pull, u, _), fell in zip(bends, falls, strict=True):
        if len(piece.t) < FLIGHTS.least_places or not fell:
            continue
        like: list[Piece] = []
        loose: list[Piece] = []
        size = float(np.hypot(*pull))
        shows = size > _chance(piece, u)
        bent = _sag(pull, piece) > FLIGHTS.sag * piece.radius
        drag = (FLIGHT_FIT.drag + FLIGHT_FIT.drag_u) / piece.radius
        for (other, own, own_u, _), also in zip(bends, falls, strict=True):
            if not (bent or also):
                continue  # leaves sail as one that is too short to show what it does
            chance = _chance(other, own_u)
            slowed = drag * max(_fast(piece), _fast(other)) ** 2
            room = max(chance, slowed, FLIGHTS.pull_share * size)
            ratio = max(other.radius, piece.radius) / min(other.radius, piece.radius)
            colour = np.abs(_colour(scene, other) - _colour(scene, piece)).max() < GROWTH.colour
            if np.hypot(*(own - pull)) < room and ratio < GROWTH.size_ratio:
                sure = other is piece or chance < FLIGHTS.pull_share * size or not shows
                (like if sure and colour else loose).append(other)
        # of a few places any acceleration may be gravity's, and a ball in two colours turns: they
        # must lie beside a flight
        while near := [o for o in loose if any(_adjoins(o, e) for e in like)]:
            like += near
            loose = [o for o in loose if not any(o is each for each in near)]
        like = _once(like)
        # many short pieces of a hand's way agree by chance; long ones do not
        support = float(sum((len(each.t) - 3) ** 1.5 for each in like))
        if support > best[0]:
            best = (support, like)
    return best[1]


def _smooth(piece: Piece, pull: Array, rms: float) -> bool:
    """Whether a piece scatters by less than a flight may."""
    radii, pixels, sag = FLIGHTS.smooth
    return rms < max(radii * piece.radius, pixels, sag * _sag(pull, piece))


def _chance(piece: Piece, u: float) -> float:
    """Acceleration that a piece may show by chance [pixels/frame²]."""
    return 3 * u + 8 * FLIGHTS.chance_bend * piece.radius / float(np.ptp(piece.t)) ** 2


def _adjoins(one: Piece, other: Piece) -> bool:
    """Whether one piece begins where and when the other ends."""
    first, last = (one, other) if one.frames[0] < other.frames[0] else (other, one)
    later = float(last.frames[0] - first.frames[-1])
    steps = [np.hypot(*(each.xy[1] - each.xy[0])) for each in (first.part(np.s_[-2:]), last)]
    apart = float(np.hypot(*(last.xy[0] - first.xy[-1])))
    return later <= FLIGHTS.contact_frames and apart < first.radius + max(later, 1.0) * max(steps)


def _fast(piece: Piece) -> float:
    """Mean speed along a piece [pixels/frame]."""
    return float(np.hypot(*(piece.xy[-1] - piece.xy[0])) / np.ptp(piece.t))


def _travel(piece: Piece) -> float:
    """Distance that a piece goes right or down, the greater one [pixels]."""
    return float(np.ptp(piece.xy, axis=0).max())


def _sag(pull: Array, piece: Piece) -> float:
    """Distance by which an acceleration bends a piece off its chord [pixels]."""
    return float(np.hypot(*pull) * np.ptp(piece.t) ** 2 / 8)


def _bend(scene: FlightScene, piece: Piece) -> tuple[Array, float, float]:
    """Return `parabola` of a piece."""
    return parabola(piece.t + (scene.readout or 0.0) * scene.late(piece.blobs), piece.xy)


def _falls(scene: FlightScene, piece: Piece, pull: Array, u: float, rms: float) -> bool:
    """Whether an acceleration may be gravity's, as far as scale and direction show."""
    size, radius = float(np.hypot(*pull)), piece.radius
    expected = scene.expected(radius)
    least = max(FLIGHTS.shown_sag * radius, 6 * rms)
    if expected is None or expected * np.ptp(piece.t) ** 2 / 8 <= least:
        return _may_fall(piece, pull)
    # gravity would show: is it there, or does a wrong frame rate make it look larger or less?
    ratio = size / expected
    if scene.doubled and 0.125 < ratio < 0.5:
        ratio *= 4  # stored twice, and played at the rate it was filmed with
    clear = len(piece.t) >= 2 * FLIGHTS.least_places and size > 8 * u
    return _upright(pull) and (
        0.5 < ratio < 2.0 or (clear and _sag(pull, piece) > FLIGHTS.sag * radius)
    )


def _upright(pull: Array) -> bool:
    return float(np.arctan2(abs(pull[0]), pull[1])) < FLIGHTS.upright


def _may_fall(piece: Piece, pull: Array) -> bool:
    """Whether a piece's acceleration is gravity's by its direction, if it shows any."""
    return _upright(pull) or _sag(pull, piece) < FLIGHTS.sag * piece.radius


def _colour(scene: FlightScene, piece: Piece) -> Array:
    return np.asarray(np.median(scene.found["colour"][piece.blobs], axis=0))


def _once(flights: list[Piece]) -> list[Piece]:
    """Flights that do not share frames: of two at a time the longer stays."""
    kept: list[Piece] = []
    for piece in sorted(flights, key=lambda each: -len(each.t)):
        free = np.ones(len(piece.t), bool)
        for other in kept:
            free &= (piece.frames < other.frames[0]) | (piece.frames > other.frames[-1])
        rest = piece.part(free)
        whole = free.sum() >= FLIGHTS.side_places
        if free.all() or (whole and np.diff(rest.frames).max() <= GROWTH.gap_frames + 2):
            kept.append(rest)
    return sorted(kept, key=lambda each: each.frames[0])


def _merge(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Flights, neighbours that one way explains made one; lost frames are tried."""
    merged = [flights[0]]
    for k, piece in enumerate(flights[1:]):
        one = merged[-1]
        near = piece.t[0] - one.t[-1] <= 3 * FLIGHTS.contact_frames
        if near and (lost := _one_way(fit, k, one, piece)) is not None:
            both = np.concatenate([one.blobs, piece.blobs])
            merged[-1] = Piece.of(scene.found, both, np.concatenate([one.t, piece.t + lost]))
        else:
            merged.append(piece)
    return merged


def _one_way(fit: Fit, first: int, before: Piece, after: Piece) -> int | None:
    """Count of frames left out between two parts of one flight; None: they are two flights.

    Their velocities agree in the middle between them, and their places do; or the places of the
    shorter one, which another ball may have drawn aside, lie by the way of the longer one.
    """
    middle = (before.t[-1] + after.t[0]) / 2
    most = max(FLIGHTS.meeting_radii, FLIGHTS.place_room[1] * fit.spread / before.radius)
    found: int | None = None
    least = most
    for lost in range(GROWTH.lost_frames + 1):
        here, there = fit.at(first, middle)[0], fit.at(first + 1, middle - lost)[0]
        turn = max(0.2 * float(np.hypot(*here[2:])), 2.5 * float(np.hypot(*fit.pull[0])))
        off = (there - here)[None, :2]
        if np.hypot(*(there - here)[2:]) > turn or np.hypot(*off[0]) > most * before.radius:
            if len(before.t) < len(after.t):
                off = fit.pictured(first + 1, before.t - lost) - before.xy
            else:
                off = fit.pictured(first, after.t + lost) - after.xy
        aside = np.hypot(*off.T) / before.radius
        apart = float(np.median(aside))
        if apart < least and aside.max() < 2 * most:
            found, least = lost, 0.3 * apart
    return found


def _refill(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Flights with every place that lies on their way, and none that does not."""
    counted = np.flatnonzero(np.isfinite(scene.time))
    refilled = []
    for k, piece in enumerate(flights):
        before = flights[k - 1].frames[-1] if k else -np.inf
        after = flights[k + 1].frames[0] if k + 1 < len(flights) else np.inf
        shifts = piece.t - scene.time[piece.frames]
        ahead = dict(zip(piece.frames.tolist(), shifts.tolist(), strict=True))
        places: list[tuple[int, int, float]] = []
        start = piece.frames[len(piece.frames) // 2]
        middle = int(np.searchsorted(counted, start))
        for order in (counted[middle:], counted[:middle][::-1]):
            missed, shift = 0, float(ahead[int(start)])
            for frame in order.tolist():
                if not before < frame < after or missed > GROWTH.gap_frames:
                    break
                shift = ahead.get(frame, shift)
                t = float(scene.time[frame]) + shift
                gap = frame - before if frame < piece.frames[0] else after - frame
                blob = _nearest(scene, piece, fit, k, frame, t, gap <= FLIGHTS.contact_frames)
                own = piece.frames[0] <= frame <= piece.frames[-1]  # it may leave the picture there
                missed = 0 if own or blob is not None else missed + 1
                if blob is not None:
                    places.append((frame, blob, t))
        if len(places) >= FLIGHTS.side_places:
            _, blobs, t_of = map(np.array, zip(*sorted(places), strict=True))
            refilled.append(Piece.of(scene.found, blobs, t_of))
    return refilled


def _nearest(
    scene: FlightScene, piece: Piece, fit: Fit, k: int, frame: int, t: float, struck: bool
) -> int | None:
    """Blob on a flight's way in a frame, None without."""
    first, last = np.searchsorted(scene.found["frame"], [frame, frame + 1])
    some = scene.found[first:last]
    ratio = some["radius"] / piece.radius
    good = (some["dirty"] < FLIGHTS.dirty) & ~some["cut"] & (ratio > 0.6) & (ratio < 1.6)
    there = first + np.flatnonzero(good)
    some = some[good]
    if not there.size:
        return None
    expected = fit.pictured(k, t + fit.readout * scene.late(there))
    off = np.hypot(some["x"] - expected[:, 0], some["y"] - expected[:, 1])
    best = int(np.argmin(off))
    beyond = max(0.0, float(piece.t[0] - t), float(t - piece.t[-1]))
    radii, spreads = FLIGHTS.place_room
    if beyond and not struck:  # a hand that lets go leads the ball on
        if some["dirty"][best] > CLEAN:
            return None
        radii, spreads = (each * (1 + 0.3 * min(beyond, 3.0)) for each in FLIGHTS.end_room)
    room = max(radii * piece.radius, spreads * fit.spread)
    return int(there[best]) if off[best] < min(room, 0.5 * piece.radius) else None


def without_contacts(scene: FlightScene, flights: list[Piece]) -> list[Piece]:
    """Flights without places whose exposure spans a contact."""
    if len(flights) < 2:
        return flights
    half = (1.0 if scene.exposure is None else scene.exposure) / 2
    kept = list(flights)
    for k, t in meetings(flights, fit_flights(scene, flights)):
        kept[k] = kept[k].part(kept[k].t < t - half)
        kept[k + 1] = kept[k + 1].part(kept[k + 1].t > t + half)
    for k, (one, other) in enumerate(pairwise(kept)):  # ways that do not meet may both reach on
        if len(one.t):
            kept[k + 1] = other.part(other.frames > one.frames[-1])
    return kept
