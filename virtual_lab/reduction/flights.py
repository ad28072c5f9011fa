"""Passages to flights: speeds at the target, offset and slope, by least squares over the gates.

With quadratic drag the time to a distance is a known function of the distance over the speed
there, so time is linear in 1/speed whatever the number of gates.
"""

from __future__ import annotations

from collections.abc import Mapping
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
    reach_in = [time_before(distance, 1.0, drag) for distance in distances]
    reach_out = [time_before(distance, 1.0, -drag) for distance in distances]
    speed_in = _speed(reach_in, seen.times[:, INBOUND], clock, toward=True)
    speed_out = _speed(reach_out, seen.times[:, OUTBOUND], clock, toward=False)
    unknown = np.full(np.shape(speed_in), np.nan)
    if f"{stage}.gates.height_0" not in x:
        return Flights(speed_in=speed_in, speed_out=speed_out, offset=unknown, slope_out=unknown)
    zeros = [x[f"{stage}.gates.height_{index}"] for index in gates]
    offset, _ = _line(x, distances, zeros, reach_in, seen.heights[:, INBOUND], speed_in)
    _, slope = _line(x, distances, zeros, reach_out, seen.heights[:, OUTBOUND], speed_out)
    return Flights(speed_in=speed_in, speed_out=speed_out, offset=offset, slope_out=slope)


def _speed(reach: list[Array], times: Array, clock: Array, *, toward: bool) -> Array:
    """Return the slope of reach over time: a weighted sum of differences from the first gate."""
    if len(reach) == 2:
        apart = (reach[0] - reach[1]) * (-1.0 if toward else 1.0)
        return np.asarray(apart * clock / (times[:, 0] - times[:, 1]))
    known = np.isfinite(times)
    count = known.sum(axis=-1)
    many = np.where(count >= 2, count, np.nan)
    mean_time = np.where(known, times, 0.0).sum(axis=-1) / many
    mean_reach = sum(np.where(known[:, k], reach[k], 0.0) for k in range(len(reach))) / many
    both: Array | float = 0.0
    square: Array | float = 0.0
    for k, way in enumerate(reach):
        off = np.where(known[:, k], way - mean_reach, 0.0)
        both = both + off * np.where(known[:, k], times[:, k] - mean_time, 0.0)
        square = square + off**2
    both = np.where(count >= 2, both, np.nan)
    return np.asarray(square * clock / both * (-1.0 if toward else 1.0))


def _line(
    x: Mapping[str, Array],
    distances: list[Array],
    zeros: list[Array],
    reach: list[Array],
    heights: Array,
    speed: Array,
) -> tuple[Array, Array]:
    """Return height at the target and slope of the straight line that gravity bends, per shot."""
    known = np.isfinite(heights)
    count = known.sum(axis=-1)
    many = np.where(count >= 2, count, np.nan)
    fall = x["bench.pendulum.gravity"] / 2 / speed**2
    level = [
        np.where(known[:, k], heights[:, k] + zeros[k] + fall * reach[k] ** 2, 0.0)
        for k in range(len(distances))
    ]
    mean_height = sum(level) / many
    mean_way = sum(np.where(known[:, k], distances[k], 0.0) for k in range(len(distances))) / many
    both: Array | float = 0.0
    square: Array | float = 0.0
    for k, distance in enumerate(distances):
        off = np.where(known[:, k], distance - mean_way, 0.0)
        both = both + off * (level[k] - mean_height)
        square = square + off**2
    slope = both / np.where(count >= 2, square, np.nan)
    return np.asarray(mean_height - slope * mean_way), np.asarray(slope)
