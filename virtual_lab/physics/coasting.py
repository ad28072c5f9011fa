"""A struck bat on its pivot: the turn that its bearing and the air slow, and the ring in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["coast", "ring"]

Array = NDArray[np.float64]

ORDER = 14


def coast(rate: Array, time: Array, *, constant: float, linear: float, quadratic: float) -> Array:
    """Return the angle turned since release [rad], shape (shot, sample).

    Solves dω/dt = -(constant + linear ω + quadratic ω²) by its power series, whose
    coefficients follow from each other; the series is exact to rounding while
    (linear + 2 quadratic ω) t is below about 1/4, and this is asserted.

    Parameters
    ----------
    rate
        Rate at release [rad/s], shape (shot,).
    time
        Time since release [s], shape (shot, sample).
    constant, linear, quadratic
        Bearing and air torques divided by the moment of inertia [rad/s², 1/s, 1/rad].
    """
    reach = (linear + 2 * quadratic * np.abs(rate).max(initial=0.0)) * time.max(initial=0.0)
    if reach > 0.25:
        raise ValueError(f"friction of {reach:.3g} over the record, the series needs at most 0.25")
    powers = [np.asarray(rate, dtype=float)]
    for k in range(ORDER):
        product = np.sum([powers[i] * powers[k - i] for i in range(k + 1)], axis=0)
        slope = -(constant * (k == 0) + linear * powers[k] + quadratic * product)
        powers.append(slope / (k + 1))
    angle = np.zeros_like(time)
    for k in reversed(range(ORDER + 1)):
        angle = angle * time + powers[k][:, None] / (k + 1)
    return angle * time


def ring(
    turn: Array,
    displacement: Array,
    velocity: Array,
    angular_frequency: Array,
    damping_ratio: float,
    time: Array,
) -> Array:
    """Return the decaying bending part of the angle at a section [rad], shape (shot, sample).

    Parameters
    ----------
    turn
        Turn of the section a unit of each modal coordinate, shape (shot, mode).
    displacement, velocity
        Modal coordinates and their rates at release, shape (shot, mode).
    angular_frequency
        Undamped, shape (mode,) [rad/s].
    damping_ratio
        Of every mode, a share of critical.
    time
        Since release, shape (shot, sample) [s].
    """
    decay = damping_ratio * angular_frequency
    damped = angular_frequency * np.sqrt(1 - damping_ratio**2)
    sine = (velocity + decay * displacement) / damped
    angle = np.zeros_like(time)
    # mode by mode, as (shot, sample, mode) at once would not stay in the cache
    for mode in range(len(angular_frequency)):
        phase = damped[mode] * time
        swing = displacement[:, mode, None] * np.cos(phase) + sine[:, mode, None] * np.sin(phase)
        angle += turn[:, mode, None] * np.exp(-decay[mode] * time) * swing
    return angle
