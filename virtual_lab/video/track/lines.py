"""A straight flight through a ball's places: on time stamps, drag and gravity known, never free.

The uncertainty knows two kinds of error. Noise is new in every frame. The ball's own pattern moves
its apparent centre slowly, as it turns: neighbouring frames err alike, residuals hide it, and the
slope takes it all. How large it is the pictures tell; how slow, the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after

__all__ = ["Air", "Flight", "fit_flight", "straight"]

Array = NDArray[np.float64]

LAGS = np.geomspace(0.02, 30, 24)  # of the time a flight is seen: how slow a pattern may be
ODDS = 10.0  # residuals that show this much less than a pattern should are still its own
NORMAL_95 = 1.959964


@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """What bends a flight."""

    drag: float = 0.0  # κ of dv/dx = -κ v [1/m]
    drag_u: float = 0.0
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
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


def straight(t: Array, places: Array, air: Air) -> Array:
    """Return places (frame, 2) as they were without gravity: a straight line's."""
    return np.asarray(places - 0.5 * np.outer(t**2, air.gravity))


def fit_flight(
    t: Array,
    places: Array,
    u: Array,
    pattern_u: float,
    air: Air,
    moment: float,
    *,
    rough: bool = False,
) -> Flight:
    """Return the straight flight through places, told for a moment.

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
        Time that place and velocity are told for, of the contact [s].
    rough
        The uncertainty is that of the residuals' scatter alone: quick, for a search.
    """
    tau = t - moment
    level = straight(tau, places, air)
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
    return Flight(
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
    # told by few residuals, and by nothing else
    from scipy.special import stdtrit

    wide = (float(stdtrit(2 * spare, 0.975)) / NORMAL_95) ** 2
    return np.asarray(wide * (noise + power * worst) - noise)
