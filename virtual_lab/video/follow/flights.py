"""Flights and their contacts: pieces of motion that share one gravity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from virtual_lab.units import Array
from virtual_lab.video.find.blobs import free
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, fit_flights
from virtual_lab.video.follow.pieces import FAR_U, GROWTH, Piece, polynomial
from virtual_lab.video.follow.scene import FlightScene


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSearch:
    """Criteria for pieces that are flights of one ball."""

    # largest time between two flights with a contact [frames], and as a share of the longer flight,
    # whichever is larger; shadows at the floor hide or move the ball longer at a high frame rate
    contact_frames: float = 6.0
    contact_share: float = 0.3
    # tolerances of one common gravity:
    # largest relative difference of the accelerations of two flights, before drag and tilt are
    # fitted
    pull_share: float = 0.25
    upright: float = 0.5  # largest angle of g to the picture's downward direction [rad]
    # smallest expected sag for which the absence of gravity is noticed [ball radii]
    shown_sag: float = 0.3
    path: float = 2.0  # smallest extent of a flight that does not bend [ball radii]
    # largest rms scatter of a flight: in ball radii, in pixels for a small ball, and as a fraction
    # of its sag, whichever is largest
    smooth: tuple[float, float, float] = (0.12, 0.7, 0.015)
    # tolerances of positions on a flight:
    room: float = 0.2  # largest distance of a position from its flight [ball radii]
    # largest distance of the first and last position from their flight if there is no contact [ball
    # radii]
    end_room: float = 0.07
    # largest length of the first and last blob, minus the motion in a frame [median lengths]
    end_length: float = 1.25
    meeting_radii: float = 0.5  # largest misfit of two flights at a contact [ball radii]
    # largest change of the distance between a ball and its shadow [share of the shadow's path]
    parallel: float = 0.2


FLIGHTS = FlightSearch()
EXPLAINED = 0.85  # smallest share of a moving ball's frames that flights must span
REST = 0.05  # smallest motion per frame of a ball that does not rest [ball radii]


def flights_of(scene: FlightScene, pieces: Sequence[Piece]) -> tuple[list[Piece], Fit | None]:
    """Return the flights of the ball among pieces of motion, and the joint fit of the flights.

    A piece is a series of positions of one object on a smooth path. The flights are the pieces that
    fit one ball with the same acceleration by gravity. The result is ``([], None)`` if there are no
    flights, or if their fit shows that the ball does not fall (`falls_freely`).
    """
    flights = _join(scene, _of_one_gravity(scene, pieces))
    for _ in range(4):
        if not flights:
            return [], None
        before, fit = positions_of(flights), fit_flights(scene, flights)
        flights = _align(scene, flights, fit)
        if positions_of(flights) != before:
            fit = fit_flights(scene, flights)
        whole = _refill(scene, flights, fit)
        if len(whole) == len(flights):
            whole = without_contacts(scene, whole, fit)
        flights = [each for each in whole if len(each.t) >= GROWTH.least_places]
        if positions_of(flights) == before:
            break
    return (flights, fit) if flights and falls_freely(scene, flights, fit) else ([], None)


def positions_of(pieces: Sequence[Piece]) -> list[list[Any]]:
    """Return the blobs and times of each piece."""
    return [[*each.blobs, *each.t] for each in pieces]


def falls_freely(scene: FlightScene, flights: Sequence[Piece], fit: Fit) -> bool:
    """Return whether the ball falls freely in `flights`, by their joint fit.

    The result is False in these cases:

    * The positions scatter too much.
    * The motion is that of a pendulum.
    * No flight bends visibly. They are shorter than two radii, or the ball also moves in many
      other frames (`explained_share`), so it may be held.
    * The flights bend less than half as much as those of a falling ball, and are no parabolas
      within 1.5 % of the bend, or the ball also moves in many other frames.
    """
    right, down = fit.pull[0]
    u = np.sqrt(np.trace(fit.covariance[:2, :2])) / max(np.hypot(right, down), 1e-12)
    # The acceleration of a pendulum is to the side.
    aside = np.arctan2(abs(right), down) - u > FLIGHTS.upright
    radius, moved = np.max([(e.radius, np.ptp(e.xy, axis=0).max()) for e in flights], axis=0)
    _, pixels, share = FLIGHTS.smooth
    bent, expected = bend_of(flights, fit.size), scene.gravity_of(radius) or 0.0
    parabolic = share * bent * radius  # largest scatter about a parabola
    rough = fit.spread > max(FLIGHTS.room * radius, pixels, parabolic)
    # A path that bends too little shows no fall if it is short, or if the ball moves elsewhere too.
    vague = moved < FLIGHTS.path * radius or explained_share(scene, flights) < EXPLAINED
    held = aside if bent > FLIGHTS.shown_sag else vague
    if (vague or fit.spread > parabolic) and bend_of(flights, expected) > FLIGHTS.shown_sag:
        held |= fit.size * (1 + 2 * u) < expected / 2
    return not (rough or held)


def bend_of(flights: Sequence[Piece], size: float) -> float:
    """Return the bend of the longest flight by an acceleration of `size` [ball radii].

    The bend is measured from the straight line between the ends of the flight.
    """
    longest = max(float(np.ptp(each.t)) for each in flights)
    return size * longest**2 / 8 / flights[0].radius


@dataclass(frozen=True, kw_only=True)
class _Bend:
    """A parabola fitted to one piece."""

    piece: Piece
    t: Array  # (place,) time from the piece's middle, with the readout of its rows [frames]
    pull: Array  # (2,) acceleration [pixels/frame²]
    u: float
    rms: float
    colour: Array
    expected: float | None  # gravity, where scale and rate are known [pixels/frame²]

    @classmethod
    def of(cls, scene: FlightScene, piece: Piece) -> _Bend:
        t = piece.t + (scene.readout or 0.0) * scene.late(piece.blobs)
        solved, solver, rms = polynomial(t - t.mean(), piece.xy, 2)
        return cls(
            piece=piece,
            t=t - t.mean(),
            pull=2 * solved[2],
            u=2 * rms * float(np.linalg.norm(solver[2])),
            rms=rms,
            colour=np.median(scene.blobs["colour"][piece.blobs], axis=0),
            expected=scene.gravity_of(piece.radius),
        )

    @cached_property
    def size(self) -> float:
        """Size of the acceleration."""
        return float(np.hypot(*self.pull))

    def sag(self, size: float) -> float:
        """Return the sag of the piece below its chord under an acceleration of `size` [pixels]."""
        return float(size * np.ptp(self.t) ** 2 / 8)

    @cached_property
    def is_bent(self) -> bool:
        """True if the acceleration bends the piece by more than a radius."""
        return self.sag(self.size) > self.piece.radius

    @cached_property
    def smooth(self) -> float:
        """Largest rms scatter of a flight [pixels]."""
        radii, pixels, sag = FLIGHTS.smooth
        return max(radii * self.piece.radius, pixels, sag * self.sag(self.size))

    @cached_property
    def room(self) -> float:
        """Largest rms scatter of this piece as a part of another piece's flight [pixels]."""
        return max(self.smooth, FLIGHTS.room * self.piece.radius)

    @cached_property
    def may_fall(self) -> bool:
        """True for a smooth piece that accelerates downward, or too little to be detected."""
        upright = float(np.arctan2(abs(self.pull[0]), self.pull[1])) < FLIGHTS.upright
        return self.rms < self.smooth and (upright or not self.is_bent)

    @cached_property
    def falls(self) -> bool:
        """True for a piece that accelerates as gravity, in direction and, if known, in size."""
        least = max(FLIGHTS.shown_sag * self.piece.radius, 6 * self.rms)
        if self.expected is None or self.sag(self.expected) <= least or not self.may_fall:
            return self.may_fall
        # If gravity would be detectable, it must be there, although a wrong frame rate may make it
        # look larger or smaller.
        clear = len(self.t) >= 2 * GROWTH.least_places and self.size > 8 * self.u
        return 0.5 < self.size / self.expected < 2.0 or (clear and self.is_bent)

    @cached_property
    def drag_acceleration(self) -> float:
        """Acceleration that drag may cause at the mean speed of the piece [pixels/frame²]."""
        speed = float(np.hypot(*(self.piece.xy[-1] - self.piece.xy[0])) / np.ptp(self.t))
        drag = FLIGHT_FIT.drag * float(np.exp(3 * FLIGHT_FIT.drag_u))
        return drag / self.piece.radius * speed**2

    def shares(self, other: _Bend) -> tuple[bool, bool]:
        """Return whether another piece may have the same acceleration, and whether it does."""
        alike = float(np.abs(other.colour - self.colour).max()) < GROWTH.colour
        ratio = max(other.piece.radius, self.piece.radius)
        ratio /= min(other.piece.radius, self.piece.radius)
        # a ball in two colors may turn and change its color, but then its size must agree better
        if ratio > (GROWTH.size_ratio if alike else np.sqrt(GROWTH.size_ratio)):
            return False, False
        room = max(FLIGHTS.pull_share * self.size, self.drag_acceleration, other.drag_acceleration)
        near = float(np.hypot(*(other.pull - self.pull))) < room
        fallen = other.t[:, None] ** 2 * self.pull / 2
        misfit = polynomial(other.t, other.piece.xy - fallen, 1)[2]
        may = near or (other.falls and misfit < other.room)
        return may, other is self or (near and alike and 3 * other.u < room)


