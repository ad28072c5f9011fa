"""A struck bat on its pivot: the turn that its bearing and the air slow, and the ring in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["coast", "ring", "slowed", "time_to_rest", "time_to_turn", "turned"]

Array = NDArray[np.float64]

ORDER = 14
TURNS = 12
ROOTS, DOUBLE_WEIGHTS = np.polynomial.legendre.leggauss(10)
NODES, WEIGHTS = (1 + ROOTS) / 2, DOUBLE_WEIGHTS / 2  # on 0 to 1


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


def time_to_rest(rate: Array, *, constant: float, linear: float, quadratic: float) -> Array:
    """Return when a bat of `rate` [rad/s], of either sense, comes to rest [s]; inf where never.

    Friction as in `coast`. ∫ dω / (constant + linear ω + quadratic ω²) from 0 to the rate.
    """
    speed = np.abs(rate)
    if constant == 0:
        return np.where(speed == 0, 0.0, np.inf)
    square = linear**2 - 4 * constant * quadratic
    base = 2 * constant + linear * speed
    reach = speed * np.sqrt(abs(square)) / base
    whole = np.arctanh(reach) if square > 0 else np.arctan(reach)
    share = np.where(reach > 0, whole / np.where(reach > 0, reach, 1.0), 1.0)
    return np.asarray(2 * speed / base * share)


def slowed(rate: Array, time: Array, *, constant: float, linear: float, quadratic: float) -> Array:
    """Return the rate [rad/s] a `time` [s] after `rate`; friction as in `coast`, of either sense.

    The solution of the Riccati equation in closed form; a bat that came to rest stays so.
    """
    if constant == linear == quadratic == 0 or not np.any(rate):
        return np.asarray(rate + 0 * time)
    friction = {"constant": constant, "linear": linear, "quadratic": quadratic}
    rest = time_to_rest(rate, **friction)
    left = _left(np.abs(rate), np.minimum(time, rest), **friction)
    return np.asarray(np.sign(rate) * np.where(time < rest, left, 0.0))


def turned(rate: Array, time: Array, *, constant: float, linear: float, quadratic: float) -> Array:
    """Return the angle turned [rad] in `time` [s] from `rate`; friction as in `slowed`.

    Gauss's rule with ten nodes on the closed form: to rounding while viscous and air torque
    take no more than two thirds of the rate.
    """
    if constant == linear == quadratic == 0 or not np.any(rate):
        return np.asarray(rate * time)
    friction = {"constant": constant, "linear": linear, "quadratic": quadratic}
    turning = np.minimum(time, time_to_rest(rate, **friction))
    at_nodes = _left(np.abs(rate)[..., None], turning[..., None] * NODES, **friction)
    return np.asarray(np.sign(rate) * turning * (at_nodes @ WEIGHTS))


def time_to_turn(
    rate: Array, way: Array, *, constant: float, linear: float, quadratic: float
) -> Array:
    """Return when a bat has turned `way` [rad], of the sense of its rate [s]; inf where never."""
    friction = {"constant": constant, "linear": linear, "quadratic": quadratic}
    rest = time_to_rest(rate, **friction)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(way == 0, 0.0, np.abs(way / rate))
        for _ in range(TURNS):  # of Newton, from below: friction only slows
            time = np.minimum(time, rest)
            short = np.abs(way) - np.abs(turned(rate, time, **friction))
            time = time + short / np.abs(slowed(rate, time, **friction))
    return np.where(np.isfinite(time) & (time < rest), time, np.inf)


def _left(speed: Array, time: Array, *, constant: float, linear: float, quadratic: float) -> Array:
    """Return the speed [rad/s] left after times [s] up to that of rest."""
    square = linear**2 - 4 * constant * quadratic
    half = np.sqrt(abs(square)) / 2
    way = time
    if half > 0:
        way = (np.tanh(half * time) if square > 0 else np.tan(half * time)) / half
    left = speed * (1 - linear / 2 * way) - constant * way
    return np.asarray(left / (1 + (linear / 2 + quadratic * speed) * way))


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
