"""The ball presses on a stretch of the bat, not on a point.

A point force on a Timoshenko beam does not converge in the number of modes; a patch does.
Pressure falls as a cosine to the ends of the patch, which is symmetric about the impact, so
its lever is that of the impact itself. Nearer an end of the bat than its half width it
shrinks on both sides alike: at the very tip it is a point again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.physics.modes import Modes

__all__ = ["PATCH", "patch_shape"]

Floats = NDArray[np.float64]
PATCH = 0.03  # full width [m]
GAUSS_POINTS = 8
ROWS = 4096  # places at a time: keeps the interpolation matrix in the cache


def patch_shape(modes: Modes, z: Floats, width: float) -> Floats:
    """Return the mean deflection of each mode over the patches about `z`.

    Parameters
    ----------
    modes : Modes
    z : (n,) array
        Impact positions [m].
    width : float
        Full width of the patch [m]; 0 is a point.

    Returns
    -------
    (n, N) array
    """
    x, gauss = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    pressure = gauss * np.cos(np.pi / 2 * x)
    pressure /= pressure.sum()
    half = np.minimum(width / 2, np.minimum(z, modes.length - z))
    places = np.clip(z[:, None] + half[:, None] * x, 0.0, modes.length)
    blocks = range(0, len(z), ROWS)
    return np.concatenate([modes.mean_shape(places[i : i + ROWS], pressure) for i in blocks])
