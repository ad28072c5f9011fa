"""The least uncertainty any method can have of a plain ball's place: Cramér and Rao's bound.

Fisher's information of pixels whose mean and variance both tell of the ball:
I = sum d_j mu d_k mu (1/V + (V'/V)^2 / 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.video.locate.noise import Noise

__all__ = ["Bound", "bound", "bound_of_edge"]

Array = NDArray[np.float64]
PIXEL = 1 / 12  # variance of a square pixel along any direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Least standard uncertainties, arrays of shape (scene,) [pixel]."""

    x: Array
    y: Array
    radius: Array


def bound(
    shape: tuple[int, int],
    *,
    x: ArrayLike,
    y: ArrayLike,
    radius: ArrayLike,
    lens: ArrayLike,
    ball: ArrayLike,
    background: ArrayLike,
    noise: Noise,
    blur_x: ArrayLike = 0.0,
    blur_y: ArrayLike = 0.0,
    blur_free: bool = False,
) -> Bound:
    """Return the bound of plain balls before a flat background that is unknown with its slope.

    Parameters
    ----------
    shape
        Rows and columns of the region in which the ball is seen.
    x, y, radius, blur_x, blur_y
        Of the ball at mid exposure, () or (scene,) [pixel].
    lens
        Standard deviation of the lens's blur [pixel].
    ball, background
        Grey values [DN].
    noise
        The camera's.
    blur_free
        Whether the blur has to be found too.
    """
    from virtual_lab.video.locate.plain_ball import kernel
    from virtual_lab.video.locate.plain_ball import sums as at

    columns = np.broadcast_arrays(x, y, radius, blur_x, blur_y, lens, ball, background)
    scenes = np.stack([np.ravel(np.asarray(column, float)) for column in columns], axis=1)
    p = np.zeros((scenes.shape[0], at.COUNT))
    p[:, : at.LEVEL + 1] = scenes
    p[:, at.WIDTH] = np.sqrt(p[:, at.WIDTH] ** 2 + PIXEL)
    held = [at.WIDTH] if blur_free else [at.WIDTH, at.WAY_X, at.WAY_Y]
    free = np.setdiff1d(np.arange(at.COUNT), held)
    none, use, back = np.zeros(shape), np.ones(shape, np.uint8), np.ones(shape)
    least = np.full((p.shape[0], free.size, free.size), np.nan)
    for scene, out in zip(p, least, strict=True):
        prior, own = np.full(at.COUNT, np.inf), np.empty_like(out)
        state = np.full(at.STATE, np.inf)  # no pixel is cut: none has been seen
        everywhere = float(sum(shape))
        kernel.judge(
            none, use, back, scene, prior, free, noise.figures, everywhere, state, own, out
        )
    u = np.sqrt(np.diagonal(least, axis1=1, axis2=2))
    return Bound(x=u[:, 0], y=u[:, 1], radius=u[:, 2])


def bound_of_edge(
    *, radius: ArrayLike, lens: float, snr: ArrayLike, blur: ArrayLike = 0.0
) -> Array:
    """Return the bound along the motion in closed form [pixel], for planning.

    `snr` is the contrast over the standard deviation of a pixel on the edge. Exact in the limits
    of no blur, and of a blur that is long against the edge but not against the ball.
    """
    s = sqrt(lens**2 + PIXEL)
    still = 2 * s / (sqrt(np.pi) * np.asarray(radius, float))
    moving = np.asarray(blur, float) / (4 * np.asarray(radius, float))
    return np.asarray(np.sqrt(np.maximum(still, moving)) / np.asarray(snr, float))
