"""The uncertainty that a certificate states beside the one it estimates: √(χ²_ν / ν); compiled.

With the standard normal number z that χ² is drawn by, χ² = P⁻¹(ν/2, Φ(z)), the cube root of χ²/ν
is nearly straight (E. B. Wilson and M. M. Hilferty, Proc. Natl. Acad. Sci. 17 (1931) 684), so
polynomials over short pieces of z give it to rounding: 1e-14 of u, with one degree of freedom
1e-14 to |z| = 5 and 2e-11 beyond.
"""

from __future__ import annotations

from functools import lru_cache
from math import sqrt

import numpy as np
from numba import njit
from numpy.polynomial.chebyshev import chebvander

from virtual_lab.units import Array

REACH = 8.5  # beyond any normal number that is drawn
PIECE = 0.5
DEGREE = 11


@lru_cache(64)
def pieces_of(dof: float) -> Array:
    """Return the polynomials of the cube root of χ²/ν, (piece, power), each over -1 to 1."""
    from scipy.special import gammainccinv, gammaincinv, ndtr

    x = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    start = np.arange(-REACH, REACH, PIECE)
    z = start[:, None] + PIECE * (1 + x) / 2
    below, above = gammaincinv(dof / 2, ndtr(z)), gammainccinv(dof / 2, ndtr(-z))
    root = np.cbrt(2 * np.where(z < 0, below, above) / dof)
    powers = chebvander(x, DEGREE)
    fitted = np.linalg.solve(powers, root.T)
    to_powers = np.linalg.solve(np.vander(x, increasing=True), powers)
    return np.ascontiguousarray((to_powers @ fitted).T)


@njit(cache=True, error_model="numpy")
def stated_shares(chance: Array, pieces: Array, shares: Array) -> None:
    """Fill in u over σ of standard normal numbers (n,), 1 of a 0, which nobody drew."""
    last = len(pieces) - 1
    for i in range(chance.size):
        along = (chance[i] + REACH) / PIECE
        piece = min(max(int(along), 0), last)
        x = 2 * (along - piece) - 1
        root = pieces[piece, DEGREE]
        for power in range(DEGREE - 1, -1, -1):
            root = root * x + pieces[piece, power]
        shares[i] = root * sqrt(max(root, 0.0)) if chance[i] else 1.0
