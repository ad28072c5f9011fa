"""A ball's place in its region to the physical limit: the occlusion model, fitted.

An opaque ball hides its background, mu = b (1 - m) + B m; every pixel weighs by its own noise.
Free are centre, radius, the ball's level, the background's level and slope; the way during the
exposure and the lens's blur as far as they are not known.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.locate.located import Flag, Located
from virtual_lab.video.locate.noise import Noise

__all__ = ["PIXEL", "Optics", "Refined", "cut", "refine"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
PIXEL = 1 / 12  # variance of a square pixel along any direction
TOGETHER = 5.0  # times the least variance: residuals that go together make a fit poor
START = 1.0  # pixels, how far a start may be off before the fit takes more steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Optics:
    """What is known of the blur; standard uncertainties of 0 hold a figure fast.

    Raises
    ------
    InputError
        A figure is negative, or the lens is sharper than any.
    """

    lens: float = 0.7  # standard deviation of the lens's blur [pixel]
    lens_u: float = 0.0
    blur_u: float = 0.0  # of each component of the ball's shift during the exposure [pixel]

    def __post_init__(self) -> None:
        for name in ("lens", "lens_u", "blur_u"):
            if not getattr(self, name) >= 0:
                raise InputError("optics", name, getattr(self, name), "allowed: 0 or more pixels")


@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """What the fits found, arrays of shape (region,), pixels and DN."""

    located: Located
    x_bound: Array  # the least standard uncertainty any method can reach (Cramer-Rao)
    y_bound: Array
    xy_covariance: Array
    radius_u: Array
    blur_x_u: Array
    blur_y_u: Array
    lens: Array
    ball: Array  # grey value of the ball
    background: Array  # and of what lies behind it, in the middle
    seen: Array  # share of the outline that the fit could use
    steps: NDArray[np.int64]


def refine(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    *,
    noise: Noise,
    optics: Optics | None = None,
    background: Array | None = None,
    mask: Mask | None = None,
    margin: float = 12.0,
) -> Refined:
    """Fit the occlusion model to a batch of regions.

    Parameters
    ----------
    regions
        Grey values, (region, row, col) [DN]: the ball, its blur and some pixels around.
    corners
        Place of each region's first pixel in the frame, (region, 2): x, y.
    start
        Where the ball is to a tenth of its radius or so, how large and how blurred it is.
    noise
        The camera's noise.
    optics
        The lens's blur and how well blurs are known; sharp knowledge by default.
    background
        The scene without the ball, (region, row, col) or (1, row, col); its level is fitted,
        with a slope. Without it, the background is a level and a slope.
    mask
        True where a pixel may be used, (region, row, col) or (1, row, col).
    margin
        Pixels around the ball and its blur that are used.

    Raises
    ------
    InputError
        Arrays that do not fit one another.
    """
    from virtual_lab.video.locate.plain_ball import kernel
    from virtual_lab.video.locate.plain_ball import sums as at
    from virtual_lab.video.locate.plain_ball.flags import judged

    optics = optics or Optics()
    pixels, use, back = checked(regions, corners, start, background, mask)
    count = pixels.shape[0]
    p = np.zeros((count, at.COUNT))
    corner_x, corner_y = corners[:, 0], corners[:, 1]
    p[:, at.X], p[:, at.Y] = start.x - corner_x, start.y - corner_y
    p[:, at.RADIUS] = start.radius
    p[:, at.WAY_X], p[:, at.WAY_Y] = start.blur_x, start.blur_y
    p[:, at.WIDTH] = sqrt(optics.lens**2 + PIXEL)
    prior = np.full(p.shape, np.inf)
    prior[:, [at.WAY_X, at.WAY_Y]] = optics.blur_u
    prior[:, at.WIDTH] = optics.lens_u
    held = {at.WAY_X, at.WAY_Y} if optics.blur_u == 0 else set()
    held |= {at.WIDTH} if optics.lens_u == 0 else set()
    free = np.array([k for k in range(at.COUNT) if k not in held])
    state = np.zeros((count, at.STATE))
    covariance = np.full((count, free.size, free.size), np.nan)
    bound = np.full_like(covariance, np.nan)
    if count:
        kernel.refine(
            pixels,
            use,
            back,
            p,
            prior,
            free,
            noise.figures,
            START,
            margin,
            state,
            covariance,
            bound,
        )
    full = np.zeros((count, at.COUNT, at.COUNT))
    full[np.ix_(np.arange(count), free, free)] = covariance
    u = np.sqrt(np.diagonal(full, axis1=1, axis2=2))
    least = np.sqrt(np.diagonal(bound, axis1=1, axis2=2))
    flags, lost = judged(p, u, state, (pixels.shape[1], pixels.shape[2]))
    wide = (u[:, :2] ** 2).sum(axis=1) > TOGETHER * (least[:, :2] ** 2).sum(axis=1)
    flags[wide & ~lost] |= np.uint16(Flag.POOR_FIT)
    p[lost], u[lost] = np.nan, np.nan
    located = Located(
        x=p[:, at.X] + corner_x,
        y=p[:, at.Y] + corner_y,
        radius=p[:, at.RADIUS],
        x_u=u[:, at.X],
        y_u=u[:, at.Y],
        blur_x=p[:, at.WAY_X],
        blur_y=p[:, at.WAY_Y],
        chi_square=np.where(lost, np.nan, state[:, at.NEAR]),
        flags=flags,
    )
    return Refined(
        located=located,
        x_bound=least[:, 0],
        y_bound=least[:, 1],
        xy_covariance=full[:, 0, 1],
        radius_u=u[:, at.RADIUS],
        blur_x_u=u[:, at.WAY_X],
        blur_y_u=u[:, at.WAY_Y],
        lens=np.sqrt(np.maximum(p[:, at.WIDTH] ** 2 - PIXEL, 0.0)),
        ball=p[:, at.BALL],
        background=p[:, at.LEVEL],
        seen=state[:, at.SEEN],
        steps=state[:, at.STEPS].astype(np.int64),
    )


def checked(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    background: Array | None,
    mask: Mask | None,
) -> tuple[Array, NDArray[np.uint8], Array]:
    """Return regions, mask and background as the kernels want them."""
    if regions.ndim != 3 or min(regions.shape[1:], default=0) < 8:
        raise InputError("refine", "regions", regions.shape, "allowed: (region, row, col), >= 8")
    count = regions.shape[0]
    if np.shape(corners) != (count, 2):
        raise InputError("refine", "corners", np.shape(corners), f"allowed: ({count}, 2)")
    if start.x.shape != (count,):
        raise InputError("refine", "start", start.x.shape, f"allowed: ({count},)")
    shape = (1, *regions.shape[1:])
    given = {
        "mask": np.ones(shape, np.uint8) if mask is None else mask.astype(np.uint8),
        "background": np.ones(shape) if background is None else background.astype(float),
    }
    for name, array in given.items():
        if array.shape[1:] != regions.shape[1:] or array.shape[0] not in (1, count):
            raise InputError("refine", name, array.shape, f"allowed: {regions.shape}")
    use, back = given["mask"], given["background"]
    return (
        np.ascontiguousarray(regions, float),
        np.ascontiguousarray(use, np.uint8),
        np.ascontiguousarray(back, float),
    )


def cut(
    frames: NDArray[np.generic], x: Array, y: Array, size: int
) -> tuple[NDArray[np.generic], Array]:
    """Return square regions about the ball of each frame and their corners.

    Parameters
    ----------
    frames
        (frame, row, col).
    x, y
        Where the ball is in each, (frame,) [pixel].
    size
        Side of a region [pixel].

    A region that would leave the frame is moved back into it: the frame's edge cuts the ball.

    Raises
    ------
    InputError
        A frame is smaller than a region.
    """
    rows, cols = frames.shape[1:]
    if not 8 <= size <= min(rows, cols):
        raise InputError("cut", "size", size, f"allowed: 8 to {min(rows, cols)} pixels")
    left = np.clip(np.round(x - 0.5 * (size - 1)), 0, cols - size).astype(int)
    top = np.clip(np.round(y - 0.5 * (size - 1)), 0, rows - size).astype(int)
    span = np.arange(size)
    index = np.arange(frames.shape[0])[:, None, None]
    regions = frames[index, (top[:, None] + span)[:, :, None], (left[:, None] + span)[:, None, :]]
    return regions, np.stack([left, top], axis=1).astype(float)
