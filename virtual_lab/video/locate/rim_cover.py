"""How much of a ball's rim is hidden: where the picture shows the background in its place.

What stands before the ball stood there before it came: a bat, a cable, the sabot's catcher.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate import edge_sums as at
from virtual_lab.video.locate.pixels import OPTIONS, View, variance

__all__ = ["covered"]

Floats = NDArray[np.float64]

RIM = 1.5, 4.5  # pixels inside the outline that are looked at, wherever the ball is
ALIKE = 3.0  # standard deviations of noise: the background and nothing else
CLEAR = 12.0  # of them that ball and background are apart: with less nobody could tell


@njit(**OPTIONS)
def covered(view: View, p: Floats, way: Floats, noise: Floats) -> float:
    """Return the share of the rim's pixels that are as bright as their background, alone."""
    x, y, radius, level = p[at.X], p[at.Y], p[at.RADIUS], p[at.LEVEL]
    seen, alike = 0, 0
    most = radius - RIM[0]
    light, behind = 0.0, 0.0
    for row in range(max(0, int(y - most)), min(view.pixels.shape[0], int(y + most) + 2)):
        for col in range(max(0, int(x - most)), min(view.pixels.shape[1], int(x + most) + 2)):
            u, v = col - x, row - y
            one = (u - 0.5 * way[0]) ** 2 + (v - 0.5 * way[1]) ** 2
            other = (u + 0.5 * way[0]) ** 2 + (v + 0.5 * way[1]) ** 2
            far = sqrt(max(one, other))
            if not radius - RIM[1] < far < most:
                continue
            expected = level * view.background[row, col]
            seen += 1
            light += view.pixels[row, col]
            behind += expected
            room = ALIKE * ALIKE * variance(expected, noise)
            alike += (view.pixels[row, col] - expected) ** 2 < room
    if seen == 0:
        return 0.0
    apart = (light - behind) / seen
    if apart * apart < CLEAR * CLEAR * variance(behind / seen, noise):
        return 0.0
    return float(alike / seen)
