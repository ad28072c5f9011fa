"""Compiled counter-based random numbers: Philox4x32-10 and the inverse normal distribution.

Philox (Salmon, Moraes, Dror, Shaw, Parallel random numbers: as easy as 1, 2, 3, SC11) returns two
words of 64 bits for each counter of four words and key of two. AS 241 (PPND16, Wichura, Applied
Statistics 37, 1988) converts each word to a normal number. All operations are defined by IEEE
arithmetic and none is contracted, so a number has the same bits on every machine. Each loop applies
one operation to a chunk that fits in the first-level cache, which suits vector instructions.
"""

from __future__ import annotations

from math import log, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import INNER, KERNEL

Floats = NDArray[np.float64]
Words = NDArray[np.uint64]
Whole = NDArray[np.int64]
LOW, HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
WEYL = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)

ONE = np.uint64(0x3FF0000000000000)  # bits of 1.0
ROOT_HALF = np.int64(0x3FE6A09E667F3BCD)  # bits of √(1/2)
FRACTION = np.int64(52)
LN_2 = log(2.0)


@njit(**KERNEL)
def fill(
    key: tuple[int, int, int],
    laboratories: Whole,
    slots: Whole,
    each: int,
    normal: bool,
    out: Floats,
) -> bool:
    """Fill `out` with random numbers, and return whether all slots are from 0 to 2³² - 1.

    A slot is the number of a shot in its laboratory, or the number of a reading. Each slot has
    `each` random numbers. If a slot is outside the range, the result is False and `out` is not
    complete.

    The random number with the index i in a slot comes from the Philox counter (i // 2, slot,
    laboratory, third word of the key). It is the first of the two output words if i is even, and
    the second if i is odd.

    Parameters
    ----------
    key
        Three words of 32 bits. All laboratories of a study have the same key.
    laboratories
        Laboratory of each slot, (slot,), or one laboratory for all slots, (1,): whole numbers of 32
        bits.
    slots
        Slots, (slot,), whole numbers.
    each
        Number of random numbers per slot.
    normal
        True for standard normal numbers. Otherwise the numbers are uniform between -1/2 and 1/2 and
        never 0.
    out
        Result, (slot x each,), sorted by slot.
    """
    pairs = (each + 1) // 2
    chunk = min(256, slots.size * pairs)
    of_index, of_slot = np.empty(chunk, np.uint64), np.empty(chunk, np.uint64)
    of_laboratory, last = np.empty(chunk, np.uint64), laboratories.size - 1
    first, second = np.empty(chunk, np.uint64), np.empty(chunk, np.uint64)
    words, values = np.empty(2 * chunk, np.uint64), np.empty(2 * chunk)
    tails, at = np.empty(2 * chunk + 1), np.empty(2 * chunk + 1, np.int64)
    row, pair, filled = 0, 0, 0
    while filled < out.size:
        in_chunk, count = 0, 0
        begun, odd = pair, each % 2
        while in_chunk < chunk and row < slots.size:
            if slots[row] < 0 or slots[row] >= 2**32:
                return False
            more = min(chunk - in_chunk, pairs - pair)
            slot, laboratory = np.uint64(slots[row]), np.uint64(laboratories[min(row, last)])
            for i in range(more):
                of_index[in_chunk + i] = np.uint64(pair + i)
                of_slot[in_chunk + i] = slot
                of_laboratory[in_chunk + i] = laboratory
            in_chunk += more
            pair += more
            if pair == pairs:
                row, pair = row + 1, 0
        _philox(
            key, of_index[:in_chunk], of_slot[:in_chunk], of_laboratory[:in_chunk], first, second
        )
        if odd:
            for i in range(in_chunk):
                words[count] = first[i]
                words[count + 1] = second[i]
                begun += 1
                count += 1 if begun == pairs else 2
                begun = 0 if begun == pairs else begun
        else:
            count = 2 * in_chunk
            for i in range(in_chunk):
                words[2 * i] = first[i]
                words[2 * i + 1] = second[i]
        numbers = out[filled : filled + count]
        _uniform(words[:count], numbers)
        if normal:
            _normal(numbers, values, tails, at)
        filled += count
    return True


@njit(**INNER)
def _philox(
    key: tuple[int, int, int],
    index: Words,
    slot: Words,
    laboratory: Words,
    first: Words,
    second: Words,
) -> None:
    """Fill `first` and `second` with the two words of each counter."""
    for i in range(index.size):
        a, b, c, d = index[i], slot[i], laboratory[i], np.uint64(key[2])
        x, y = np.uint64(key[0]), np.uint64(key[1])
        for _ in range(10):
            p, q = a * MULTIPLIERS[0], c * MULTIPLIERS[1]
            a, b = (q >> HALF) ^ b ^ x, q & LOW
            c, d = (p >> HALF) ^ d ^ y, p & LOW
            x, y = (x + WEYL[0]) & LOW, (y + WEYL[1]) & LOW
        first[i] = a | b << HALF
        second[i] = c | d << HALF


