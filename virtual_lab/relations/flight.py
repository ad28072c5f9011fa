"""A ball in still air over a short straight line: quadratic drag, dv/dx = -κ v.

With κ = ρ C_d A / (2 m) the speed falls as e^(-κx), so the time over a distance is exact in
κ at any speed; κ = 0 is the ball without air. Of baseballs: A. M. Nathan, Am. J. Phys. 76 (2008)
119.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.units import STANDARD_GRAVITY, Array

SERIES_BELOW = 0.03  # below it what the series leaves out is less than rounding
SERIES = tuple(1 / factorial(n + 1) for n in reversed(range(8)))


def drag_rate(
    air_density: ArrayLike, drag_coefficient: ArrayLike, radius: ArrayLike, mass: ArrayLike
) -> Array:
    """Return κ = ρ C_d π R² / (2 m) [1/m]."""
    area = np.pi * np.square(radius)
    return np.asarray(np.asarray(air_density) * drag_coefficient * area / (2 * np.asarray(mass)))


def time_before(distance: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the time from `distance` [m] ahead of a place to the place, passed at `speed`."""
    distance = np.asarray(distance)
    return np.asarray(distance * _exprel(-np.asarray(drag) * distance) / np.asarray(speed))


def time_after(distance: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the time from a place, left at `speed` [m/s], to `distance` [m] beyond it."""
    return time_before(distance, speed, -np.asarray(drag))


def distance_after(time: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the way [m] flown in `time` [s] from a place left at `speed` [m/s]."""
    way = np.asarray(np.asarray(speed) * time)
    lost = np.asarray(drag) * way
    # log1p(x) / x, which is 1 at 0
    share = np.log1p(lost) / np.where(lost == 0, 1.0, lost)
    return np.asarray(way * np.where(lost == 0, 1.0, share))


def speed_after(time: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the speed [m/s] a `time` [s] after a place left at `speed`."""
    return np.asarray(speed / (1 + np.asarray(drag) * speed * np.asarray(time)))


def slowest_within(distance: ArrayLike, drop: float) -> Array:
    """Return the speed [m/s] at which a ball set off level falls `drop` [m] over `distance` [m].

    x √(g / 2h), without air: a slower one falls farther.
    """
    return np.asarray(np.asarray(distance) * np.sqrt(STANDARD_GRAVITY / (2 * drop)))


def _exprel(x: Array) -> Array:
    """Return (e^x - 1)/x. Over a hall's distances x is so small that its series is quicker.

    Each by its own x alone, whatever stands beside it.
    """
    series = np.full_like(x, SERIES[0])
    for coefficient in SERIES[1:]:
        series *= x
        series += coefficient
    if (far := np.abs(x) > SERIES_BELOW).any():
        from scipy.special import exprel  # half a second to load, that a page must not wait for

        return np.where(far, exprel(x), series)
    return series
