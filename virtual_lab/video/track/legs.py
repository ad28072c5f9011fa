"""Straight flights through sharp places: of the flight in, and of that out of a contact.

A frame during whose exposure the ball was struck belongs to neither flight; nor does one that
shows the ball pressed against what it struck, which its neighbours' line shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from virtual_lab.relations.flight import distance_after
from virtual_lab.units import Array, Mask
from virtual_lab.video.clips.calibration_file import ClipCalibration


@dataclass(frozen=True, slots=True, kw_only=True)
class LegSettings:
    """Which frames are of a flight, and how slow the ball's own pattern may be."""

    least_frames: int = 3  # of a flight
    rounds: int = 3
    outlier_spreads: float = 8.0  # robust standard deviations: a frame this far off is left out
    contact_u: float = 4.0  # standard uncertainties that a frame lies off, to span the contact
    contact_share: float = 0.34  # of a flight's frames: no contact is seen in more
    turn_u: float = 6.0  # standard uncertainties that the velocity changes by at a contact
    turn: float = 0.03  # of the speed, that it changes by there
    lags: tuple[float, float] = (0.02, 30.0)  # of a pattern, in times that the flight is seen
    pattern_odds: float = 10.0  # residuals that show so much less than it should are still its own


LEGS = LegSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightFlight:
    """One straight flight at a moment; x and y in metres, m/s."""

    time: float  # of what follows [s]
    place: Array  # (2,)
    velocity: Array  # (2,)
    covariance: Array  # (2, 2) of place and velocity, alike along x and y
    drag_u: float  # relative uncertainty of the speed from the drag's
    residuals: Array  # (frame, 2) of the frames used

    @property
    def speed(self) -> float:
        return float(np.hypot(*self.velocity))

    @property
    def speed_u(self) -> float:
        """Standard uncertainty of the speed, scale and clock apart [m/s]."""
        return float(np.hypot(np.sqrt(self.covariance[1, 1]), self.speed * self.drag_u))


def fit_flight(
    t: Array,
    places: Array,
    u: Array,
    pattern_u: float,
    air: ClipCalibration,
    moment: float,
    *,
    rough: bool = False,
) -> StraightFlight:
    """Return the straight flight through places, given for a moment: drag and gravity known.

    Noise is new in every frame. The ball's own pattern moves its apparent centre slowly, as it
    turns: neighbouring frames err alike, residuals hide it, and the slope takes it all. How large
    it is comes from the pictures; how slow, from residuals.

    Parameters
    ----------
    t
        Time stamps, (frame,), at least two [s].
    places
        (frame, 2) [m].
    u
        Standard uncertainty of each place from noise, (frame,) [m].
    pattern_u
        The same from the ball's pattern [m].
    moment
        Time that place and velocity are given for, of the contact [s].
    rough
        The uncertainty is that of the residuals' scatter alone: quick, for a search.
    """
    tau, velocity = t - moment, np.zeros(2)
    level = places - 0.5 * np.outer(tau**2, air.gravity_mps2)  # without gravity: a straight line's
    for _ in range(4):  # the way depends on the speed, by the drag, a little
        speed = float(np.hypot(*velocity))
        way = distance_after(tau, speed, air.drag_per_m) / speed if speed else tau
        design = np.stack([np.ones_like(way), way], axis=1)
        solver = np.linalg.pinv(design / u[:, None]) / u
        place, velocity = solver @ level
    residuals = level - design @ np.stack([place, velocity])
    noise = (solver * u**2) @ solver.T
    chi_square = float(np.sum((residuals / u[:, None]) ** 2)) / (2 * max(len(t) - 2, 1))
    covariance = noise * max(1.0, chi_square)
    if not rough:
        covariance = noise + _pattern(t, residuals, u, pattern_u, design, solver, noise)
    distance = abs(float(np.mean(way))) * float(np.hypot(*velocity))
    return StraightFlight(
        time=moment,
        place=place,
        velocity=velocity,
        covariance=covariance,
        drag_u=air.drag_per_m_u * distance,
        residuals=residuals,
    )


