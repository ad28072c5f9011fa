"""A stitched or shaded ball's place from its outline alone: the edge fit.

The occlusion model takes a ball for evenly bright. Here its brightness may go up and down along
the rim and inward from it: smooth shading, as of light from a side, and a pattern such as a seam,
of unknown strength in each sector of the rim. What the pattern may shift is told apart from noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.locate.located import Flag, Located
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.plain_ball.refining import PIXEL, Mask, checked

__all__ = ["Edged", "fit_edge"]

Array = NDArray[np.float64]

INSIDE = 3.0  # pixels of the ball that are looked at, blur apart
ARC = 3.0  # pixels along the rim that one sector has
SECTORS = (24, 96)
MISFIT = 3.0  # chi^2 on the outline, of a pattern finer than a sector too
OVAL = 0.003  # of an outline, as far as nobody knows: a camera that looks at the ball squarely
FAINT = 100.0  # standard uncertainties in the radius: with fewer there is no outline
GENEROUS = 1.5  # seams are no random field: what hides at the rim shifts more than one would
HIDDEN = 0.3  # of what a pattern at the rim would shift the place by, were it the outline
COVERED = 0.25  # of the rim; the side that a light does not reach may be as dark as what is behind
RISE = 1e3  # DN over a region: a background's slope is less


@dataclass(frozen=True, slots=True, kw_only=True)
class Edged:
    """What the edge fits found, arrays of shape (region,), pixels.

    `located.x_u` and `y_u` are noise alone; `located.pattern_u` is what the pattern may shift x
    or y by, the root mean square of these two:
    """

    located: Located
    x_pattern_u: Array
    y_pattern_u: Array
    radius_u: Array  # noise and pattern
    covariance: Array  # (region, 3, 3) of x, y and radius: noise and what a random pattern does
    oval: Array  # (region, 2) of the outline: parts of cos 2a and sin 2a
    steps: NDArray[np.int64]


def fit_edge(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    *,
    noise: Noise,
    lens: float = 0.7,
    background: Array | None = None,
    mask: Mask | None = None,
    radius_u: float = np.inf,
    oval: ArrayLike = 0.0,
    oval_u: float = OVAL,
) -> Edged:
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
        The camera's noise; its black tells how bright the ball is.
    lens
        Standard deviation of the lens's blur [pixel].
    background
        The scene without the ball, (region, row, col) or (1, row, col); its level is fitted,
        with a slope. Without it, the background is a level and a slope.
    mask
        True where a pixel may be used, (region, row, col) or (1, row, col).
    radius_u
        Standard uncertainty of the start's radius [pixel]; infinite: it is found anew.
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
    from virtual_lab.video.locate.stitched_ball import kernel
    from virtual_lab.video.locate.stitched_ball import sums as at
    from virtual_lab.video.locate.stitched_ball.profiles import profiles

    pixels, use, back = checked(regions, corners, start, background, mask)
    for name, value in {"radius_u": radius_u, "lens": lens}.items():
        if not value > 0:
            raise InputError("fit_edge", name, value, "allowed: above 0 pixels")
    count = pixels.shape[0]
    ways = np.stack([start.blur_x, start.blur_y], axis=1)
    p = np.zeros((count, at.COUNT))
    p[:, at.X], p[:, at.Y] = (np.stack([start.x, start.y], axis=1) - corners).T
    p[:, at.RADIUS] = start.radius
    p[:, [at.OVAL_C, at.OVAL_S]] = oval
    state = np.zeros((count, kernel.STATE))
    covariance = np.full((count, 3, 3), np.nan)
    shifts = np.full((count, 3), np.nan)
    usable = np.isfinite(p).all(axis=1) & np.isfinite(ways).all(axis=1)
    if usable.any():
        width = sqrt(lens**2 + PIXEL)
        radius = float(np.median(p[usable, at.RADIUS]))
        longest = float(np.hypot(*ways[usable].T).max())
        known = profiles(radius, width, INSIDE, longest)
        kernel.refine(
            pixels,
            use,
            back,
            p,
            _prior(radius_u, oval_u),
            ways,
            width,
            INSIDE,
            known.table,
            known.stiffness,
            known.hides,
            noise.figures,
            int(np.clip(round(2 * pi * radius / ARC), *SECTORS)),
            state,
            covariance,
            shifts,
        )
    return _edged(p, state, covariance, shifts, start, corners, (pixels.shape[1], pixels.shape[2]))


def _prior(radius_u: float, oval_u: float) -> Array:
    """Return the weights of what was known before."""
    from virtual_lab.video.locate.stitched_ball import kernel
    from virtual_lab.video.locate.stitched_ball import sums as at

    prior = np.zeros(at.COUNT)
    prior[at.RADIUS] = 1 / radius_u**2
    prior[[at.OVAL_C, at.OVAL_S]] = 1 / oval_u**2 if oval_u else kernel.HELD
    prior[[at.LEVEL, at.SLOPE_X, at.SLOPE_Y]] = 1e-12, 1 / RISE**2, 1 / RISE**2
    return prior


def _edged(
    p: Array,
    state: Array,
    covariance: Array,
    shifts: Array,
    start: Located,
    corners: Array,
    shape: tuple[int, int],
) -> Edged:
    """Return what the kernel found, judged as the occlusion fit is."""
    from virtual_lab.video.locate.plain_ball import sums as told
    from virtual_lab.video.locate.plain_ball.flags import judged
    from virtual_lab.video.locate.stitched_ball import kernel
    from virtual_lab.video.locate.stitched_ball import sums as at

    around = 2 * pi * p[:, at.RADIUS]
    said = np.zeros((len(p), told.STATE))
    said[:, told.SETTLED], said[:, told.STEPS] = state[:, kernel.SETTLED], state[:, kernel.STEPS]
    for name in ("SEEN", "HIDDEN", "FULL"):
        said[:, getattr(told, name)] = state[:, getattr(at, name)] / around
    said[:, told.STRAY] = state[:, at.STRAY] / np.maximum(state[:, at.PIXELS], 1.0)
    said[:, told.NEAR] = state[:, at.NEAR] / np.maximum(state[:, at.AROUND] - at.COUNT, 1.0)
    grown = np.maximum(said[:, told.NEAR], 1.0)[:, None]  # misfit counts as noise
    total = np.diagonal(covariance, axis1=1, axis2=2)
    own = np.sqrt(np.maximum(total - shifts, 0.0) * grown)
    pattern = GENEROUS * np.sqrt(np.maximum(shifts, 0.0) * grown)
    whole = np.hypot(own, pattern)
    whole[whole.max(axis=1) * FAINT > p[:, at.RADIUS]] = np.nan
    pattern[:, :2] = np.hypot(pattern[:, :2], HIDDEN * state[:, kernel.SWAY, None])
    flags, lost = judged(p, whole, said, shape, misfit=MISFIT)
    flags[~lost & (state[:, kernel.COVERED] > COVERED)] |= np.uint16(Flag.OVERLAP)
    p[lost], own[lost], pattern[lost], whole[lost] = np.nan, np.nan, np.nan, np.nan
    located = Located(
        x=p[:, at.X] + corners[:, 0],
        y=p[:, at.Y] + corners[:, 1],
        radius=p[:, at.RADIUS],
        x_u=own[:, 0],
        y_u=own[:, 1],
        blur_x=start.blur_x,
        blur_y=start.blur_y,
        chi_square=np.where(lost, np.nan, said[:, told.NEAR]),
        flags=flags,
        pattern_u=np.sqrt((pattern[:, 0] ** 2 + pattern[:, 1] ** 2) / 2),
    )
    return Edged(
        located=located,
        x_pattern_u=pattern[:, 0],
        y_pattern_u=pattern[:, 1],
        radius_u=whole[:, 2],
        covariance=covariance * grown[:, :, None],
        oval=p[:, [at.OVAL_C, at.OVAL_S]],
        steps=state[:, kernel.STEPS].astype(np.int64),
    )
