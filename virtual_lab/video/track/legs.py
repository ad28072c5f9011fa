"""Straight flights through sharp places: of the flight in, and of that out of a contact.

A frame during whose exposure the ball was struck belongs to neither flight; nor does one that
shows the ball pressed against what it struck, which its neighbours' line shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after

__all__ = ["AirOnFlight", "Legs", "Places", "StraightFlight", "fit_flight", "legs_of"]


LAGS = np.geomspace(0.02, 30, 24)  # of the time a flight is seen: how slow a pattern may be
ODDS = 10.0  # residuals that show this much less than a pattern should are still its own
NORMAL_95 = 1.959964


Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST = 3  # frames of a flight
WILD = 8.0  # robust standard deviations of the residuals: a frame this far off is left out
STRUCK = 4.0  # standard uncertainties: a frame next to the contact this far off is in it
TOUCHED = 0.34  # of a flight's frames: no contact is seen in more
ROUNDS = 3
TURNED = 6.0  # standard uncertainties that the velocity must change by for a contact
CHANGED = 0.03  # of the speed, likewise


@dataclass(frozen=True, slots=True, kw_only=True)
class AirOnFlight:
    """What bends a flight."""

    drag: float = 0.0  # κ of dv/dx = -κ v [1/m]
    drag_u: float = 0.0
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightFlight:
    """One straight flight at a moment; x and y in metres, m/s."""

    time: float  # of what follows [s]
    place: Array  # (2,)
    velocity: Array  # (2,)
    covariance: Array  # (2, 2) of place and velocity, alike along x and y
    drag_u: float  # relative uncertainty of the speed from the drag's
    residuals: Array  # (frame, 2) of the frames used
    chi_square: float  # per degree of freedom, of noise alone
    count: int

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
    air: AirOnFlight,
    moment: float,
    *,
    rough: bool = False,
) -> StraightFlight:
    """Return the straight flight through places, given for a moment: drag and gravity known.

    The uncertainty knows two kinds of error. Noise is new in every frame. The ball's own pattern
    moves its apparent centre slowly, as it turns: neighbouring frames err alike, residuals hide it,
    and the slope takes it all. How large it is comes from the pictures; how slow, from residuals.

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
    tau = t - moment
    level = places - 0.5 * np.outer(tau**2, air.gravity)  # without gravity: a straight line's
    weight = 1 / u
    velocity = np.zeros(2)
    for _ in range(4):  # the way depends on the speed, by the drag, a little
        speed = float(np.hypot(*velocity))
        way = distance_after(tau, speed, air.drag) / speed if speed else tau
        design = np.stack([np.ones_like(way), way], axis=1)
        solver = np.linalg.pinv(design * weight[:, None]) * weight
        place, velocity = solver @ level
    residuals = level - design @ np.stack([place, velocity])
    noise = (solver * u**2) @ solver.T
    spare = max(len(t) - 2, 1)
    chi_square = float(np.sum((residuals / u[:, None]) ** 2)) / (2 * spare)
    covariance = noise * max(1.0, chi_square)
    if not rough:
        covariance = noise + _pattern(t, residuals, u, pattern_u, design, solver, noise)
    distance = abs(float(np.mean(way))) * float(np.hypot(*velocity))
    return StraightFlight(
        time=moment,
        place=place,
        velocity=velocity,
        covariance=covariance,
        drag_u=air.drag_u * distance,
        residuals=residuals,
        chi_square=chi_square,
        count=len(t),
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
    seen, slow = [], []
    for lag in LAGS * float(np.ptp(t)):
        like = np.exp(-0.5 * ((t[:, None] - t) / lag) ** 2)
        told = solver @ like
        slow.append(told @ solver.T)
        # the trace of (1 - design solver) like (1 - design solver)^T
        fitted = float(np.sum(design.T @ design * slow[-1])) - 2 * float(np.sum(told * design.T))
        seen.append((count + fitted) / spare)
    # what the residuals show beyond noise the pattern may have made, or something unknown
    power = max(pattern_u**2, excess / seen[0])
    # a slow pattern shows little in the residuals of one flight, by chance still less
    most = ODDS * max(excess, float(np.mean(u**2)) / np.sqrt(spare))
    possible = [each for each, part in zip(slow, seen, strict=True) if power * part <= most]
    worst = max(possible or slow[:1], key=lambda each: float(each[1, 1]))
    if excess <= pattern_u**2:
        return np.asarray(power * worst)
    # known by few residuals, and by nothing else
    from scipy.special import stdtrit

    wide = (float(stdtrit(2 * spare, 0.975)) / NORMAL_95) ** 2
    return np.asarray(wide * (noise + power * worst) - noise)


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Where the ball was, frame by frame, in metres."""

    t: Array  # (frame,) [s]
    places: Array  # (frame, 2)
    u: Array  # (frame,) from noise
    pattern_u: float
    exposure: float  # [s]

    def of(self, used: Mask) -> Places:
        """Return some of the frames."""
        return replace(self, t=self.t[used], places=self.places[used], u=self.u[used])


@dataclass(frozen=True, slots=True, kw_only=True)
class Legs:
    """The flights of a clip, one or two; masks are (frame,) of the places given."""

    flights: list[StraightFlight]  # in, and out where a contact was seen
    used: list[Mask]  # of each
    wild: Mask  # far off their lines
    struck: Mask  # in contact


def legs_of(seen: Places, ways: Sequence[Mask], air: AirOnFlight) -> Legs:
    """Return the straight flights of one way or two, without frames that belong to neither.

    Parameters
    ----------
    seen
        Where the ball was; NaN where it was not found.
    ways
        Which frames are of the first flight and of the second, (frame,), three or more of each.
    air
        Drag and gravity.
    """
    usable = np.isfinite(seen.places).all(axis=1) & np.isfinite(seen.u)
    wild = np.zeros_like(usable)
    for _ in range(ROUNDS):
        for way in ways:
            wild |= _far(seen, air, way & usable & ~wild)
    used = [way & usable & ~wild for way in ways]
    used = [each for each in used if each.sum() >= LEAST]
    if len(used) != 2 or not _turns(seen, air, *used):
        whole = np.logical_or.reduce(used)
        flight = _fit(seen, air, whole, float(seen.t[whole].max()), rough=False)
        return Legs(flights=[flight], used=[whole], wild=wild, struck=np.zeros_like(wild))
    for _ in range(ROUNDS):
        start = float(seen.t[used[1]].min())
        moment = _meeting(*(_fit(seen, air, each, start) for each in used))
        during = np.abs(seen.t - moment) <= seen.exposure / 2
        used = [_clear(seen, air, each & ~during, moment) for each in used]
    between = (seen.t > seen.t[used[0]].max()) & (seen.t < seen.t[used[1]].min())
    return Legs(
        flights=[_fit(seen, air, each, moment, rough=False) for each in used],
        used=used,
        wild=wild & ~between,
        struck=usable & between,
    )


def _turns(seen: Places, air: AirOnFlight, first: Mask, second: Mask) -> bool:
    """Return whether the velocity changes by more than its uncertainty."""
    moment = float(seen.t[second].min())
    before, after = (_fit(seen, air, each, moment) for each in (first, second))
    change = float(np.hypot(*(after.velocity - before.velocity)))
    u = float(np.hypot(before.speed_u, after.speed_u))
    return change > max(TURNED * u, CHANGED * before.speed)


def _far(seen: Places, air: AirOnFlight, used: Mask) -> Mask:
    """Return the frames far off the line through them: at most a quarter, the farthest."""
    wild = np.zeros_like(used)
    if used.sum() < 2 * LEAST:
        return wild
    flight = _fit(seen, air, used, float(seen.t[used].max()))
    off = np.hypot(*flight.residuals.T)
    usual = max(float(np.median(off)), float(np.median(seen.u[used])), seen.pattern_u)
    worst = np.argsort(-off, kind="stable")[: int(used.sum()) // 4]
    frames = np.flatnonzero(used)[worst]
    wild[frames[off[worst] > WILD * usual]] = True
    return wild


def _meeting(before: StraightFlight, after: StraightFlight) -> float:
    """Return when two flights given for one moment are nearest to each other [s]."""
    apart, change = after.place - before.place, after.velocity - before.velocity
    return before.time - float(apart @ change) / float(change @ change)


def _clear(seen: Places, air: AirOnFlight, used: Mask, moment: float) -> Mask:
    """Return the frames of a flight without those next to the contact that its line denies."""
    used = used.copy()
    kept = max(LEAST, (1 - TOUCHED) * used.sum())
    while used.sum() > kept:
        frames = np.flatnonzero(used)
        next_to = frames[np.argmin(np.abs(seen.t[frames] - moment))]
        others = used.copy()
        others[next_to] = False
        flight = _fit(seen, air, others, float(seen.t[next_to]))
        off = float(np.hypot(*(seen.places[next_to] - flight.place)))
        scatter = float(np.sqrt(np.mean(flight.residuals**2)))
        own = max(float(seen.u[next_to]), seen.pattern_u, scatter)
        if off <= STRUCK * np.hypot(own, np.sqrt(flight.covariance[0, 0])):
            break
        used = others
    return used


def _fit(
    seen: Places, air: AirOnFlight, used: Mask, moment: float, *, rough: bool = True
) -> StraightFlight:
    part = seen.of(used)
    return fit_flight(part.t, part.places, part.u, part.pattern_u, air, moment, rough=rough)