def _pattern(
    t: Array,
    residuals: Array,
    u: Array,
    pattern_u: float,
    design: Array,
    solver: Array,
    noise: Array,
) -> Array:
    """Return the covariance of place and velocity that the ball's pattern adds to noise's."""
    count, spare = len(t), len(t) - 2
    if spare < 1:
        return pattern_u**2 * solver @ solver.T
    excess = float(np.sum(residuals**2 - u[:, None] ** 2 * spare / count)) / (2 * spare)
    if excess <= 0 and pattern_u == 0:
        return np.zeros((2, 2))
    shown, slow = [], []
    for lag in np.geomspace(*LEGS.lags, 24) * float(np.ptp(t)):
        like = np.exp(-0.5 * ((t[:, None] - t) / lag) ** 2)
        moved = solver @ like
        slow.append(moved @ solver.T)
        # the trace of (1 - design solver) like (1 - design solver)^T
        fitted = float(np.sum(design.T @ design * slow[-1])) - 2 * float(np.sum(moved * design.T))
        shown.append((count + fitted) / spare)
    # what the residuals show beyond noise the pattern may have made, or something unknown
    power = max(pattern_u**2, excess / shown[0])
    # a slow pattern shows little in the residuals of one flight, by chance still less
    most = LEGS.pattern_odds * max(excess, float(np.mean(u**2)) / np.sqrt(spare))
    possible = [each for each, part in zip(slow, shown, strict=True) if power * part <= most]
    worst = max(possible or slow[:1], key=lambda each: float(each[1, 1]))
    if excess <= pattern_u**2:
        return np.asarray(power * worst)
    # known by few residuals, and by nothing else
    from scipy.special import stdtrit

    wide = (float(stdtrit(2 * spare, 0.975)) / 1.959964) ** 2
    return np.asarray(wide * (noise + power * worst) - noise)


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Where the ball was, frame by frame, in metres."""

    t: Array  # (frame,) [s]
    places: Array  # (frame, 2), NaN where it was not found
    u: Array  # (frame,) from noise
    pattern_u: float
    exposure: float  # [s]
    air: ClipCalibration  # drag and gravity

    def flight(self, used: Mask, moment: float, *, rough: bool = True) -> StraightFlight:
        """Return the flight through some of the frames."""
        return fit_flight(
            self.t[used],
            self.places[used],
            self.u[used],
            self.pattern_u,
            self.air,
            moment,
            rough=rough,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Legs:
    """The flights of a clip, one or two; masks are (frame,) of the places given."""

    flights: list[StraightFlight]  # in, and out where a contact was seen
    used: list[Mask]  # of each
    wild: Mask  # far off their lines
    struck: Mask  # in contact


def legs_of(ball: Places, ways: Sequence[Mask]) -> Legs:
    """Return the straight flights of one way or two, without frames that belong to neither.

    `ways`: which frames are of the first and of the second, (frame,), three or more of each.
    """
    usable = np.isfinite(ball.places).all(axis=1) & np.isfinite(ball.u)
    wild = np.zeros_like(usable)
    for _ in range(LEGS.rounds):
        for way in ways:
            wild |= _far(ball, way & usable & ~wild)
    used = [way & usable & ~wild for way in ways]
    used = [each for each in used if each.sum() >= LEGS.least_frames]
    if len(used) != 2 or not _turns(ball, *used):
        whole = np.logical_or.reduce(used)
        flight = ball.flight(whole, float(ball.t[whole].max()), rough=False)
        return Legs(flights=[flight], used=[whole], wild=wild, struck=np.zeros_like(wild))
    for _ in range(LEGS.rounds):
        start = float(ball.t[used[1]].min())
        before, after = (ball.flight(each, start) for each in used)
        apart, change = after.place - before.place, after.velocity - before.velocity
        moment = start - float(apart @ change) / float(change @ change)  # they are nearest
        during = np.abs(ball.t - moment) <= ball.exposure / 2
        used = [_clear(ball, each & ~during, moment) for each in used]
    between = (ball.t > ball.t[used[0]].max()) & (ball.t < ball.t[used[1]].min())
    return Legs(
        flights=[ball.flight(each, moment, rough=False) for each in used],
        used=used,
        wild=wild & ~between,
        struck=usable & between,
    )


def _turns(ball: Places, first: Mask, second: Mask) -> bool:
    """Return whether the velocity changes by more than its uncertainty."""
    moment = float(ball.t[second].min())
    before, after = (ball.flight(each, moment) for each in (first, second))
    change = float(np.hypot(*(after.velocity - before.velocity)))
    u = float(np.hypot(before.speed_u, after.speed_u))
    return change > max(LEGS.turn_u * u, LEGS.turn * before.speed)


def _far(ball: Places, used: Mask) -> Mask:
    """Return the frames far off the line through them: at most a quarter, the farthest."""
    wild = np.zeros_like(used)
    if used.sum() < 2 * LEGS.least_frames:
        return wild
    flight = ball.flight(used, float(ball.t[used].max()))
    off = np.hypot(*flight.residuals.T)
    usual = max(float(np.median(off)), float(np.median(ball.u[used])), ball.pattern_u)
    worst = np.argsort(-off, kind="stable")[: int(used.sum()) // 4]
    frames = np.flatnonzero(used)[worst]
    wild[frames[off[worst] > LEGS.outlier_spreads * usual]] = True
    return wild


def _clear(ball: Places, used: Mask, moment: float) -> Mask:
    """Return the frames of a flight without those next to the contact that its line denies."""
    used = used.copy()
    kept = max(LEGS.least_frames, (1 - LEGS.contact_share) * used.sum())
    while used.sum() > kept:
        frames = np.flatnonzero(used)
        next_to = frames[np.argmin(np.abs(ball.t[frames] - moment))]
        others = used.copy()
        others[next_to] = False
        flight = ball.flight(others, float(ball.t[next_to]))
        off = float(np.hypot(*(ball.places[next_to] - flight.place)))
        scatter = float(np.sqrt(np.mean(flight.residuals**2)))
        own = max(float(ball.u[next_to]), ball.pattern_u, scatter)
        if off <= LEGS.contact_u * np.hypot(own, np.sqrt(flight.covariance[0, 0])):
            break
        used = others
    return used
