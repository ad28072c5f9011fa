"""Compiled records of summing gates for many balls."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from numba import njit

from virtual_lab.relations.flight_kernel import BLOCK, FAST, time_over
from virtual_lab.units import INNER, Array


class Way(NamedTuple):
    """Rows of `Passage.trajectory_rows`."""

    pace: int = 0
    drag: int = 1
    height: int = 2
    slope: int = 3
    plane: int = 4


WAY = Way()


@njit(**INNER, fastmath=FAST, error_model="numpy")
def pass_gate(
    flight: Array, distance: Array, gravity: Array, since: Array, height: Array, steep: Array
) -> None:
    """Compute the time, height and slope of each ball at a gate, and write them to three arrays.

    All arrays are (shot,), except `flight`. The results are NaN for a shot without a ball.

    Parameters
    ----------
    flight
        Trajectory parameters from `Passage.trajectory_rows`, (5, shot).
    distance
        Distance of the gate from the target [m].
    gravity
        Acceleration of gravity [m/s²].
    since
        Result: time between gate and target [s], before contact for an incoming ball and after
        release for a rebound.
    height
        Result: height of the ball's center above the line of fire [m].
    steep
        Result: slope, the change of height per distance from the target [m/m].
    """
    for i in range(since.size):
        height[i] = distance[i] - flight[WAY.plane, i]
    time_over(height, flight[WAY.pace], flight[WAY.drag], since)
    for i in range(since.size):
        fall = gravity[i] * since[i]
        height[i] = flight[WAY.height, i] + flight[WAY.slope, i] * height[i] - fall * since[i] / 2
        steep[i] = flight[WAY.slope, i] - fall * flight[WAY.pace, i]


class Gates(NamedTuple):
    """True constants of the gates for each shot [SI]."""

    distances: Array  # (gate, shot)
    clock: Array  # (shot,)
    gravity: Array  # (shot,)
    half_height: float


@njit(cache=True, fastmath=FAST, error_model="numpy")
def sum_up_gates(
    records: Array, flights: Array, start: Array, out: bool, gates: Gates, jitter: float
) -> None:
    """Compute the recorded times of the passages in one direction, in place.

    An incoming ball is detected at any height. A rebounding ball is detected only within the height
    of the gates.

    Parameters
    ----------
    records
        Array (shot, direction, gate). Before the call it holds standard normal numbers. After the
        call, one direction holds the recorded times [s]. A time is NaN if the ball was not
        detected. The other direction is not changed.
    flights
        Trajectory parameters from `Passage.trajectory_rows`, (5, shot).
    start
        Times at the target, (shot,) [s].
    out
        Direction to compute: True for the rebounding ball, False for the incoming ball.
    gates
        True constants of the gates.
    jitter
        Standard uncertainty of the time of a passage [s].
    """
    sign, passage = 1.0 if out else -1.0, np.empty((3, BLOCK))
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        shots = slice(first, first + n)
        flight, gravity, (since, height, steep) = (
            flights[:, shots],
            gates.gravity[shots],
            passage[:, :n],
        )
        for gate in range(len(gates.distances)):
            pass_gate(flight, gates.distances[gate, shots], gravity, since, height, steep)
            for i in range(n):
                time = gates.clock[first + i] * (start[first + i] + sign * since[i])
                time += jitter * records[first + i, int(out), gate]
                detected = not out or abs(height[i]) < gates.half_height
                records[first + i, int(out), gate] = time if detected else nan
