"""Compiled evaluation of a Chebyshev series in four variables at many points."""

from __future__ import annotations

import numpy as np
from numba import njit

from virtual_lab.units import INNER, Array

BLOCK = 256  # points per block, so that its polynomials fit in the first-level cache


@njit(**INNER)
def _polynomials(x: Array, out: Array) -> None:
    """Fill `out` (degree, point) with the Chebyshev polynomials at `x` (point,)."""
    for i in range(x.size):  # a slice takes seconds more to compile
        out[0, i] = 1.0
        if len(out) > 1:
            out[1, i] = x[i]
    for k in range(2, len(out)):
        for i in range(x.size):
            out[k, i] = 2 * x[i] * out[k - 1, i] - out[k - 2, i]


@njit(cache=True, fastmath=True)
def evaluate_surrogate(coefficients: Array, unit: Array) -> Array:
    """Return the value of a Chebyshev series in four variables at n points, (n,).

    `coefficients` has one axis per variable: element i, j, k, l multiplies the product of the
    polynomials T_i, T_j, T_k and T_l of the four variables. `unit` holds the variables, (4, n),
    each scaled to the range -1 to 1.
    """
    a, b, c, d = coefficients.shape
    rows = np.ascontiguousarray(coefficients.reshape(a, b * c * d).T)
    first, second = np.zeros((a, BLOCK)), np.zeros((b, BLOCK))
    third, fourth = np.zeros((c, BLOCK)), np.zeros((d, BLOCK))
    inner, middle, total = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    # Every block is full, so that the last bits of a value do not depend on its position in a
    # block.
    places = np.zeros((4, BLOCK))
    out = np.zeros(unit.shape[1])
    for start in range(0, unit.shape[1], BLOCK):
        stop = min(start + BLOCK, unit.shape[1])
        for variable in range(4):
            for i in range(start, stop):
                places[variable, i - start] = unit[variable, i]
        _polynomials(places[0], first)
        _polynomials(places[1], second)
        _polynomials(places[2], third)
        _polynomials(places[3], fourth)
        partial = np.dot(rows, first)
        total[:] = 0.0
        for j in range(b):
            middle[:] = 0.0
            for k in range(c):
                inner[:] = 0.0
                for m in range(d):
                    row = (j * c + k) * d + m
                    for i in range(BLOCK):
                        inner[i] += partial[row, i] * fourth[m, i]
                for i in range(BLOCK):
                    middle[i] += inner[i] * third[k, i]
            for i in range(BLOCK):
                total[i] += middle[i] * second[j, i]
        for i in range(start, stop):
            out[i] = total[i - start]
    return out
