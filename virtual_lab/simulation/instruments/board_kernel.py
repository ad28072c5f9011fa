"""What light boards write of many balls, every edge or sums over the beams; compiled."""

from __future__ import annotations

from math import ceil, floor, nan, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.relations.flight_kernel import BLOCK, FAST, time_over
from virtual_lab.units import Array

Rows = NDArray[np.int64]
CENTRE_PHASES = 64  # of a centre between two beams


class Way(NamedTuple):
    """Rows of `Passage.way`."""

    pace: int = 0
    drag: int = 1
    height: int = 2
    slope: int = 3
    plane: int = 4


WAY = Way()


class Boards(NamedTuple):
    """The boards as they stand [SI]."""

    distances: Array  # (board,)
    heights: Array  # (board,)
    clock: float
    tick: float
    lowest: float
    pitch: float
    beams: int
    radius: float  # of the ball
    gravity: float


@njit(cache=True, fastmath=FAST, error_model="numpy")
def write_edges(
    records: Array, flights: Array, start: Array, out: bool, boards: Boards, reach: Array
) -> None:
    """Turn what the clock is off by into the times of edges that boards show, one way.

    About a board a flight is a straight line of its own slope; NaN: the ball passes by a beam.

    Parameters
    ----------
    records
        (shot, board, 2 beam + edge) [s], in whole ticks thereafter.
    flights, start
        (5, shot) of `Passage.way`; when each ball is at the target [s], (shot,).
    out
        Whether the ball comes back.
    reach
        How far from the ball's centre each beam trips, (board, beam) [m].
    """
    sign, edges = 1.0 if out else -1.0, 2 * boards.beams
    known = np.empty((3, BLOCK))
    way, pace, drag, time = np.empty((4, edges))
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        flight, (since, height, steep) = flights[:, first : first + n], known[:, :n]
        for board in range(boards.distances.size):
            _pass(flight, boards.distances[board], boards.gravity, since, height, steep)
            for i in range(n):
                lean, ahead = 1 + steep[i] ** 2, boards.distances[board] - flight[WAY.plane, i]
                bottom = height[i] - boards.heights[board] - boards.lowest
                pace[:], drag[:] = flight[WAY.pace, i], flight[WAY.drag, i]
                for beam in range(boards.beams):
                    above = bottom - boards.pitch * beam
                    root = (steep[i] * above) ** 2 - lean * (above**2 - reach[board, beam] ** 2)
                    half = sign * sqrt(root) / lean if root > 0 else nan
                    middle = ahead - steep[i] * above / lean
                    way[2 * beam], way[2 * beam + 1] = middle - half, middle + half
                time_over(way, pace, drag, time)
                shown = records[first + i, board]
                for edge in range(edges):
                    shown[edge] += boards.clock * (start[first + i] + sign * time[edge])
                if boards.tick:
                    for edge in range(edges):
                        shown[edge] = np.rint(shown[edge] / boards.tick) * boards.tick


@njit(cache=True, fastmath=FAST, error_model="numpy")
def sum_up(
    records: Array, flights: Array, start: Array, out: bool, boards: Boards, gains: Array
) -> None:
    """Turn standard normal numbers into the times and heights that boards sum up, one way.

    Parameters
    ----------
    records
        (2, board, shot): what passages and heights are off by, of 1; then what is recorded.
    flights, start
        (5, shot) of `Passage.way`; when each ball is at the target [s], (shot,).
    out
        Whether the ball comes back.
    gains
        (3, row) of `gain_table`: u of the passage [s], of the way flown as a time [s], of the
        height by thresholds [m].
    """
    sign = 1.0 if out else -1.0
    known, rows = np.empty((6, BLOCK)), np.empty(BLOCK, dtype=np.int64)
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        flight, began = flights[:, first : first + n], start[first : first + n]
        since, height, steep, u, u_way, u_trip = known[:, :n]
        for board in range(boards.distances.size):
            _pass(flight, boards.distances[board], boards.gravity, since, height, steep)
            for i in range(n):
                height[i] -= boards.heights[board]
                u[i] = (height[i] - boards.lowest) / boards.pitch
            rows_of_gains(u, boards.beams, boards.radius / boards.pitch, rows[:n])
            for i in range(n):
                u[i], u_way[i], u_trip[i] = gains[0, rows[i]], gains[1, rows[i]], gains[2, rows[i]]
            time, tall = records[:, board, first : first + n]
            for i in range(n):
                pace = sign * flight[WAY.pace, i]
                off = tall[i] * sqrt((u_way[i] / pace) ** 2 + u_trip[i] ** 2)
                late = time[i] * u[i] + off * steep[i] * pace
                time[i] = boards.clock * (began[i] + sign * since[i]) + late
                tall[i] = nan if np.isnan(late) else height[i] + off


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _pass(
    flight: Array, distance: float, gravity: float, since: Array, height: Array, steep: Array
) -> None:
    """Fill in when, how high and how steeply balls pass a distance [s, m, 1]."""
    for i in range(since.size):
        height[i] = distance - flight[WAY.plane, i]
    time_over(height, flight[WAY.pace], flight[WAY.drag], since)
    for i in range(since.size):
        fall = gravity * since[i]
        height[i] = flight[WAY.height, i] + flight[WAY.slope, i] * height[i] - fall * since[i] / 2
        steep[i] = flight[WAY.slope, i] - fall * flight[WAY.pace, i]


@njit(cache=True, fastmath=FAST, error_model="numpy")
def rows_of_gains(centre: Array, beams: int, radius: float, rows: Rows) -> None:
    """Fill in the rows of `gain_table` for centres above the lowest beam, both in pitches.

    Beams missing above are beams missing below, upside down.
    """
    most = float(int(2 * radius) + 1)
    for i in range(rows.size):
        below = max(-ceil(centre[i] - radius), 0.0)
        above = max(floor(centre[i] + radius) - (beams - 1), 0.0)
        missing = max(below, above)
        missing = missing if missing < most else most  # which is where no ball is
        place = -centre[i] if above > below else centre[i]
        phase = place - floor(place)
        phase = phase if phase >= 0.0 else 0.0
        rows[i] = int(missing * (CENTRE_PHASES + 1) + floor(phase * CENTRE_PHASES + 0.5))
