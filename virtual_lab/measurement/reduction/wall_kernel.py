"""Compiled means of the hits at the wall, for many sets of constants at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import guvectorize

from virtual_lab.files.caches import one_process_at_a_time

ROW = "float64[:]"


@one_process_at_a_time(
    guvectorize(  # type: ignore[no-untyped-call]
        [f"void({ROW}, int64[:], {','.join([ROW] * 7)})"],
        "(ball),(hit),(hit),(hit),(hit)->(ball),(ball),(),()",
        nopython=True,
        cache=True,
    )
)
def balls_of_sets(
    masses: Any,
    ball: Any,
    nominal: Any,
    speed_in: Any,
    speed_out: Any,
    restitution: Any,
    faster: Any,
    speed: Any,
    slope: Any,
) -> None:
    """Return mean e0 and excess speed of each ball, the mean nominal speed, and the slope of e0.

    This is a generalized ufunc: it takes the first five arguments and returns the other four.
    `masses` is (..., ball) and only gives the number of balls. `ball`, `nominal`, `speed_in` and
    `speed_out` are (..., hit): the index of the ball, and three speeds [m/s]. A hit with a negative
    ball index is ignored.

    The results are:

    * `restitution`, (..., ball): mean e0 of each ball;
    * `faster`, (..., ball): excess speed of each ball, which is the mean measured speed of the
      ball's hits minus the mean nominal speed of all hits [m/s];
    * `speed`, (...): mean nominal speed of all hits [m/s];
    * `slope`, (...): slope of e0 over speed [s/m].

    The slope is computed from differences within each ball. It is the slope of e0 over the nominal
    speed, divided by the slope of the measured speed over the nominal speed. A direct fit over the
    measured speed would be biased, because an error of this speed also affects e0. The results of a
    ball without hits are NaN. The slope is NaN if all hits have the same nominal speed.
    """
    counts, middle = np.zeros(masses.size), np.zeros(masses.size)
    restitution[:], faster[:], speed[0] = 0.0, 0.0, 0.0
    for i in range(ball.size):
        number = ball[i]
        if number >= 0:
            counts[number] += 1
            middle[number] += nominal[i]
            speed[0] += nominal[i]
            restitution[number] += speed_out[i] / speed_in[i]
    speed[0] /= counts.sum()
    for number in range(masses.size):
        restitution[number] /= counts[number]
        middle[number] /= counts[number]
    rise, width = 0.0, 0.0
    for i in range(ball.size):
        number = ball[i]
        if number >= 0:
            faster[number] += (speed_in[i] - speed[0]) / counts[number]
            deviation = nominal[i] - middle[number]
            rise += speed_out[i] / speed_in[i] * deviation
            width += speed_in[i] * deviation
    slope[0] = rise / width
