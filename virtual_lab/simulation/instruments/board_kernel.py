"""Compiled records of light boards for many balls: every edge, or sums over the beams."""

from __future__ import annotations

from math import ceil, floor, nan, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from virtual_lab.relations.flight_kernel import BLOCK, FAST, time_over
from virtual_lab.simulation.instruments.gate_kernel import WAY, pass_gate
from virtual_lab.units import INNER, Array

CENTRE_PHASES = 64  # number of tabulated positions of a center between two beams


class Boards(NamedTuple):
    """True constants of the boards for each shot [SI]."""

    distances: Array  # (board, shot)
    heights: Array  # (board, shot)
    clock: Array  # (shot,)
    gravity: Array  # (shot,)
    radius: Array  # (shot,), radius of the ball [pitches]
    tick: float
    lowest: float
    pitch: float
    beams: int


@njit(cache=True, fastmath=FAST, error_model="numpy")
def write_edges(
    records: Array, flights: Array, start: Array, out: bool, boards: Boards, trip_distance: Array
) -> None:
    """Compute the times at which the balls break and clear each beam, in place.

    The times of a beam that the ball misses are NaN. Near a board the flight is treated as a
    straight line.

    Parameters
    ----------
    records
        Array (shot, direction, board, edge). Before the call it holds the random errors of the
        times [s]. After the call it holds the recorded times, rounded to clock ticks [s]. Edge 2 i
        is the time at which beam i is broken, and edge 2 i + 1 the time at which it is cleared.
        Only the direction `out` is changed.
    flights
        Trajectory parameters from `Passage.trajectory_rows`, (5, shot).
    start
        Times at the target, (shot,) [s].
    out
        True for the rebounding ball, False for the incoming ball.
    boards
        True constants of the boards.
    trip_distance
        Distance from the ball's center at which each beam trips, (board, beam) [m].
    """
    sign, edges = 1.0 if out else -1.0, 2 * boards.beams
    passage = np.empty((3, BLOCK))
    path, pace, drag, time = np.empty((4, edges))
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        flight, (since, height, steep) = flights[:, first : first + n], passage[:, :n]
        for board in range(len(boards.distances)):
            distance = boards.distances[board, first : first + n]
            pass_gate(flight, distance, boards.gravity[first : first + n], since, height, steep)
            for i in range(n):
                lean, ahead = 1 + steep[i] ** 2, distance[i] - flight[WAY.plane, i]
                bottom = height[i] - boards.heights[board, first + i] - boards.lowest
                pace[:], drag[:] = flight[WAY.pace, i], flight[WAY.drag, i]
                for beam in range(boards.beams):
                    above = bottom - boards.pitch * beam
                    root = (steep[i] * above) ** 2 - lean * (
                        above**2 - trip_distance[board, beam] ** 2
                    )
                    half = sign * sqrt(root) / lean if root > 0 else nan
                    middle = ahead - steep[i] * above / lean
                    path[2 * beam], path[2 * beam + 1] = middle - half, middle + half
                time_over(path, pace, drag, time)
                edge_times = records[first + i, int(out), board]
                for edge in range(edges):
                    true = start[first + i] + sign * time[edge]
                    edge_times[edge] += boards.clock[first + i] * true
                if boards.tick:
                    for edge in range(edges):
                        edge_times[edge] = np.rint(edge_times[edge] / boards.tick) * boards.tick


@njit(cache=True, fastmath=FAST, error_model="numpy")
def sum_up(
    records: Array,
    flights: Array,
    start: Array,
    out: bool,
    boards: Boards,
    edge: float,
    depth_spread: float,
) -> None:
    """Compute the time and height of each ball's passage at each board, in place.

    Time and height are NaN if a ball breaks fewer than four beams of a board.

    Parameters
    ----------
    records
        Array (2, board, shot). Before the call it holds standard normal numbers. After the call it
        holds recorded times [s] in row 0 and recorded heights [m] in row 1.
    flights
        Trajectory parameters from `Passage.trajectory_rows`, (5, shot).
    start
        Times at the target, (shot,) [s].
    out
        True for the rebounding ball, False for the incoming ball.
    boards
        True constants of the boards.
    edge
        Standard uncertainty of the time at which a beam is broken or cleared [s].
    depth_spread
        Standard deviation, over the beams, of the depth of the ball at which a beam trips [m].
    """
    sign = 1.0 if out else -1.0
    passage, gains = np.empty((3, BLOCK)), np.empty((3, BLOCK))
    memory = gain_memory(boards.radius.max()) if start.size else np.empty((0, 4))
    for first in range(0, start.size, BLOCK):
        n = min(BLOCK, start.size - first)
        shots = slice(first, first + n)
        flight, began, (since, height, steep) = flights[:, shots], start[shots], passage[:, :n]
        for board in range(len(boards.distances)):
            distance = boards.distances[board, shots]
            pass_gate(flight, distance, boards.gravity[shots], since, height, steep)
            centre = gains[0, :n]
            for i in range(n):
                height[i] -= boards.heights[board, first + i]
                centre[i] = (height[i] - boards.lowest) / boards.pitch
            fill_gains(centre.copy(), boards.beams, boards.radius[shots], memory, gains[:, :n])
            time, tall = records[:, board, shots]
            for i in range(n):
                pace = sign * flight[WAY.pace, i]
                path_u = edge * gains[1, i] / pace
                deviation = tall[i] * sqrt(path_u**2 + (depth_spread * gains[2, i]) ** 2)
                delay = time[i] * (edge * gains[0, i]) + deviation * steep[i] * pace
                time[i] = boards.clock[first + i] * (began[i] + sign * since[i]) + delay
                tall[i] = nan if np.isnan(delay) else height[i] + deviation


