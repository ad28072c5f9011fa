"""Small symmetric systems inside the kernels: normal equations, what was known before, inverses."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.plain_ball.disc import FINE

__all__ = ["put", "solve", "weigh_in"]

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
TINY = 1e-11  # of a diagonal, added: what the picture does not say stays where it is


@njit(**FINE)
def put(values: Floats, out: Floats) -> None:
    """Copy an array into one of the same shape.

    `out[:] = values` would cost numba three seconds a kernel: it compiles the words that it has
    for arrays of unlike shapes.
    """
    for k in range(out.size):
        out.flat[k] = values.flat[k]


@njit(**FINE)
def _factor(h: Floats, free: Indices, size: Floats, low: Floats) -> bool:
    """Factor the rows `free` of h (its lower half), scaled to a diagonal of 1 by `size`."""
    for a in range(free.size):
        if not h[free[a], free[a]] > 0.0:
            return False
        size[a] = 1.0 / sqrt(h[free[a], free[a]])
        for b in range(a + 1):
            value = h[free[a], free[b]] * size[a] * size[b]
            for k in range(b):
                value -= low[a, k] * low[b, k]
            if b < a:
                low[a, b] = value / low[b, b]
            elif value + TINY > 0.0:
                low[a, a] = sqrt(value + TINY)
            else:
                return False
    return True


@njit(**FINE)
def _substitute(low: Floats, out: Floats) -> None:
    """Solve with a factored matrix, in place."""
    n = out.size
    for a in range(n):
        for k in range(a):
            out[a] -= low[a, k] * out[k]
        out[a] /= low[a, a]
    for a in range(n - 1, -1, -1):
        for k in range(a + 1, n):
            out[a] -= low[k, a] * out[k]
        out[a] /= low[a, a]


@njit(**FINE)
def solve(h: Floats, g: Floats, free: Indices, step: Floats, inverse: Floats) -> bool:
    """Solve the rows `free` of h x = g (h's lower half): x into step, and h's inverse."""
    n = free.size
    size, low, out = np.empty(n), np.zeros((n, n)), np.empty(n)
    if not _factor(h, free, size, low):
        return False
    for column in range(n):
        out[:] = 0.0
        out[column] = size[column]
        _substitute(low, out)
        for a in range(n):
            inverse[a, column] = out[a] * size[a]
    for a in range(n):
        step[a] = g[free[a]] * size[a]
    _substitute(low, step[:n])
    for a in range(n):
        step[a] *= size[a]
    return True


@njit(**FINE)
def weigh_in(h: Floats, g: Floats, p: Floats, p0: Floats, prior: Floats, free: Indices) -> None:
    """Add what was known before: a parameter's start with its standard uncertainty."""
    for a in range(free.size):
        k = free[a]
        if prior[k] < np.inf:
            h[k, k] += 1.0 / prior[k] ** 2
            g[k] += (p0[k] - p[k]) / prior[k] ** 2
