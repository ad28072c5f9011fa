"""What gates that sum up write of many balls; compiled."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from numba import njit

from virtual_lab.relations.flight_kernel import BLOCK, FAST, time_over
from virtual_lab.units import Array


class Way(NamedTuple):
    """Rows of `Passage.way`."""

    pace: int = 0
    drag: int = 1
    height: int = 2
    slope: int = 3
    plane: int = 4


WAY = Way()


@njit(cache=True, fastmath=FAST, error_model="numpy")
def pass_gate(
    flight: Array, distance: Array, gravity: Array, since: Array, height: Array, steep: Array
) -> None:
    """Fill in when, how high and how steeply balls pass a distance [s, m, 1]."""
    for i in range(since.size):
        height[i] = distance[i] - flight[WAY.plane, i]
    time_over(height, flight[WAY.pace], flight[WAY.drag], since)
    for i in range(since.size):
        fall = gravity[i] * since[i]
        height[i] = flight[WAY.height, i] + flight[WAY.slope, i] * height[i] - fall * since[i] / 2
        steep[i] = flight[WAY.slope, i] - fall * flight[WAY.pace, i]


class Gates(NamedTuple):
    """Gates as they stand for each shot [SI]."""

    distances: Array  # (gate, shot)
    clock: Array  # (shot,)
    gravity: Array  # (shot,)
    half_height: float


@njit(cache=True, fastmath=FAST, error_model="numpy")
def sum_up_gates(
    records: Array, flights: Array, start: Array, out: bool, gates: Gates, jitter: float
) -> None:
    """Turn standard normal numbers into the times that gates sum up, one way.

    A level way in that no gate heeds the height of is seen whatever its height.

    Parameters
    ----------
    records
        (shot, gate): what passages are off by, of 1; then what is recorded [s], NaN: not seen.
    flights, start
        (5, shot) of `Passage.way`; when each ball is at the target [s], (shot,).
    out
        Whether the ball comes back.
    jitter
        Standard uncertainty of the time of a passage [s].
    """
    sign, known = 1.0 if out else -1.0, np.empty((3, BLOCK))
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        shots = slice(first, first + n)
        flight, gravity, (since, height, steep) = (
            flights[:, shots],
            gates.gravity[shots],
            known[:, :n],
        )
        for gate in range(len(gates.distances)):
            pass_gate(flight, gates.distances[gate, shots], gravity, since, height, steep)
            for i in range(n):
                time = gates.clock[first + i] * (start[first + i] + sign * since[i])
                time += jitter * records[first + i, gate]
                seen = not out or abs(height[i]) < gates.half_height
                records[first + i, gate] = time if seen else nan
