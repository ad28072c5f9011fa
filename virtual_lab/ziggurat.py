"""The normal numbers numpy makes of a stream of bits, made faster; compiled.

Marsaglia and Tsang's ziggurat in numpy's form, bit for bit: the same tables, the same bits in
the same order. numpy calls its source of bits anew for each number; here a whole run of bits
is there before it is read.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log1p

import numpy as np
from numba import njit
from numba.np.random import _constants as tables  # numpy's own, which numpy does not show
from numpy.typing import NDArray

__all__ = ["normal_numbers"]

Floats = NDArray[np.float64]
Bits = NDArray[np.uint64]
RUN = 16_384  # words at a time: they stay in the nearer caches
MOST = 64  # words; that one number takes more is beyond all chance
WIDTHS, INSIDE, HEIGHTS = tables.wi_double, tables.ki_double.astype(np.int64), tables.fi_double
TAIL = float(tables.ziggurat_nor_r)  # where the lowest layer's tail begins


def normal_numbers(words: Callable[[int], Bits], count: int) -> Floats:
    """Return `count` standard normal numbers of the bits that `words` gives, and uses up."""
    out = np.empty(count)
    left = np.empty(0, dtype=np.uint64)
    filled = 0
    while filled < count:
        bits = np.concatenate((left, words(min(RUN, count - filled + MOST))))
        filled, used = _fill(bits, out, filled)
        left = bits[used:]
    return out


@njit(cache=True)
def _unit(word: np.uint64) -> float:
    """Return a uniform number in [0, 1) of a word's upper 53 bits."""
    return float(word >> np.uint64(11)) * 2.0**-53


@njit(cache=True)
def _fill(bits: Bits, out: Floats, filled: int) -> tuple[int, int]:
    """Go on filling `out` while words last; return how much of it is full, and words used."""
    used = 0
    while filled < out.size and used + MOST <= bits.size:
        word = bits[used]
        used += 1
        layer = np.intp(word & np.uint64(0xFF))
        size = np.int64(word >> np.uint64(9)) & 0xFFFFFFFFFFFFF
        x = size * WIDTHS[layer]
        if word & np.uint64(0x100):
            x = -x
        if size >= INSIDE[layer]:
            if layer > 0:
                step = HEIGHTS[layer - 1] - HEIGHTS[layer]
                inside = step * _unit(bits[used]) + HEIGHTS[layer] < exp(-0.5 * x * x)
                used += 1
                if not inside:
                    continue
            else:
                beyond, height = 1.0, 0.0
                while height + height <= beyond * beyond:
                    beyond = -(1 / TAIL) * log1p(-_unit(bits[used]))
                    height = -log1p(-_unit(bits[used + 1]))
                    used += 2
                x = -(TAIL + beyond) if size >> 8 & 1 else TAIL + beyond
        out[filled] = x
        filled += 1
    return filled, used