@njit(cache=True)
def gain_memory(radius: float) -> Array:
    """Return a table of zeros in which `fill_gains` stores computed gains, (row, 4).

    A gain is the u of a time or height divided by the u of its cause, see `fill_gains`. There is
    one row for each combination of two numbers: the number of missing beams, and the rounded
    position of the ball between two beams. A row of zeros holds no gains yet. `radius` is the
    largest radius of the balls [beam pitches].
    """
    return np.zeros(((int(2 * radius) + 2) * (CENTRE_PHASES + 1), 4))


@njit(cache=True, error_model="numpy")
def fill_gains(centre: Array, beams: int, radius: Array, memory: Array, gains: Array) -> None:
    """Compute the sensitivity of the time and height of a passage to errors at the beams.

    A passage is the flight of a ball through a light board, a vertical row of beams. The result is
    written to `gains`, (3, n), one column per ball. Each row is a ratio of standard uncertainties
    u:

    * u of the time of the passage divided by u of the time at which a beam is broken or cleared
    * u of the height divided by u of the ball's position when a beam is broken or cleared
    * u of the height divided by u of the threshold of a beam

    The ratios are NaN if fewer than four beams were broken. The position of the ball's center
    between two beams is rounded to `CENTRE_PHASES` steps.

    Parameters
    ----------
    centre, radius
        Height of the ball's center above the lowest beam, and its radius, (n,) [beam pitches].
    beams
        Number of beams of a board.
    memory
        Table that `gain_memory` returns for the largest of the radii. It stores computed ratios,
        which are used again for other balls of the same radius. A ball of another radius overwrites
        the entries that it needs.
    gains
        Result, (3, n).
    """
    for i in range(centre.size):
        below = max(-ceil(centre[i] - radius[i]), 0.0)
        above = max(floor(centre[i] + radius[i]) - (beams - 1), 0.0)
        most = float(int(2 * radius[i]) + 1)
        missing = max(below, above)
        missing = missing if missing < most else most  # with all beams missing there is no ball
        place = -centre[i] if above > below else centre[i]
        phase = place - floor(place)
        phase = floor(phase * CENTRE_PHASES + 0.5) if phase >= 0.0 else 0.0
        entry = memory[int(missing * (CENTRE_PHASES + 1) + phase)]
        if entry[0] != radius[i]:
            entry[0] = radius[i]
            entry[1], entry[2], entry[3] = _gains(phase / CENTRE_PHASES, missing, radius[i])
        gains[0, i], gains[1, i], gains[2, i] = entry[1], entry[2], entry[3]


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _gains(phase: float, missing: float, radius: float) -> tuple[float, float, float]:
    """Return the three gains of `fill_gains` if the lowest `missing` beams are missing.

    The squared chords form a parabola, and the height follows from its slope at the center, by
    weighted least squares. The weight of a chord is limited to the weight of a tenth of the longest
    chord.
    """
    low, high = floor(phase - radius) + 1 + int(missing), ceil(phase + radius) - 1
    beam_count = high - low + 1
    if beam_count < 4:
        return nan, nan, nan
    middle = ((low + high) / 2 - phase) / radius
    m0, m1, m2, m3, m4 = 0.0, 0.0, 0.0, 0.0, 0.0  # moments of the weights
    spread = 0.0
    for beam in range(low, high + 1):
        place = (beam - phase) / radius
        square = place * place
        weight = 1 / max(1 - square, 1e-2)
        m0 += weight
        m1 += weight * place
        m2 += weight * square
        m3 += weight * square * place
        m4 += weight * square * square
        spread += (place - middle) * (place - middle)
    level, lean, bend = m2 * m3 - m1 * m4, m0 * m4 - m2 * m2, m1 * m2 - m0 * m3
    normal = m1 * level + m2 * lean + m3 * bend  # Cramer's rule for the row of the slope
    path_gain, depth_gain = 0.0, 0.0
    for beam in range(low, high + 1):
        place = (beam - phase) / radius
        square = 1 - place * place
        slope = (level + place * (lean + bend * place)) / (normal * max(square, 1e-2))
        path_gain += slope * slope * square
        depth_gain += slope * slope
    return (
        sqrt((1 / beam_count + middle * middle / spread) / 2),
        sqrt(path_gain / 2),
        sqrt(depth_gain),
    )
