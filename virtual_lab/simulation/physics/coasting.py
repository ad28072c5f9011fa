"""A struck bat on its pivot: the turn that its bearing and the air slow, and the ring in it."""

from __future__ import annotations

from math import ceil, log

import numpy as np

from virtual_lab.units import Array


def coasting(
    rate: Array, ticks: Array, release: Array, *, constant: float, linear: float, quadratic: float
) -> tuple[Array, Array]:
    """Return two factors of the angle turned since release [rad], (shot, term), (term, sample).

    Their product is that angle from release on; the first term is the same at all ticks. It solves
    dω/dt = -(constant + linear ω + quadratic ω²), bearing and air torques over the moment of
    inertia [rad/s², 1/s, 1/rad], by its power series, whose coefficients follow from each other;
    the series is exact to rounding while (linear + 2 quadratic ω) t is below about 1/4, and this is
    asserted. Rates [rad/s] and times [s] of `release` are (shot,), `ticks`, which all share,
    (sample,).
    """
    longest = max(ticks.max(initial=0.0) - release.min(initial=0.0), 0.0)
    reach = (linear + 2 * quadratic * np.abs(rate).max(initial=0.0)) * longest
    if reach > 0.25:
        raise ValueError(f"friction of {reach:.3g} over the record, the series needs at most 0.25")
    rounding = 1e-17
    order = min(max(ceil(log(rounding) / log(max(reach, rounding))), 2), 14)
    powers = [np.asarray(rate, dtype=float)]
    for k in range(order):
        product = np.sum([powers[i] * powers[k - i] for i in range(k + 1)], axis=0)
        slope = -(constant * (k == 0) + linear * powers[k] + quadratic * product)
        powers.append(slope / (k + 1))
    series = np.stack([np.zeros_like(powers[0]), *powers])
    series[1:] /= np.arange(1, len(series))[:, None]
    # about one moment for all shots the series is a product of two matrices
    middle = release.mean() if release.size else 0.0
    _shift(series, middle - release)
    return series.T, np.vander(ticks - middle, len(series), increasing=True).T


def _shift(series: Array, by: Array) -> None:
    """Move the origin of power series, (power, shot), by so much further on: Horner's scheme."""
    last = len(series) - 1
    for first in range(last):
        for power in range(last - 1, first - 1, -1):
            series[power] += by * series[power + 1]


def ringing(
    turn: Array,
    displacement: Array,
    velocity: Array,
    angular_frequency: Array,
    damping_ratio: float,
    ticks: Array,
    release: Array,
) -> tuple[Array, Array]:
    """Return two factors of the bending part of the angle at a section, which rings out [rad].

    Shapes (shot, term) and (term, sample); their product is that angle from release on. `turn` of
    the section a unit of each modal coordinate, coordinates and rates at release are (shot, mode),
    undamped frequencies (mode,) [rad/s]; the damping ratio is a share of critical. Times as of
    `coasting`.
    """
    decay = damping_ratio * angular_frequency
    damped = angular_frequency * np.sqrt(1 - damping_ratio**2)
    sine = (velocity + decay * displacement) / damped
    # a ring is the real part of a turning arrow: who began it when turns the arrow once, and
    # what is left is a product of two matrices, over modes
    pace = 1j * damped - decay
    middle = release.mean() if release.size else 0.0
    arrow = turn * (displacement - 1j * sine) * np.exp(-np.outer(release - middle, pace))
    turning = np.exp(np.outer(pace, ticks - middle))
    return np.hstack([arrow.real, -arrow.imag]), np.vstack([turning.real, turning.imag])
