"""Compiled flights of many balls, in blocks that fit in the first-level cache.

Each loop applies one operation to a whole block, which suits vector instructions.
"""

from __future__ import annotations

from math import expm1

from numba import njit

from virtual_lab.relations.flight import SERIES, SERIES_BELOW
from virtual_lab.units import INNER, Array

BLOCK = 256
# The only flag is nsz, so NaN stays NaN. Contraction is not allowed, because the last bits of a
# result would then depend on its position in a block.
FAST = {"nsz"}


@njit(**INNER, fastmath=FAST, error_model="numpy")
def time_over(distance: Array, pace: Array, drag: Array, out: Array) -> None:
    """Fill `out` with the times of flight [s] over the distances `way`, one per shot.

    All arrays have the shape (shot,).

    Parameters
    ----------
    way
        Distances, always positive [m].
    pace
        1/speed at one end of each flight [s/m].
    drag
        κ [1/m] if the speed is known at the start of the flight, -κ if it is known at the end.
    out
        Result.
    """
    long = 0
    for i in range(out.size):
        x = drag[i] * distance[i]
        total = SERIES[0]
        for k in range(1, len(SERIES)):
            total = total * x + SERIES[k]
        out[i] = distance[i] * pace[i] * total
        long += abs(x) > SERIES_BELOW
    if long:
        for i in range(out.size):
            x = drag[i] * distance[i]
            if abs(x) > SERIES_BELOW:
                out[i] = pace[i] * expm1(x) / drag[i]