def _of_one_gravity(scene: FlightScene, pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces that share the acceleration with the most positions.

    The pieces do not overlap in time.
    """
    # A shadow on the ground moves like its ball, but only across the picture.
    bends = [each for each in (_Bend.of(scene, piece) for piece in pieces) if each.may_fall]
    best: tuple[float, list[Piece]] = (0.0, [])
    for one in bends:
        if not one.falls:
            continue
        # leaves sail as one that is too short to show what it does
        others = [each for each in bends if one.is_bent or each.falls]
        shared = [(each.piece, *one.shares(each)) for each in others]
        like = [piece for piece, _, sure in shared if sure]
        loose = [piece for piece, may, sure in shared if may and not sure]
        # A short piece may agree with gravity by chance, and so may a turning ball in two colors.
        # Such pieces must adjoin a flight.
        while near := [o for o in loose if any(_adjoins(o, e) for e in like)]:
            like += near
            loose = [o for o in loose if not any(o is each for each in near)]
        like = _once(like)
        # Many short pieces of the path of a hand agree by chance, long pieces do not.
        support = float(sum((len(each.t) - 3) ** 1.5 for each in like))
        if support > best[0]:
            best = (support, like)
    return best[1]


def _adjoins(one: Piece, other: Piece) -> bool:
    """Return whether one piece begins at the time and position at which the other ends."""
    first, last = (one, other) if one.frames[0] < other.frames[0] else (other, one)
    later = float(last.frames[0] - first.frames[-1])
    if later > FLIGHTS.contact_frames:
        return False
    steps = np.hypot(*np.array([first.xy[-1] - first.xy[-2], last.xy[1] - last.xy[0]]).T)
    apart = float(np.hypot(*(last.xy[0] - first.xy[-1])))
    return bool(apart < first.radius + max(later, 1.0) * max(steps))


def _once(flights: list[Piece]) -> list[Piece]:
    """Return flights that share no frames; of two overlapping flights the longer one is kept."""
    parts: list[Piece] = []
    for piece in sorted(flights, key=lambda each: -len(each.t)):
        spans = [(e.frames[0] <= piece.frames) & (piece.frames <= e.frames[-1]) for e in parts]
        rest = piece.part(~np.any(spans, axis=0)) if parts else piece
        if len(rest.t) >= GROWTH.least_places:
            parts.append(rest)
    return sorted(parts, key=lambda each: each.frames[0])


def _join(scene: FlightScene, flights: list[Piece]) -> list[Piece]:
    """Return the flights after joining neighbors that are one flight, even across lost frames."""
    joined = flights[:1]
    for other in flights[1:]:
        one = joined[-1]
        blobs = np.concatenate([one.blobs, other.blobs])
        times = [np.concatenate([one.t, other.t + n]) for n in range(GROWTH.lost_frames + 1)]
        tried = [_Bend.of(scene, Piece.of(scene.blobs, blobs, t)) for t in times]
        longer = _Bend.of(scene, max(one, other, key=lambda each: len(each.t)))
        good = [each for each in tried if each.rms < each.room and longer.shares(each)[0]]
        best = min(good, key=lambda each: each.rms, default=None)
        if best and best.rms > GROWTH.better * good[0].rms:
            best = good[0]
        joined = [*joined[:-1], best.piece] if best else [*joined, other]
    return joined


def _align(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return the flights, with later ones delayed by the frames lost at a contact."""
    aligned, shift = flights[:1], 0.0
    for k, (one, other) in enumerate(pairwise(flights)):
        moves = np.arange(GROWTH.lost_frames + 1.0) - scene.ahead(one, other)
        best = 0
        if other.t[0] + moves[0] - one.t[-1] <= FLIGHTS.contact_frames:
            apart = [_nearest(fit, k, one.t[-1], other.t[0], move)[1] for move in moves]
            best = int(np.argmin(apart))
            if apart[0] < 0.4 * one.radius or apart[best] > 0.3 * apart[0]:
                best = 0
        shift += moves[best]
        aligned.append(replace(other, t=other.t + shift))
    return aligned


def _nearest(
    fit: Fit, first: int, start: float, end: float, move: float = 0.0
) -> tuple[float, float, float]:
    """Return the time at which two flights are closest, their distance, and the velocity change.

    The time is searched from one step before the end of the first flight to one step after the
    beginning of the second flight, which is delayed by `move`.
    """
    t = np.linspace(start - 1, end + move + 1, 401)
    change = fit.at(first + 1, t - move) - fit.at(first, t)
    apart = np.hypot(*change[:, :2].T)
    best = int(np.argmin(apart))
    return float(t[best]), float(apart[best]), float(np.hypot(*change[best, 2:]))


def meetings(flights: Sequence[Piece], fit: Fit) -> list[tuple[int, float]]:
    """Return the contacts between consecutive flights.

    Each contact is a pair: the index of the flight before the contact, and the time of the contact
    [frames]. `fit` is the joint fit of the flights. Two flights have no contact in these cases:

    * They pass each other at a distance.
    * They are closest more than one frame before the first flight ends, or more than one frame
      after the second flight begins.
    * The positions of the first flight come from blobs (bright regions), and the time between the
      flights is longer than `FLIGHTS.contact_frames` and `FLIGHTS.contact_share` allow.
    """
    contacts = []
    for k, (one, other) in enumerate(pairwise(flights)):
        start, end = one.t[-1], other.t[0]
        gap = max(np.ptp(each.t) for each in (one, other)) * FLIGHTS.contact_share
        if end - start > max(gap, FLIGHTS.contact_frames) and not one.sharp:
            continue
        t, apart, change = _nearest(fit, k, start, end)
        if apart <= FLIGHTS.meeting_radii * one.radius + change / 2 and start - 1 < t < end + 1:
            contacts.append((k, t))
    return contacts


def _refill(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Return the flights with all positions on their path, and no others.

    If there is no contact at an end of a flight, the flight ends at a position that is certainly on
    its path. Otherwise a hand that moves on with the ball could be included; a ball and a hand
    together look longer than the ball.
    """
    moving, refilled = scene.blobs, []
    counted = np.isfinite(scene.time)
    clean = free(moving) & counted[moving["frame"]]
    ends = [-np.inf, *(each.frames[-1] for each in flights[:-1])]
    starts = [*(each.frames[0] for each in flights[1:]), np.inf]
    for k, (piece, before, after) in enumerate(zip(flights, ends, starts, strict=True)):
        first, last = piece.frames[[0, -1]]
        ratio, away = moving["radius"] / piece.radius, last - first
        some = clean & (ratio < GROWTH.size_ratio) & (ratio > 1 / GROWTH.size_ratio)
        some &= moving["frame"] > max(before, first - away)
        some &= moving["frame"] < min(after, last + away)
        blobs = np.flatnonzero(some)
        frames = moving["frame"][blobs].astype(np.intp)
        nearest = np.clip(np.searchsorted(piece.frames, frames, "right") - 1, 0, None)
        t = scene.time[frames] + (piece.t - scene.time[piece.frames])[nearest]
        expected = fit.in_picture(k, t + fit.readout * scene.late(blobs))
        off = np.hypot(moving["x"][blobs] - expected[:, 0], moving["y"][blobs] - expected[:, 1])
        room = max(FLIGHTS.room * piece.radius, FAR_U * fit.spread)
        near = np.flatnonzero(off < min(room, piece.radius / 2))
        near = near[np.lexsort((off[near], frames[near]))]
        near = near[np.unique(frames[near], return_index=True)[1]]
        length, speed = moving["length"][blobs[near]], np.hypot(*fit.at(k, t[near])[:, 2:].T)
        sure = length - FLIGHTS.end_length * np.median(length) < speed / 2
        sure &= off[near] < max(FLIGHTS.end_room * piece.radius, FAR_U * fit.spread)
        sure |= np.minimum(frames[near] - before, after - frames[near]) <= FLIGHTS.contact_frames
        if near.size >= GROWTH.least_places and sure.any():
            near = near[np.argmax(sure) : len(sure) - np.argmax(sure[::-1])]
            refilled.append(Piece.of(moving, blobs[near], t[near]))
    return refilled


def beside(scene: FlightScene, flights: Sequence[Piece], pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces that are flights of a second ball. The list is empty if there is none.

    A flight of a second ball has frames in common with the first ball, but other positions in these
    frames. It is longer than a radius of the first ball, unlike a part of the hand that let go.

    Parameters
    ----------
    scene
        Bright regions (blobs), frame times, and properties of the camera.
    flights
        Flights of the first ball.
    pieces
        All pieces of smooth motion.
    """
    blobs, radius = np.concatenate([each.blobs for each in flights]), flights[0].radius
    long = [each for each in pieces if len(each.t) > GROWTH.least_places + 2]
    moving = [each for each in long if np.ptp(each.xy, axis=0).max() > radius]
    rest = [each for each in moving if not np.isin(each.blobs, blobs).any()]
    frames, xy = scene.blobs["frame"][blobs], np.concatenate([each.xy for each in flights])
    colour, contrast = scene.blobs["colour"], np.median(scene.blobs["contrast"][blobs])
    own, length = (np.median(scene.blobs[name][blobs], axis=0) for name in ("colour", "length"))
    rivals = []
    for piece in _of_one_gravity(scene, rest):
        _, here, there = np.intersect1d(piece.frames, frames, return_indices=True)
        away = piece.xy[here] - xy[there]
        if (np.hypot(*away.T) > 2 * length).sum() <= GROWTH.least_places // 2:
            continue
        # A shadow on a wall moves as its ball does, and has another color.
        path = np.ptp(piece.xy[here], axis=0).max()
        other = np.abs(np.median(colour[piece.blobs], axis=0) - own).max() > contrast / 2
        if not (other and (np.ptp(away, axis=0) < FLIGHTS.parallel * path).all()):
            rivals.append(piece)
    return rivals


def explained_share(scene: FlightScene, flights: Sequence[Piece]) -> float:
    """Return the share of the frames with a moving ball that belong to `flights`, 0 to 1.

    A frame has a moving ball if it is between the first and the last frame of a flight, or if a
    walk from an end of a flight reaches it. The walk goes to the nearest free blob of the ball's
    size in the next frames, and ends where no blob is near or where the ball rests. It does not
    depend on the pieces of smooth motion, so it also shows the frames of a flight that was missed.
    """
    moving = scene.blobs
    ratio = moving["radius"] / float(np.median([each.radius for each in flights]))
    sized = free(moving) & np.isfinite(scene.time)[moving["frame"]]
    sized &= (ratio < GROWTH.size_ratio) & (ratio > 1 / GROWTH.size_ratio)
    blobs = moving[sized]
    t, xy = scene.time[blobs["frame"]], np.stack([blobs["x"], blobs["y"]], axis=1)
    spans = [np.arange(each.frames[0], each.frames[-1] + 1) for each in flights]
    flown = np.unique(np.concatenate(spans))
    walked = [flown]
    for each in flights:
        times = scene.time[each.frames]
        for sense, (here, before) in ((-1, (0, 1)), (1, (-1, -2))):
            now, at, radius = times[here], each.xy[here], each.radius
            step = float(np.hypot(*(at - each.xy[before]))) / abs(now - times[before])
            while step > REST * radius:
                later, away = sense * (t - now), np.hypot(*(xy - at).T)
                near = (later > 0) & (later <= GROWTH.gap_frames + 1)
                near &= away < 2 * step * later + radius
                if not near.any():
                    break
                k = np.flatnonzero(near)[np.lexsort((away[near], later[near]))[0]]
                now, at, step = t[k], xy[k], away[k] / later[k]
                walked.append(blobs["frame"][[k]])
    return len(flown) / len(np.unique(np.concatenate(walked)))


def without_contacts(scene: FlightScene, flights: list[Piece], fit: Fit) -> list[Piece]:
    """Remove the positions that a contact or another flight makes doubtful; return the flights.

    At a contact, the earlier flight keeps the positions with an exposure that ends before the
    contact. The later flight keeps the positions with an exposure that begins after it. An unknown
    exposure time is assumed to be a whole frame. If two flights overlap in time, the later flight
    loses its positions up to the end of the earlier one. All flights are returned, but a flight may
    be empty. `fit` is the joint fit of the flights.
    """
    half = (1.0 if scene.exposure is None else scene.exposure) / 2
    parts = list(flights)
    for k, t in meetings(flights, fit):
        times = [each.t + fit.readout * scene.late(each.blobs) for each in parts[k : k + 2]]
        parts[k] = parts[k].part(times[0] < t - half)
        parts[k + 1] = parts[k + 1].part(times[1] > t + half)
    # Flights that do not meet may overlap in time.
    for k, (one, other) in enumerate(pairwise(parts)):
        if len(one.t):
            parts[k + 1] = other.part(other.frames > one.frames[-1])
    return parts
