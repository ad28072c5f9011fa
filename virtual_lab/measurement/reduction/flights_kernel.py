"""Compiled least squares over the gates for many balls and many sets of constants."""

from __future__ import annotations

from math import expm1, nan

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.relations.flight import SERIES, SERIES_BELOW
from virtual_lab.relations.flight_kernel import FAST
from virtual_lab.units import INNER, KERNEL, Array

SIGNS = (-1.0, 1.0)  # slope of time over distance: negative for incoming balls, positive after


@njit(**KERNEL, fastmath=FAST, error_model="numpy")
def fit_speeds(
    times: Array,
    batch: NDArray[np.int64],
    distances: Array,
    clock: Array,
    drag: Array,
    out: Array,
) -> None:
    """Fill `out` with the speeds of the balls at the target [m/s], (direction, row, shot).

    Direction 0 is toward the target, direction 1 is away from it. Speeds are positive in both
    directions. A row is one set of constants: distances, clock rate and drag rate. A speed is NaN
    if fewer than two gates detected the ball in its direction.

    Parameters
    ----------
    times
        Times at which the balls passed the gates [s], (batch, direction, gate, shot). A time is NaN
        if the gate did not detect the ball. A batch is a group of rows with the same times.
    batch
        Index of the batch of each row, (row,).
    distances
        Distances of the gates from the target, (row, gate) [m].
    clock
        Rate of the gates' clock: recorded time divided by true time, (row,).
    drag
        Drag rate κ, (row, shot) [1/m].
    out
        Result.
    """
    gates, shots = times.shape[2:]
    unit_times, moments = np.empty((gates, shots)), np.empty((4, shots))
    for row in range(batch.size):
        for direction in range(2):
            speed = out[direction, row]
            _fill_unit_times(distances[row], SIGNS[direction], drag[row], unit_times)
            _line(times[batch[row], direction], unit_times, moments, speed)
            for i in range(shots):
                speed[i] *= SIGNS[direction] * clock[row]


@njit(**KERNEL, fastmath=FAST, error_model="numpy")
def fit_heights(
    heights: Array,
    batch: NDArray[np.int64],
    speeds: Array,
    distances: Array,
    zeros: Array,
    gravity: Array,
    drag: Array,
    out: Array,
) -> None:
    """Compute the height of each shot at the target, and the slopes of its flights in and out.

    The results are computed for several sets of constants. Each set is a row of the arrays below.

    The height is measured on the incoming ball. A slope is the change of height per meter of
    distance from the target, without the effect of gravity. A slope is NaN if fewer than two gates
    detected the ball in this direction. The height is NaN if the slope in is NaN.

    Parameters
    ----------
    heights
        Heights at which the balls passed the gates, (batch, direction, gate, shot) [m]. Rows that
        use the same heights share a batch.
    batch
        Index of the batch of each row, (row,).
    speeds
        Result of `fit_speeds`.
    distances
        Distances of the gates from the target, (row, gate) [m].
    zeros
        Zero corrections of the gates, (row, gate) [m]. They are added to `heights`.
    gravity
        Acceleration of gravity, (row,) [m/s²].
    drag
        Drag rate κ, (row, shot) [1/m].
    out
        Results, (3, row, shot): height at the target [m], slope in, and slope out.
    """
    gates, shots = heights.shape[2:]
    # three arrays, because numba would compile again for views of one array
    shape = gates, shots
    unit_times, level, places = np.empty(shape), np.empty(shape), np.empty(shape)
    moments = np.empty((4, shots))
    for row in range(batch.size):
        for gate in range(gates):
            places[gate, :] = distances[row, gate]
        for direction in range(2):
            _fill_unit_times(distances[row], SIGNS[direction], drag[row], unit_times)
            height, speed, slope = (
                heights[batch[row], direction],
                speeds[direction, row],
                out[1 + direction, row],
            )
            for gate in range(gates):
                for i in range(shots):
                    since = unit_times[gate, i] / speed[i]
                    fallen = gravity[row] / 2 * since**2
                    level[gate, i] = height[gate, i] + zeros[row, gate] + fallen
            _line(places, level, moments, slope)
            if direction == 0:
                for i in range(shots):
                    out[0, row, i] = moments[2, i] - slope[i] * moments[1, i]


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _fill_unit_times(distances: Array, sign: float, drag: Array, unit_times: Array) -> None:
    """Fill `unit_times`, (gate, shot), with the times to the gates for speed 1 at the target."""
    for gate in range(distances.size):
        distance, long = distances[gate], 0
        for i in range(drag.size):
            x = sign * drag[i] * distance
            total = SERIES[0]
            for k in range(1, len(SERIES)):
                total = total * x + SERIES[k]
            unit_times[gate, i] = distance * total
            long += abs(x) > SERIES_BELOW
        if long:
            for i in range(drag.size):
                x = sign * drag[i] * distance
                if abs(x) > SERIES_BELOW:
                    unit_times[gate, i] = expm1(x) / (sign * drag[i])


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _line(across: Array, up: Array, moments: Array, slope: Array) -> None:
    """Fill `slope` with least-squares slopes of `up` over `across`, (gate, shot), without NaN.

    A slope is NaN if fewer than two gates detected the ball. `moments` receives the number of gates
    and the means of `across` and `up`.
    """
    gates, n = len(across), slope.size
    count, x_mean, y_mean, square = moments[0], moments[1], moments[2], moments[3]
    moments[:] = 0.0
    slope[:] = 0.0
    for gate in range(gates):
        for i in range(n):
            finite = abs(across[gate, i]) + abs(up[gate, i]) < np.inf
            count[i] += 1.0 if finite else 0.0
            x_mean[i] += across[gate, i] if finite else 0.0
            y_mean[i] += up[gate, i] if finite else 0.0
    for i in range(n):
        divisor = count[i] if count[i] >= 2.0 else nan
        x_mean[i] /= divisor
        y_mean[i] /= divisor
    for gate in range(gates):
        for i in range(n):
            finite = abs(across[gate, i]) + abs(up[gate, i]) < np.inf
            deviation = across[gate, i] - x_mean[i] if finite else 0.0
            rise = up[gate, i] - y_mean[i] if finite else 0.0
            slope[i] += deviation * rise
            square[i] += deviation * deviation
    for i in range(n):
        slope[i] /= square[i] if count[i] >= 2.0 else nan
