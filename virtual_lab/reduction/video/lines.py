"""A straight flight through a ball's places: on time stamps, drag and gravity known, never free.

The uncertainty knows two kinds of error. Noise is new in every frame. The ball's own pattern moves
its apparent centre slowly, as it turns: neighbouring frames err alike, residuals hide it, and the
slope takes it all. How large it is the pictures tell; how slow, the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from virtual_lab.relations.flight import distance_after

__all__ = ["Air", "Flight", "fit_flight", "straight"]

Array = NDArray[np.float64]

LAGS = np.geomspace(0.02, 30, 24)  # of the time a flight is seen: how slow a pattern may be
NEIGHBOURS = 3  # lags on either side of the likeliest that are taken as possible
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
    t: Array, places: Array, u: Array, pattern_u: float, air: Air, moment: float
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
    covariance, chi_square = _covariance(t, residuals, u, pattern_u, design, solver)
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


def _covariance(
    t: Array, residuals: Array, u: Array, pattern_u: float, design: Array, solver: Array
) -> tuple[Array, float]:
    """Return the covariance of place and velocity, and χ² of noise alone per degree of freedom."""
    count = len(t)
    noise = (solver * u**2) @ solver.T
    spare = count - 2
    if spare < 1:
        return noise + pattern_u**2 * solver @ solver.T, float("nan")
    chi_square = float(np.sum((residuals / u[:, None]) ** 2)) / (2 * spare)
    excess = float(np.sum(residuals**2 - u[:, None] ** 2 * spare / count)) / (2 * spare)
    left = np.eye(count) - design @ solver
    span = float(np.ptp(t))
    seen, slow = [], []
    for lag in LAGS * span:
        like = np.exp(-0.5 * ((t[:, None] - t) / lag) ** 2)
        seen.append(float(np.trace(left @ like @ left.T)) / spare)
        slow.append(solver @ like @ solver.T)
    # what the residuals show beyond noise the pattern may have made, or something unknown
    power = max(pattern_u**2, excess / seen[0])
    if excess <= 0 and pattern_u == 0:
        return noise, chi_square
    likely = int(np.argmin(np.abs(power * np.array(seen) - max(excess, 0.0))))
    near = slow[max(0, likely - NEIGHBOURS) : likely + NEIGHBOURS + 1]
    worst = max(near, key=lambda each: float(each[1, 1]))
    covariance = noise + power * worst
    if excess > pattern_u**2:  # told by few residuals, and by nothing else
        covariance = covariance * (float(stdtrit(2 * spare, 0.975)) / NORMAL_95) ** 2
    return covariance, chi_square
