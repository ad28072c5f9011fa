"""Compiled flights of many balls, in blocks that fit in the first-level cache.

Each loop applies one operation to a whole block, which suits vector instructions.
"""

from __future__ import annotations

from math import expm1

from numba import njit

from virtual_lab.relations.flight import SERIES, SERIES_BELOW
from virtual_lab.units import Array

BLOCK = 256
# The only flag is nsz, so NaN stays NaN. Contraction is not allowed, because the last bits of a
# result would then depend on its position in a block.
FAST = {"nsz"}


@njit(cache=True, fastmath=FAST, error_model="numpy")
def time_over(way: Array, pace: Array, drag: Array, out: Array) -> None:
    """Fill `out` with the time of flight [s] over a distance, from the speed at one of its ends.

    All arrays are (shot,). `way` is the distance [m], always positive. `pace` is 1/speed [s/m] at
    the end where the speed is known. `drag` is κ [1/m] if the flight starts at this end, and -κ if
    it stops there.
    """
    long = 0
    for i in range(out.size):
        x = drag[i] * way[i]
        total = SERIES[0]
        for k in range(1, len(SERIES)):
            total = total * x + SERIES[k]
        out[i] = way[i] * pace[i] * total
        long += abs(x) > SERIES_BELOW
    if long:
        for i in range(out.size):
            x = drag[i] * way[i]
            if abs(x) > SERIES_BELOW:
                out[i] = pace[i] * expm1(x) / drag[i]
