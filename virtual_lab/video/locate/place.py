"""Places to the physical limit: the occlusion fit where it holds, the edge fit elsewhere.

What all regions of one flight share makes each of them sharper: its radius, and the oval that a
sphere off the camera's axis shows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.locate.located import Flag, Located, part_of, put
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.one_radius import POOLED, with_one_radius
from virtual_lab.video.locate.plain_ball.refining import Optics, refine
from virtual_lab.video.locate.regions import Regions
from virtual_lab.video.locate.seeing import HOLDS
from virtual_lab.video.locate.stitched_ball.edge import OVAL, Edged, fit_edge

__all__ = ["place", "spread"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST = 0.7  # of a flight's regions: where the occlusion model holds in so many, it is taken
MODEL = 1e-3  # pixels that an outline which is no perfect circle moves a plain ball by
NEAR = 0.15  # of the radius, from where the ball was found to the occlusion model
TRIED = 16  # regions in which it is looked for what all share
FIRST_OVAL_U = 0.01  # of outlines whose oval is to be learnt
LEAST_OVAL_U = 2e-4  # of those whose oval was


def place(
    seen: Regions,
    start: Located,
    *,
    noise: Noise,
    optics: Optics,
    middle: tuple[float, float],
    flight: NDArray[np.intp] | None = None,
    oval: tuple[float, float] | None = None,
    mask: Mask | None = None,
) -> Located:
    """Return the balls' places in the full frame.

    Parameters
    ----------
    seen
        Regions that show a ball.
    start
        Where it is to a pixel or so.
    noise, optics
        Of the camera, and how well the blurs are known; the outline's fit holds them.
    middle
        Pixel that the camera's axis meets.
    flight
        Which flight each region shows, (region,): all of one show a plain ball or a stitched one,
        and of one radius but for a slope. Heights, and so radii, of flights in and out differ.
        By default all are of one.
    oval
        k, a sphere at d from the middle having the outline r = R (1 + k d² cos 2(a - a_d)) [1/px²],
        and the standard uncertainty of what is beside the 1; learnt from some regions by default.
    mask
        True where a pixel may be used, (region, row, col) or (1, row, col).
    """
    plain = refine(
        seen.pixels,
        seen.corners,
        start,
        noise=noise,
        optics=optics,
        background=seen.background.astype(float),
        mask=mask,
    ).located
    plain = replace(plain, pattern_u=np.where(np.isfinite(plain.x), MODEL, np.nan))
    if flight is None:
        flight = np.zeros(len(plain.x), np.intp)
    rest = np.flatnonzero(~_holds(plain, flight))
    if not rest.size:
        return plain
    # where half the rim is dark the occlusion model takes the lit part for a smaller ball
    near = np.abs(plain.radius / start.radius - 1) < NEAR
    start = replace(
        start,
        x=np.where(near, plain.x, start.x),
        y=np.where(near, plain.y, start.y),
        radius=np.where(near, plain.radius, start.radius),
    )

    def outlined(which: NDArray[np.intp], **known: Any) -> Edged:
        return fit_edge(
            seen.pixels[which],
            seen.corners[which],
            part_of(start, which),
            noise=noise,
            lens=optics.lens,
            background=seen.background[which].astype(float),
            mask=mask if mask is None or len(mask) == 1 else mask[which],
            **known,
        )

    axis = np.array(middle)
    off = _stretched(_places(start)[rest], axis)
    if oval is None:
        first = outlined(rest[spread(len(rest))], oval_u=FIRST_OVAL_U)
        oval = _learnt(first, axis, float(np.hypot(*off.T).max()))
    k, oval_u = oval
    found = outlined(rest, oval=k * off, oval_u=oval_u)
    return put(with_one_radius(found, k * np.hypot(*off.T), flight[rest]), rest, plain)


def spread(count: int) -> NDArray[np.intp]:
    """Return some of so many regions."""
    return np.unique(np.linspace(0, count - 1, min(count, TRIED)).astype(int))


def _holds(plain: Located, flight: NDArray[np.intp]) -> Mask:
    """Return whether the occlusion model holds for the flight of each region."""
    held = (plain.flags & (Flag.NOT_FOUND | Flag.POOR_FIT)) == 0
    held &= plain.chi_square < HOLDS
    _, which = np.unique(flight, return_inverse=True)
    share = np.bincount(which, held) / np.bincount(which)
    return np.asarray(share[which] >= MOST)


def _stretched(places: Array, middle: Array) -> Array:
    """Return d² (cos 2a, sin 2a) of places (region, 2) at d off the axis, in the direction a."""
    x, y = np.where(np.isfinite(places), places - middle, 0.0).T
    return np.stack([x**2 - y**2, 2 * x * y], axis=1)


def _learnt(first: Edged, middle: Array, most: float) -> tuple[float, float]:
    """Return what `place` wants of the oval: k, and what it leaves open of ovals up to k `most`.

    An outline is longer by 1 / cos b along the way from the axis, seen at an angle b off it.
    """
    good = (first.located.flags == 0) & np.isfinite(first.radius_u)
    if good.sum() < POOLED:
        return 0.0, OVAL
    shape = _stretched(_places(first.located), middle)[good].ravel()
    told = first.oval[good].ravel()
    weight = np.repeat(1 / first.radius_u[good] ** 2, 2)
    k, trust = 0.0, weight
    for _ in range(6):  # the middle of what they say, not the mean
        left = told - k * shape
        usual = 1.4826 * float(np.median(np.abs(left))) + 1e-9
        trust = weight / np.maximum(1.0, np.abs(left) / (2 * usual))
        k = float((trust * shape) @ told / max(float((trust * shape) @ shape), 1e-30))
    left = told - k * shape
    k_spread = float(np.sqrt((trust @ left**2) / trust.sum() / (len(told) - 1)))
    size = float(np.sqrt((trust @ shape**2) / trust.sum()))
    return max(k, 0.0), max(LEAST_OVAL_U, k_spread / max(size, 1.0) * most)


def _places(found: Located) -> Array:
    return np.stack([found.x, found.y], axis=1)
