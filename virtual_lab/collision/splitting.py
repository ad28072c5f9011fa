"""A splitting Runge-Kutta-Nystrom scheme of order six: kick, drift, kick, ..., kick.

For ``q'' = f(q)``: every kick adds its share of the step times f to q', every drift its
share times q' to q. Symplectic, symmetric, eleven evaluations a step; the observed order is
a test. Source: S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, SRKN_11^b.
"""

import numpy as np

__all__ = ["DRIFTS", "KICKS"]

_B = (
    0.0414649985182624,
    0.198128671918067,
    -0.0400061921041533,
    0.0752539843015807,
    -0.0115113874206879,
)
_A = (
    0.123229775946271,
    0.290553797799558,
    -0.127049212625417,
    -0.246331761062075,
    0.357208872795928,
)
_MIDDLE_B, _MIDDLE_A = 0.5 - sum(_B), 1 - 2 * sum(_A)
KICKS = np.array([*_B, _MIDDLE_B, _MIDDLE_B, *reversed(_B)])
DRIFTS = np.array([*_A, _MIDDLE_A, *reversed(_A)])
