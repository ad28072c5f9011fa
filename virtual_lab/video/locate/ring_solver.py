"""The edge fit's normal equations: a ring of small blocks, one a sector, and what they share.

Only neighbours in the ring meet, so the system is solved block after block; the last block and
the shared parameters are the border that every block meets.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.pixels import OPTIONS

__all__ = ["copy_into", "eliminate", "substitute"]

Floats = NDArray[np.float64]


@njit(**OPTIONS)
def copy_into(values: Floats, out: Floats) -> None:
    """Copy an array into one of the same shape: numba compiles `out[:] = values` for seconds."""
    for k in range(out.size):
        out.flat[k] = values.flat[k]


@njit(**OPTIONS)
def _factor(a: Floats) -> bool:
    """Replace a symmetric matrix by its lower Cholesky factor."""
    n = a.shape[0]
    for i in range(n):
        for j in range(i + 1):
            value = a[i, j]
            for k in range(j):
                value -= a[i, k] * a[j, k]
            if j < i:
                a[i, j] = value / a[j, j]
            elif value > 0.0:
                a[i, i] = sqrt(value)
            else:
                return False
    return True


@njit(**OPTIONS)
def _down(low: Floats, b: Floats, first: int) -> None:
    """Solve low x = b in place; b is (n, columns), those from the first on.

    No slices are passed: numba would compile everything once more for them.
    """
    n, columns = b.shape
    for i in range(n):
        for k in range(i):
            part = low[i, k]
            for c in range(first, columns):
                b[i, c] -= part * b[k, c]
        whole = 1.0 / low[i, i]
        for c in range(first, columns):
            b[i, c] *= whole


@njit(**OPTIONS)
def _up(low: Floats, b: Floats) -> None:
    """Solve low^T x = b in place; b is (n,)."""
    n = b.size
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= low[k, i] * b[k]
        b[i] /= low[i, i]


@njit(**OPTIONS)
def _take(a: Floats, b: Floats, out: Floats) -> None:
    """Subtract a^T b from out, of a as many columns as out has rows."""
    for k in range(a.shape[0]):
        for i in range(out.shape[0]):
            part = a[k, i]
            for j in range(b.shape[1]):
                out[i, j] -= part * b[k, j]


@njit(**OPTIONS)
def eliminate(blocks: Floats, links: Floats, border: Floats, shared: Floats) -> bool:
    """Factor the system in place, its right side with it.

    `blocks` (block, n, n) on the diagonal; `links` (block, n, n) from each to the next, the
    last's to the first; `border` (block, n, n + m + 1): room for the last block, what each block
    has with the shared parameters, and its right side; `shared` (n + m, n + m + 1) likewise.
    """
    count, n = blocks.shape[0], blocks.shape[1]
    last = count - 1
    m = shared.shape[0] - n
    for i in range(n):
        for j in range(n):
            border[0, i, j] += links[last, j, i]
            border[last - 1, i, j] += links[last - 1, i, j]
            shared[i, j] += blocks[last, i, j]
        for j in range(m + 1):
            shared[i, n + j] += border[last, i, n + j]
        for j in range(m):
            shared[n + j, i] += border[last, i, n + j]
    for k in range(last):
        if not _factor(blocks[k]):
            return False
        _down(blocks[k], border[k], 0)
        if k < last - 1:
            _down(blocks[k], links[k], 0)
            _take(links[k], links[k], blocks[k + 1])
            _take(links[k], border[k], border[k + 1])
        _take(border[k], border[k], shared)
    if not _factor(shared):
        return False
    _down(shared, shared, n + m)
    return True


@njit(**OPTIONS)
def substitute(
    blocks: Floats, links: Floats, border: Floats, shared: Floats, right: int, ring: Floats
) -> Floats:
    """Return the shared parameters of a factored system, and fill `ring` (block, n).

    `right`: -1 for the right side that was factored along, else the unit vector of a shared
    parameter.
    """
    count, n = blocks.shape[0], blocks.shape[1]
    total = shared.shape[0]
    whole = np.zeros((total, 1))
    if right < 0:
        for i in range(total):
            whole[i, 0] = shared[i, total]
    else:
        whole[n + right, 0] = 1.0
        _down(shared, whole, 0)
    end = whole.copy().reshape(total)
    _up(shared, end)
    for i in range(n):
        ring[count - 1, i] = end[i]
    for k in range(count - 2, -1, -1):
        for i in range(n):
            value = border[k, i, total] if right < 0 else 0.0
            for j in range(total):
                value -= border[k, i, j] * end[j]
            if k < count - 2:
                for j in range(n):
                    value -= links[k, i, j] * ring[k + 1, j]
            ring[k, i] = value
        _up(blocks[k], ring[k])
    return end[n:]
