"""Motion of a struck bat on its pivot: a rotation slowed by bearing and air, with vibration."""

from __future__ import annotations

from math import ceil, log

import numpy as np

from virtual_lab.units import Array


def coasting(
    rate: Array, ticks: Array, release: Array, *, constant: float, linear: float, quadratic: float
) -> tuple[Array, Array]:
    """Return two matrices A (shot, term) and B (term, sample) for the rotation of a coasting bat.

    The product A B, (shot, sample), is the angle turned since release [rad]. It is valid for
    samples after the release. The angular rate ω solves dω/dt = -(constant + linear ω + quadratic
    ω²).

    Parameters
    ----------
    rate
        Angular rate at release, (shot,) [rad/s].
    ticks
        Times of the samples, common to all shots, (sample,) [s].
    release
        Time of the release, (shot,) [s].
    constant, linear, quadratic
        Torques of bearing and air divided by the moment of inertia: coefficients of the powers 0, 1
        and 2 of ω [rad/s², 1/s, 1/rad].

    Raises
    ------
    ValueError
        (linear + 2 quadratic ω) t exceeds 1/4, where ω is the largest rate and t the longest time
        after a release. The power series of the angle would not be accurate.
    """
    longest = max(ticks.max(initial=0.0) - release.min(initial=0.0), 0.0)
    friction = (linear + 2 * quadratic * np.abs(rate).max(initial=0.0)) * longest
    if friction > 0.25:
        raise ValueError(
            f"friction of {friction:.3g} over the record, the series needs at most 0.25"
        )
    rounding = 1e-17
    order = min(max(ceil(log(rounding) / log(max(friction, rounding))), 2), 14)
    powers = [np.asarray(rate, dtype=float)]
    for k in range(order):
        product = np.sum([powers[i] * powers[k - i] for i in range(k + 1)], axis=0)
        slope = -(constant * (k == 0) + linear * powers[k] + quadratic * product)
        powers.append(slope / (k + 1))
    series = np.stack([np.zeros_like(powers[0]), *powers])
    series[1:] /= np.arange(1, len(series))[:, None]
    # Expanded about one common time, the series is a product of two matrices.
    middle = release.mean() if release.size else 0.0
    _shift(series, middle - release)
    return series.T, np.vander(ticks - middle, len(series), increasing=True).T


def _shift(series: Array, by: Array) -> None:
    """Move the origin of the power series, (power, shot), by `by`, (shot,), in place (Horner)."""
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
    """Return two matrices A (shot, term) and B (term, sample) for the decaying vibration of a bat.

    The matrix product A B has the shape (shot, sample). It is the rotation due to bending of the
    bat's cross section at the pivot [rad]. It is valid for samples after the release.

    Parameters
    ----------
    turn
        Rotation of this cross section per unit of each modal coordinate, (shot, mode) [kg^-1/2
        m^-1].
    displacement, velocity
        Modal coordinates and their rates of change at release, (shot, mode) [kg^1/2 m, kg^1/2 m/s].
    angular_frequency
        Undamped angular frequencies, (mode,) [rad/s].
    damping_ratio
        Share of critical damping, below 1.
    ticks, release
        Times of the samples, (sample,), and of the release, (shot,) [s].
    """
    decay = damping_ratio * angular_frequency
    damped = angular_frequency * np.sqrt(1 - damping_ratio**2)
    sine = (velocity + decay * displacement) / damped
    # A decaying vibration is the real part of a rotating phasor. The state at release fixes the
    # phasor of each shot and mode; the rest is a product of two matrices over the modes.
    pace = 1j * damped - decay
    middle = release.mean() if release.size else 0.0
    arrow = turn * (displacement - 1j * sine) * np.exp(-np.outer(release - middle, pace))
    turning = np.exp(np.outer(pace, ticks - middle))
    return np.hstack([arrow.real, -arrow.imag]), np.vstack([turning.real, turning.imag])
