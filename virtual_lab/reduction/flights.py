"""Passages to flights: speeds at the target, offset and slope, by least squares over the gates.

With quadratic drag the time to a distance is a known function of the distance over the speed
there, so time is linear in 1/speed whatever the number of gates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.reduction.gates import INBOUND, OUTBOUND, Passages
from virtual_lab.relations.flight import time_before

__all__ = ["Flights", "flights", "gate_count"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flights:
    """What the gates say of each shot, (..., shot); NaN: they do not."""

    speed_in: Array  # at the target [m/s]
    speed_out: Array
    offset: Array  # height of the ball's centre at the target, above the gates' zero [m]
    slope_out: Array  # height gained a metre on the way back


def gate_count(x: Mapping[str, object], stage: str) -> int:
    """Return how many gates a stage's calibration knows."""
    return sum(key.startswith(f"{stage}.gates.distance_") for key in x)


def flights(x: Mapping[str, Array], stage: str, seen: Passages, drag: Array) -> Flights:
    """Return the flights of a stage's balls.

    Parameters
    ----------
    x
        Constants, numbers or columns (k, 1): distances of the gates, their heights where they
        measure them, the clock.
    seen
        Passages, (shot, way, gate).
    drag
        κ of each ball, (..., shot) [1/m].
    """
    gates = range(gate_count(x, stage))
    distances = [x[f"{stage}.gates.distance_{index}"] for index in gates]
    clock = x[f"{stage}.gates.clock"]
    times = _by_gate(seen.times)
    reach_in = [time_before(distance, 1.0, drag) for distance in distances]
    reach_out = [time_before(distance, 1.0, -drag) for distance in distances]
    speed_in = -clock * _slope(times[INBOUND], reach_in)
    speed_out = clock * _slope(times[OUTBOUND], reach_out)
    if f"{stage}.gates.height_0" not in x:
        unknown = np.full(np.shape(speed_in), np.nan)
        return Flights(speed_in=speed_in, speed_out=speed_out, offset=unknown, slope_out=unknown)
    zeros = [x[f"{stage}.gates.height_{index}"] for index in gates]
    heights = _by_gate(seen.heights)
    fall = x["bench.pendulum.gravity"] / 2

    def level(way: int, reach: list[Array], speed: Array) -> list[Array]:
        """Return the heights without gravity, which are those of a straight line."""
        dropped = fall / speed**2
        return [heights[way][k] + zeros[k] + dropped * reach[k] ** 2 for k in gates]

    rising = level(INBOUND, reach_in, speed_in)
    slope_in = _slope(distances, rising)
    known = np.isfinite(heights[INBOUND])
    offset = _mean(rising, known) - slope_in * _mean(distances, known)
    slope_out = _slope(distances, level(OUTBOUND, reach_out, speed_out))
    return Flights(speed_in=speed_in, speed_out=speed_out, offset=offset, slope_out=slope_out)


def _by_gate(values: Array) -> Array:
    """Return (shot, way, gate) as (way, gate, shot): whole shots lie side by side."""
    return np.ascontiguousarray(values.transpose(1, 2, 0))


def _slope(across: Sequence[Array], up: Sequence[Array]) -> Array:
    """Return the least-squares slope of `up` over `across`, gate by gate where both are known.

    NaN where fewer than two gates saw the ball.
    """
    known = [np.isfinite(a) & np.isfinite(b) for a, b in zip(across, up, strict=True)]
    x_mean, y_mean = _mean(across, known), _mean(up, known)
    both: Array | float = 0.0
    square: Array | float = 0.0
    whole = all(each.all() for each in known)
    for k, (a, b) in enumerate(zip(across, up, strict=True)):
        off, rise = a - x_mean, b - y_mean
        if not whole:
            off, rise = np.where(known[k], off, 0.0), np.where(known[k], rise, 0.0)
        both = both + off * rise
        square = square + off**2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(both / square)


def _mean(values: Sequence[Array], known: Sequence[NDArray[np.bool_]]) -> Array:
    """Return the mean over the gates that know."""
    if all(each.all() for each in known):
        return np.asarray(sum(values) / len(values))
    count = sum(each.astype(float) for each in known)
    total = sum(np.where(each, value, 0.0) for each, value in zip(known, values, strict=True))
    return np.asarray(total / np.where(count >= 2, count, np.nan))
