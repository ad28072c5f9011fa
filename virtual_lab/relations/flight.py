"""Flight of a ball in still air over a short straight line, with quadratic drag: dv/dx = -κ v.

With κ = ρ C_d A / (2 m) the speed decreases as e^(-κx), so the times are exact for every κ and
speed. κ = 0 is flight without air. For baseballs see A. M. Nathan, Am. J. Phys. 76 (2008) 119.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.units import STANDARD_GRAVITY, Array

SERIES_BELOW = 0.03  # largest argument at which the series is exact to rounding
SERIES = tuple(1 / factorial(n + 1) for n in reversed(range(8)))


def drag_rate(
    air_density: ArrayLike, drag_coefficient: ArrayLike, radius: ArrayLike, mass: ArrayLike
) -> Array:
    """Return the drag rate κ = ρ C_d π R² / (2 m) [1/m], in the broadcast shape of the arguments.

    The arguments are the density of the air [kg/m³], the drag coefficient, and the radius [m] and
    mass [kg] of the ball.
    """
    area = np.pi * np.square(radius)
    return np.asarray(np.asarray(air_density) * drag_coefficient * area / (2 * np.asarray(mass)))


def time_before(distance: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the time of flight [s] over `distance` [m], from the speed at the end of the flight.

    `speed` is in m/s. `drag` is the drag rate κ [1/m], 0 without air. The arguments broadcast.
    """
    distance = np.asarray(distance)
    return np.asarray(distance * _exprel(-np.asarray(drag) * distance) / np.asarray(speed))


def time_after(distance: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the time of flight [s] over `distance` [m], from the speed at the start of the flight.

    `speed` is in m/s. `drag` is the drag rate κ [1/m], 0 without air. The arguments broadcast.
    """
    return time_before(distance, speed, -np.asarray(drag))


def distance_after(time: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the distance [m] that a ball flies in `time` [s], from its speed at the start.

    `speed` is in m/s. `drag` is the drag rate κ [1/m], 0 without air. The arguments broadcast.
    """
    path = np.asarray(np.asarray(speed) * time)
    loss = np.asarray(drag) * path
    # log1p(x) / x, with the limit 1 at 0
    share = np.log1p(loss) / np.where(loss == 0, 1.0, loss)
    return np.asarray(path * np.where(loss == 0, 1.0, share))


def speed_after(time: ArrayLike, speed: ArrayLike, drag: ArrayLike) -> Array:
    """Return the speed [m/s] of a ball after a flight of `time` [s], from its speed at the start.

    `speed` is in m/s. `drag` is the drag rate κ [1/m], 0 without air. The arguments broadcast.
    """
    return np.asarray(speed / (1 + np.asarray(drag) * speed * np.asarray(time)))


def slowest_within(distance: ArrayLike, drop: float) -> Array:
    """Return the lowest speed [m/s] at which a ball falls at most `drop` [m] over `distance` [m].

    The speed is x √(g / (2 h)), where x is `distance`, h is `drop` and g is standard gravity. The
    ball starts horizontally, and there is no air. `drop` must be above 0. The result has the shape
    of `distance`.
    """
    return np.asarray(np.asarray(distance) * np.sqrt(STANDARD_GRAVITY / (2 * drop)))


def _exprel(x: Array) -> Array:
    """Return (e^x - 1)/x. A series is faster for the small x of distances in a hall.

    Each result depends only on its own x, not on the other elements.
    """
    series = np.full_like(x, SERIES[0])
    for coefficient in SERIES[1:]:
        series *= x
        series += coefficient
    if (far := np.abs(x) > SERIES_BELOW).any():
        from scipy.special import exprel  # takes half a second to load, too long for a page

        return np.where(far, exprel(x), series)
    return series