@njit(**INNER)
def _uniform(words: Words, out: Floats) -> None:
    """Fill `out` with odd multiples of 2^-53 between -1/2 and 1/2. The words are overwritten."""
    for i in range(words.size):
        words[i] = words[i] >> np.uint64(12) | ONE  # the fraction of a double has 52 bits
    between = words.view(np.float64)  # numbers from 1 to 2
    for i in range(words.size):
        out[i] = between[i] - 1.5 + 2.0**-53


@njit(**INNER, error_model="numpy")
def _normal(numbers: Floats, values: Floats, tails: Floats, at: Whole) -> None:
    """Convert uniform numbers between -1/2 and 1/2 to normal numbers with the same quantiles."""
    for i in range(numbers.size):
        q = numbers[i]
        values[i] = q * _middle(0.180625 - q * q)
    many = 0
    for i in range(numbers.size):
        at[many] = i
        many += abs(numbers[i]) > 0.425
    for k in range(many):
        tails[k] = 0.5 - abs(numbers[at[k]])
    _root_log(tails[:many])
    for k in range(many):
        r = tails[k]
        tails[k] = _tail(r - 1.6) if r <= 5 else _far_tail(r - 5)
    for k in range(many):
        i = at[k]
        values[i] = tails[k] if numbers[i] > 0 else -tails[k]
    for i in range(numbers.size):
        numbers[i] = values[i]


@njit(**INNER, error_model="numpy")
def _root_log(x: Floats) -> None:
    """Replace each x by √(-ln x), 2^-1000 < x < 1, with ln as a series in (m - 1)/(m + 1)."""
    bits = x.view(np.int64)
    for k in range(x.size):
        exponent = (bits[k] - ROOT_HALF) >> FRACTION
        bits[k] -= exponent << FRACTION
        s = (x[k] - 1) / (x[k] + 1)
        t = s * s
        t *= _series(t)
        x[k] = sqrt(-(float(exponent) * LN_2 + 2 * (s + s * t)))


@njit(**INNER)
def _series(t: float) -> float:
    """Return 1/3 + t/5 + t²/7 …, t up to 0.03."""
    total = t / 21 + 1 / 19
    total = total * t + 1 / 17
    total = total * t + 1 / 15
    total = total * t + 1 / 13
    total = total * t + 1 / 11
    total = total * t + 1 / 9
    total = total * t + 1 / 7
    total = total * t + 1 / 5
    return total * t + 1 / 3


@njit(**INNER, error_model="numpy")
def _middle(r: float) -> float:
    top = 2509.0809287301226727 * r + 33430.575583588128105
    top = top * r + 67265.770927008700853
    top = top * r + 45921.953931549871457
    top = top * r + 13731.693765509461125
    top = top * r + 1971.5909503065514427
    top = top * r + 133.14166789178437745
    top = top * r + 3.387132872796366608
    under = 5226.495278852854561 * r + 28729.085735721942674
    under = under * r + 39307.89580009271061
    under = under * r + 21213.794301586595867
    under = under * r + 5394.1960214247511077
    under = under * r + 687.1870074920579083
    under = under * r + 42.313330701600911252
    return top / (under * r + 1)


@njit(**INNER, error_model="numpy")
def _tail(r: float) -> float:
    top = 7.7454501427834140764e-4 * r + 0.0227238449892691845833
    top = top * r + 0.24178072517745061177
    top = top * r + 1.27045825245236838258
    top = top * r + 3.64784832476320460504
    top = top * r + 5.7694972214606914055
    top = top * r + 4.6303378461565452959
    top = top * r + 1.42343711074968357734
    under = 1.05075007164441684324e-9 * r + 5.475938084995344946e-4
    under = under * r + 0.0151986665636164571966
    under = under * r + 0.14810397642748007459
    under = under * r + 0.68976733498510000455
    under = under * r + 1.6763848301838038494
    under = under * r + 2.05319162663775882187
    return top / (under * r + 1)


@njit(**INNER, error_model="numpy")
def _far_tail(r: float) -> float:
    top = 2.01033439929228813265e-7 * r + 2.71155556874348757815e-5
    top = top * r + 0.0012426609473880784386
    top = top * r + 0.026532189526576123093
    top = top * r + 0.29656057182850489123
    top = top * r + 1.7848265399172913358
    top = top * r + 5.4637849111641143699
    top = top * r + 6.6579046435011037772
    under = 2.04426310338993978564e-15 * r + 1.4215117583164458887e-7
    under = under * r + 1.8463183175100546818e-5
    under = under * r + 7.868691311456132591e-4
    under = under * r + 0.0148753612908506148525
    under = under * r + 0.13692988092273580531
    under = under * r + 0.59983220655588793769
    return top / (under * r + 1)
