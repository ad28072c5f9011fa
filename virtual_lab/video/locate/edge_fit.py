"""A ball's place from its outline alone, to the limit of its own pattern: the edge fit.

The ball's brightness may go up and down along the rim and inward from it: smooth shading, as of
light from a side, and a pattern such as a seam, of unknown strength in each sector of the rim. What
the pattern may shift the place by is distinguished from noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.locate.located import Located, PlaceFlag
from virtual_lab.video.locate.noise import Noise

if TYPE_CHECKING:
    from virtual_lab.video.locate.edge_kernel import Solution

__all__ = ["EdgeFit", "fit_edge"]

Array = NDArray[np.float64]

PIXEL = 1 / 12  # variance of a square pixel along any direction
INSIDE = 3.0  # pixels of the ball that are looked at, blur apart
ARC = 3.0  # pixels along the rim that one sector has
SECTORS = (24, 96)
MISFIT = 3.0  # chi^2 on the outline, of a pattern finer than a sector too
SHARE = 0.02  # of the outline: more than this makes a flag
SPARE = 0.12  # of the outline: a fit on less has lost the ball
STRAY = 0.02  # share of pixels that fit nothing
OVAL = 0.003  # of an outline, as far as nobody knows: a camera that looks at the ball squarely
FAINT = 100.0  # standard uncertainties in the radius: with fewer there is no outline
GENEROUS = 1.5  # seams are no random field: what hides at the rim shifts more than one would
HIDDEN = 0.3  # of what a pattern at the rim would shift the place by, were it the outline
COVERED = 0.27  # of the rim; the side that no light reaches may be as dark as what is behind
RISE = 1e3  # DN over a region: a background's slope is less


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeFit:
    """What the edge fits found, arrays of shape (region,), pixels.

    `located.x_u` and `y_u` are noise alone; `located.pattern_u` is what the pattern may shift x
    or y by, the root mean square of these two:
    """

    located: Located
    x_pattern_u: Array
    y_pattern_u: Array
    radius_u: Array  # noise and pattern
    oval: Array  # (region, 2) of the outline: parts of cos 2a and sin 2a


def fit_edge(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    *,
    noise: Noise,
    lens: float = 0.7,
    background: Array | None = None,
    oval: ArrayLike = 0.0,
    oval_u: float = OVAL,
) -> EdgeFit:
    """Fit the outlines of a batch of regions.

    Parameters
    ----------
    regions
        Grey values, (region, row, col) [DN]: the ball, its blur and some pixels around.
    corners
        Place of each region's first pixel in the frame, (region, 2): x, y.
    start
        Where the ball is to a pixel or so, how large, and how blurred it is: the blur is held.
    noise
        The camera's noise; its black shows how bright the ball is.
    lens
        Standard deviation of the lens's blur [pixel].
    background
        The scene without the ball, (region, row, col) or (1, row, col); its level is fitted,
        with a slope. Without it, the background is a level and a slope.
    oval
        What is known of outlines that are no circles, r = R (1 + c cos 2a + s sin 2a): c and s,
        (region, 2) or less. A sphere off a camera's axis by the angle b has an outline that is
        longer by 1 / cos b along the way from the axis.
    oval_u
        Standard uncertainty of c and s; 0 only where they are known to 0.0005: what is left of
        an ellipse would be taken for a pattern, and the place with it.

    Raises
    ------
    InputError
        Arrays that do not fit one another.
    """
    from virtual_lab.video.locate import edge_kernel as kernel
    from virtual_lab.video.locate import edge_sums as at
    from virtual_lab.video.locate.edge_sums import View
    from virtual_lab.video.locate.rim_profiles import blurred_profiles

    pixels, behind = _checked(regions, corners, start, background)
    if not lens > 0:
        raise InputError("fit_edge", "lens", lens, "allowed: above 0 pixels")
    count = len(pixels)
    ways = np.stack([start.blur_x, start.blur_y], axis=1)
    p = np.zeros((count, at.COUNT))
    p[:, at.X], p[:, at.Y] = (np.stack([start.x, start.y], axis=1) - corners).T
    p[:, at.RADIUS] = start.radius
    p[:, [at.OVAL_C, at.OVAL_S]] = oval
    found = kernel.Solution(
        p=p,
        state=np.zeros((count, kernel.STATE)),
        covariance=np.full((count, 3, 3), np.nan),
        shifts=np.full((count, 3), np.nan),
    )
    usable = np.isfinite(p).all(axis=1) & np.isfinite(ways).all(axis=1)
    if usable.any():
        width = sqrt(lens**2 + PIXEL)
        radius = float(np.median(p[usable, at.RADIUS]))
        known = blurred_profiles(radius, width, INSIDE, float(np.hypot(*ways[usable].T).max()))
        sectors = int(np.clip(round(2 * pi * radius / ARC), *SECTORS))
        prior = _prior(oval_u)
        for k in np.flatnonzero(usable):
            rim = at.Rim(known.table, known.stiffness, known.hides, width, INSIDE, ways[k])
            view = View(pixels[k], behind[k % len(behind)])
            own = kernel.Solution(*(each[k] for each in found))
            kernel.fit_region(view, rim, noise.figures, prior, sectors, own)
    return _judged(found, start, corners, pixels.shape[1:])


def _checked(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    background: Array | None,
) -> tuple[Array, Array]:
    """Return regions and background as the kernel wants them."""
    if regions.ndim != 3 or min(regions.shape[1:], default=0) < 8:
        raise InputError("fit_edge", "regions", regions.shape, "allowed: (region, row, col), >= 8")
    count = regions.shape[0]
    if np.shape(corners) != (count, 2):
        raise InputError("fit_edge", "corners", np.shape(corners), f"allowed: ({count}, 2)")
    if start.x.shape != (count,):
        raise InputError("fit_edge", "start", start.x.shape, f"allowed: ({count},)")
    shape = (1, *regions.shape[1:])
    behind = np.ones(shape) if background is None else background
    if behind.shape[1:] != regions.shape[1:] or behind.shape[0] not in (1, count):
        raise InputError("fit_edge", "background", behind.shape, f"allowed: {regions.shape}")
    return (
        np.ascontiguousarray(regions, float),
        np.ascontiguousarray(behind, float),
    )


def _prior(oval_u: float) -> Array:
    """Return the weights of what was known before."""
    from virtual_lab.video.locate import edge_kernel as kernel
    from virtual_lab.video.locate import edge_sums as at

    prior = np.zeros(at.COUNT)
    prior[[at.OVAL_C, at.OVAL_S]] = 1 / oval_u**2 if oval_u else kernel.HELD
    prior[[at.LEVEL, at.SLOPE_X, at.SLOPE_Y]] = 1e-12, 1 / RISE**2, 1 / RISE**2
    return prior


def _judged(found: Solution, start: Located, corners: Array, shape: tuple[int, ...]) -> EdgeFit:
    """Return what the kernel found, with what is to be said against it."""
    from virtual_lab.video.locate import edge_kernel as kernel
    from virtual_lab.video.locate import edge_sums as at

    p, state, covariance, shifts = found
    misfit = state[:, at.NEAR] / np.maximum(state[:, at.AROUND] - at.COUNT, 1.0)
    grown = np.maximum(misfit, 1.0)[:, None]  # misfit counts as noise
    total = np.diagonal(covariance, axis1=1, axis2=2)
    own = np.sqrt(np.maximum(total - shifts, 0.0) * grown)
    pattern = GENEROUS * np.sqrt(np.maximum(shifts, 0.0) * grown)
    whole = np.hypot(own, pattern)
    pattern[:, :2] = np.hypot(pattern[:, :2], HIDDEN * state[:, kernel.SWAY, None])
    around = 2 * pi * p[:, at.RADIUS]
    seen, full = state[:, at.SEEN] / around, state[:, at.FULL] / around
    stray = state[:, at.STRAY] / np.maximum(state[:, at.PIXELS], 1.0)
    with np.errstate(invalid="ignore"):
        lost = ~np.isfinite(np.column_stack([p, whole])).all(axis=1)
        lost |= (state[:, kernel.SETTLED] == 0) | (seen < SPARE)
        lost |= whole.max(axis=1) * FAINT > p[:, at.RADIUS]
        for place, side in ((at.X, shape[1]), (at.Y, shape[0])):
            reach = 0.5 * p[:, at.RADIUS]
            lost |= (p[:, place] < -reach) | (p[:, place] > side - 1 + reach)
        tests = {
            PlaceFlag.SATURATED: full > SHARE,
            PlaceFlag.CLIPPED: 1 - seen > SHARE,
            PlaceFlag.OVERLAP: state[:, kernel.COVERED] > COVERED,
            PlaceFlag.POOR_FIT: (misfit > MISFIT) | (stray > STRAY),
        }
    flags = np.zeros(len(p), np.uint16)
    for flag, raised in tests.items():
        flags[raised] |= np.uint16(flag)
    flags[lost] = PlaceFlag.NOT_FOUND
    p[lost], own[lost], pattern[lost], whole[lost] = np.nan, np.nan, np.nan, np.nan
    located = Located(
        x=p[:, at.X] + corners[:, 0],
        y=p[:, at.Y] + corners[:, 1],
        radius=p[:, at.RADIUS],
        x_u=own[:, 0],
        y_u=own[:, 1],
        blur_x=start.blur_x,
        blur_y=start.blur_y,
        chi_square=np.where(lost, np.nan, misfit),
        flags=flags,
        pattern_u=np.sqrt((pattern[:, 0] ** 2 + pattern[:, 1] ** 2) / 2),
    )
    return EdgeFit(
        located=located,
        x_pattern_u=pattern[:, 0],
        y_pattern_u=pattern[:, 1],
        radius_u=whole[:, 2],
        oval=p[:, [at.OVAL_C, at.OVAL_S]],
    )
