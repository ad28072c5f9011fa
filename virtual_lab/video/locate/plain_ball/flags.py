"""What is said against a fit: not found, saturated, cut, covered, or no picture of its model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.locate.located import Flag
from virtual_lab.video.locate.plain_ball import sums as at

__all__ = ["judged"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
SHARE = 0.02  # of the outline: more than this makes a flag
FAINT = 20.0  # standard uncertainties in the radius: with fewer there is no ball
SPARE = 0.12  # of the outline: a fit on less has lost the ball
STRAY = 0.02  # share of pixels that fit nothing
MISFIT = 1.5  # chi^2 on the outline


def judged(
    p: Array, u: Array, state: Array, shape: tuple[int, int], misfit: float = MISFIT
) -> tuple[NDArray[np.uint16], Mask]:
    """Return flags and which fits are lost, (region,), from what the kernel says of each.

    `misfit` is the chi^2 on the outline from which a fit is called poor.
    """
    rows, cols = shape
    x, y, radius = p[:, at.X], p[:, at.Y], p[:, at.RADIUS]
    with np.errstate(invalid="ignore"):
        lost = ~np.isfinite(p).all(axis=1) | ~np.isfinite(u).all(axis=1)
        lost |= state[:, at.SETTLED] == 0
        lost |= (x < -0.5 * radius) | (x > cols - 1 + 0.5 * radius)
        lost |= (y < -0.5 * radius) | (y > rows - 1 + 0.5 * radius)
        lost |= state[:, at.SEEN] < SPARE
        lost |= u[:, at.RADIUS] * FAINT > radius
        missing = 1.0 - state[:, at.SEEN] - state[:, at.HIDDEN]
        tests = {
            Flag.SATURATED: state[:, at.FULL] > SHARE,
            Flag.CLIPPED: missing > SHARE,
            Flag.OVERLAP: state[:, at.HIDDEN] > SHARE,
            Flag.POOR_FIT: (state[:, at.NEAR] > misfit) | (state[:, at.STRAY] > STRAY),
        }
    flags = np.zeros(x.shape, np.uint16)
    for flag, raised in tests.items():
        flags[raised] |= np.uint16(flag)
    flags[lost] = Flag.NOT_FOUND
    return flags, lost
