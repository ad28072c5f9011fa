"""Least squares over the gates for many balls, block by block; compiled."""

from __future__ import annotations

from math import nan

import numpy as np
from numba import njit

from virtual_lab.relations.flight_kernel import BLOCK, FAST, time_over
from virtual_lab.units import Array

SIGNS = (-1.0, 1.0)  # of the ways: a ball comes and its time falls with the distance, it goes


@njit(cache=True, fastmath=FAST, error_model="numpy")
def fit_speeds(times: Array, distances: Array, clock: Array, drag: Array, out: Array) -> None:
    """Fill in speeds at the target, in and out, (way, row, shot) [m/s].

    Parameters
    ----------
    times
        (way, gate, shot) [s]; NaN: not seen.
    distances, clock
        (row, gate) [m] and (row,): rows are sets of constants.
    drag
        κ (row, shot) [1/m], or one row for all sets.
    """
    gates, shots = times.shape[1:]
    reach, moments = np.empty((gates, BLOCK)), np.empty((3, BLOCK))
    for row in range(len(distances)):
        for first in range(0, shots, BLOCK):
            part = slice(first, min(first + BLOCK, shots))
            own = drag[min(row, len(drag) - 1), part]
            for way in range(2):
                speed = out[way, row, part]
                _reaches(distances[row], SIGNS[way], own, reach)
                _line(times[way, :, part], reach, moments, speed)
                for i in range(speed.size):
                    speed[i] *= SIGNS[way] * clock[row]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def fit_heights(
    heights: Array,
    speeds: Array,
    distances: Array,
    zeros: Array,
    gravity: Array,
    drag: Array,
    out: Array,
) -> None:
    """Fill in heights at the target on the way in [m] and slopes in and out, (3, row, shot).

    Without gravity the heights are those of a straight line. `speeds` as from `fit_speeds`,
    `zeros` (row, gate) of the gates [m], `gravity` (row,) [m/s²], the others as there.
    """
    gates, shots = heights.shape[1:]
    reach, level = np.empty((gates, BLOCK)), np.empty((gates, BLOCK))
    places = np.empty((gates, BLOCK))
    moments, slope = np.empty((3, BLOCK)), np.empty(BLOCK)
    for row in range(len(distances)):
        for gate in range(gates):
            places[gate, :] = distances[row, gate]
        for first in range(0, shots, BLOCK):
            part = slice(first, min(first + BLOCK, shots))
            own = drag[min(row, len(drag) - 1), part]
            n = own.size
            for way in range(2):
                _reaches(distances[row], SIGNS[way], own, reach)
                speed = speeds[way, row, part]
                for gate in range(gates):
                    shown = heights[way, gate, part]
                    for i in range(n):
                        since = reach[gate, i] / speed[i]
                        fallen = gravity[row] / 2 * since**2
                        level[gate, i] = shown[i] + zeros[row, gate] + fallen
                _line(places[:, :n], level, moments, slope[:n])
                for i in range(n):
                    out[1 + way, row, first + i] = slope[i]
                    if way == 0:
                        out[0, row, first + i] = moments[2, i] - slope[i] * moments[1, i]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _reaches(distances: Array, sign: float, drag: Array, reach: Array) -> None:
    """Fill in the times to the gates of balls of speed 1 at the target, (gate, shot)."""
    n = drag.size
    signed, way, pace = np.empty(n), np.empty(n), np.ones(n)
    for i in range(n):
        signed[i] = sign * drag[i]
    for gate in range(distances.size):
        way[:] = distances[gate]
        time_over(way, pace, signed, reach[gate, :n])


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _line(across: Array, up: Array, moments: Array, slope: Array) -> None:
    """Fill in least-squares slopes of `up` over `across`, (gate, shot), where both are known.

    NaN if fewer than two gates saw the ball. `moments` then hold the number of gates, and the
    means of both.
    """
    gates, n = len(across), slope.size
    count, x_mean, y_mean = moments[0, :n], moments[1, :n], moments[2, :n]
    square = np.zeros(n)
    moments[:] = 0.0
    slope[:] = 0.0
    for gate in range(gates):
        for i in range(n):
            known = abs(across[gate, i]) + abs(up[gate, i]) < np.inf
            count[i] += 1.0 if known else 0.0
            x_mean[i] += across[gate, i] if known else 0.0
            y_mean[i] += up[gate, i] if known else 0.0
    for i in range(n):
        many = count[i] if count[i] >= 2.0 else nan
        x_mean[i] /= many
        y_mean[i] /= many
    for gate in range(gates):
        for i in range(n):
            known = abs(across[gate, i]) + abs(up[gate, i]) < np.inf
            off = across[gate, i] - x_mean[i] if known else 0.0
            rise = up[gate, i] - y_mean[i] if known else 0.0
            slope[i] += off * rise
            square[i] += off * off
    for i in range(n):
        slope[i] /= square[i] if count[i] >= 2.0 else nan
