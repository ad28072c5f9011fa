"""Compiled reduction of board edges to passages: a line and a parabola over the beams."""

from __future__ import annotations

from math import nan, sqrt

import numpy as np
from numba import njit

from virtual_lab.units import INNER, KERNEL, Array

Beams = tuple[Array, Array, Array]  # positions, midpoints and squared chords of broken beams
FAINTEST = 1e-2  # smallest squared chord used for a weight [longest squared chord]
FAST = {"reassoc", "contract", "nsz"}


@njit(**KERNEL, error_model="numpy")
def fit_boards(edges: Array, times: Array, heights: Array, heights_u: Array, misfit: Array) -> None:
    """Fill `times`, `heights`, `heights_u` and `misfit` from the beam edges of light boards.

    A beam edge is the time at which a ball breaks or clears a beam. Two curves are fitted over the
    positions of the broken beams: a line to the middle times of the interruptions, and a parabola
    to their squared durations. The results of a board are NaN if the ball broke fewer than four of
    its beams. They are also NaN if the fitted height is too far from the mean height of the broken
    beams. The limit is the beam spacing times the number of all beams of the board. The misfit is
    NaN if no board has a result.

    Parameters
    ----------
    edges
        Times of the edges, (shot, direction, board, beam, edge) [s].
    times, heights, heights_u
        Time [s] and height [beams above the lowest] of the passages, and u of the height [beams],
        (shot, direction, board).
    misfit
        Rms deviation of the edges from the fitted lines and parabolas, (shot, direction) [s].
    """
    shots, directions, boards, beams, _ = edges.shape
    places, middles, squares = np.empty((3, beams))
    for shot in range(shots):
        for direction in range(directions):
            rest, degrees = 0.0, 0
            for board in range(boards):
                count, scale = _collect(edges[shot, direction, board], places, middles, squares)
                broken = places[:count], middles[:count], squares[:count]
                times[shot, direction, board] = heights[shot, direction, board] = nan
                heights_u[shot, direction, board] = nan
                if count < 4:  # too few for a parabola with a misfit
                    continue
                about = broken[0].mean()
                for i in range(count):
                    places[i] -= about
                top, top_u, off_top = _top(broken, scale)
                if not abs(top) < beams:
                    continue
                mean, lean, off_line = _line(broken)
                times[shot, direction, board] = mean + lean * top
                heights[shot, direction, board] = about + top
                heights_u[shot, direction, board] = top_u
                rest += off_line + off_top / 4
                degrees += 2 * count - 5
            misfit[shot, direction] = sqrt(rest / degrees) if degrees > 0 else nan


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _collect(edges: Array, places: Array, middles: Array, squares: Array) -> tuple[int, float]:
    """Collect the broken beams with relative chords. Return their number and longest chord [s]."""
    count, longest = 0, 0.0
    for beam in range(len(edges)):
        chord = edges[beam, 1] - edges[beam, 0]
        if abs(chord) < np.inf:
            places[count], middles[count] = beam, (edges[beam, 0] + edges[beam, 1]) / 2
            squares[count] = chord
            longest = max(longest, chord)
            count += 1
    scale = longest if longest > 0 else 1.0
    for i in range(count):
        squares[i] = (squares[i] / scale) ** 2
    return count, scale


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _top(broken: Beams, scale: float) -> tuple[float, float, float]:
    """Return the position of the maximum of the parabola through the squared chords, and its u.

    The third result is the squared misfit. The noise of an edge changes a squared chord in
    proportion to the chord, but the threshold of a beam changes every squared chord equally.
    Thresholds dominate the uncertainty of the maximum, so all squared chords are assumed to scatter
    equally, which slightly overestimates the effect of the edges.
    """
    places, _, squares = broken
    s0, s1, s2, s3, s4 = 0.0, 0.0, 0.0, 0.0, 0.0
    r0, r1, r2 = 0.0, 0.0, 0.0
    for i in range(places.size):
        x, y = places[i], squares[i]
        w = 1 / max(y, FAINTEST)
        s0, s1, s2, s3, s4 = s0 + w, s1 + w * x, s2 + w * x**2, s3 + w * x**3, s4 + w * x**4
        r0, r1, r2 = r0 + w * y, r1 + w * y * x, r2 + w * y * x**2
    # normal equations, solved by elimination
    d11, d12, d22 = s2 - s1 * s1 / s0, s3 - s1 * s2 / s0, s4 - s2 * s2 / s0
    q1, q2 = r1 - s1 * r0 / s0, r2 - s2 * r0 / s0
    b2 = (q2 - d12 / d11 * q1) / (d22 - d12 / d11 * d12)
    b1 = (q1 - d12 * b2) / d11
    b0 = (r0 - s1 * b1 - s2 * b2) / s0
    top = -b1 / (2 * b2)
    misfit, scatter, gain = 0.0, 0.0, 0.0
    for i in range(places.size):
        x, y = places[i], squares[i]
        rest = y - b0 - b1 * x - b2 * x**2
        misfit += (scale * rest) ** 2 / (4 * max(y, FAINTEST))
        scatter += rest**2 / (places.size - 3)
        # sensitivity of the maximum to this square
        tilt, bend = x - s1 / s0, x**2 - s2 / s0
        bend = (bend - d12 / d11 * tilt) / (d22 - d12 / d11 * d12)
        tilt = (tilt - d12 * bend) / d11
        gain += ((tilt + 2 * top * bend) / (2 * b2 * max(y, FAINTEST))) ** 2
    return top, sqrt(scatter * gain), misfit


@njit(**INNER, fastmath=FAST, error_model="numpy")
def _line(broken: Beams) -> tuple[float, float, float]:
    """Return mean and slope of the line through the middles, and the squared misfit."""
    places, middles, _ = broken
    mean, product, spread, misfit = middles.mean(), 0.0, 0.0, 0.0
    for i in range(places.size):
        product += places[i] * (middles[i] - mean)
        spread += places[i] ** 2
    lean = product / spread
    for i in range(places.size):
        misfit += (middles[i] - mean - lean * places[i]) ** 2
    return mean, lean, misfit
