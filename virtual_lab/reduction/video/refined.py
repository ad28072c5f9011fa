"""The ball's place to the physical limit: the occlusion fit where it holds, the edge fit elsewhere.

What all regions of one ball share makes each of them sharper: its radius, and the oval that a
sphere off the camera's axis shows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.reduction.video.clip import Clip
from virtual_lab.reduction.video.edge import Edged, fit_edge
from virtual_lab.reduction.video.located import Flag, Located
from virtual_lab.reduction.video.noise import Noise
from virtual_lab.reduction.video.quick import quick
from virtual_lab.reduction.video.refining import Optics, refine
from virtual_lab.reduction.video.regions import Regions
from virtual_lab.reduction.video.seeing import HOLDS, lens_of, noise_of_ball, noise_of_clip, part_of

__all__ = ["Refined", "locate"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST = 0.7  # of the regions: where the occlusion model holds in so many, it is the clip's
BLUR = 0.05  # of a blur, how far it may be off, and as many pixels
TRIED = 16  # regions in which it is looked for what all share
POOLED = 6  # regions at least that tell what all share
MODEL = 1e-3  # pixels that an outline which is no perfect circle moves a plain ball by
OVAL = 0.01  # of an outline at first
STRANGE = 3.0  # standard uncertainties that a radius may be off by
SHARED = 0.02, 2e-4  # least uncertainties of what is shared: radius [pixel], oval
NAMES = tuple(each.name for each in fields(Located))
CUT = Flag.CLIPPED | Flag.SATURATED


@dataclass(slots=True)
class Refined:
    """A `Locator` of one clip, which learns noise and lens from its first regions."""

    known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        rough = quick(clip, seen, start)
        found = (rough.flags | np.uint16(CUT)) == CUT
        begin = _chosen(found, replace(rough, pattern_u=None), replace(start, pattern_u=None))
        middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
        if not self.known:
            noise = noise_of_ball(noise_of_clip(clip), seen, begin)
            self.known = {"noise": noise, "lens": lens_of(seen, begin, noise, middle)}
        fine = locate(seen, begin, middle=middle, **self.known)
        # what touches the ball the rays see; where a fit fails they may still do
        fine.flags[(rough.flags & Flag.OVERLAP) > 0] |= np.uint16(Flag.OVERLAP)
        spoilt = (fine.flags & (Flag.NOT_FOUND | Flag.POOR_FIT)) > 0
        return _chosen(spoilt & (rough.flags == 0), rough, fine)


def locate(
    seen: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    mask: Mask | None = None,
) -> Located:
    """Return the ball's places in the full frame.

    Parameters
    ----------
    seen
        Regions that show one ball.
    start
        Where it is to a pixel or so.
    noise, lens
        Of the camera: its noise, the standard deviation of its lens's blur [pixel].
    middle
        Pixel that the camera's axis meets.
    mask
        True where a pixel may be used, (region, row, col) or (1, row, col).
    """
    behind = seen.background.astype(float)
    optics = Optics(
        lens=lens, blur_u=BLUR * (1 + float(np.nanmax(np.hypot(start.blur_x, start.blur_y))))
    )
    plain = refine(
        seen.pixels, seen.corners, start, noise=noise, optics=optics, background=behind, mask=mask
    ).located
    plain = replace(plain, pattern_u=np.where(np.isfinite(plain.x), MODEL, np.nan))
    holds = (plain.flags & (Flag.NOT_FOUND | Flag.POOR_FIT)) == 0
    holds &= plain.chi_square < HOLDS
    if holds.mean() >= MOST:
        return plain
    tried = np.unique(np.linspace(0, len(start.x) - 1, min(len(start.x), TRIED)).astype(int))
    some = _fitted(seen, tried, start, noise, lens, behind, mask, oval_u=OVAL)
    all_ = np.arange(len(start.x))
    good = (some.located.flags == 0) & np.isfinite(some.radius_u)
    if good.sum() < POOLED:
        return _fitted(seen, all_, start, noise, lens, behind, mask).located
    axis = np.array(middle)
    k, k_u = _oval(some, good, axis)
    off = _stretched(np.stack([start.x, start.y], axis=1), axis)
    oval_u = max(SHARED[1], k_u * float(np.hypot(*off.T).max()))
    found = _fitted(seen, all_, start, noise, lens, behind, mask, oval=k * off, oval_u=oval_u)
    return _with_one_radius(found, k * np.hypot(*off.T))


def _fitted(
    seen: Regions,
    which: NDArray[np.intp],
    start: Located,
    noise: Noise,
    lens: float,
    behind: Array,
    mask: Mask | None,
    **known: Any,
) -> Edged:
    """Return the edge fits of some regions."""
    cover = mask if mask is None or len(mask) == 1 else mask[which]
    return fit_edge(
        seen.pixels[which],
        seen.corners[which],
        part_of(start, which),
        noise=noise,
        lens=lens,
        background=behind if len(behind) == 1 else behind[which],
        mask=cover,
        **known,
    )


def _places(found: Located) -> Array:
    return np.stack([found.x, found.y], axis=1)


def _stretched(places: Array, middle: Array) -> Array:
    """Return d² (cos 2a, sin 2a) of places (region, 2) at d off the axis, in the direction a."""
    x, y = np.where(np.isfinite(places), places - middle, 0.0).T
    return np.stack([x**2 - y**2, 2 * x * y], axis=1)


def _oval(first: Edged, good: Mask, middle: Array) -> tuple[float, float]:
    """Return k and its uncertainty: a sphere's outline is r = R (1 + k d² cos 2(a - a_d)).

    It is longer by 1 / cos b along the way from the axis, seen at an angle b off it.
    """
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
    spread = float(np.sqrt((trust @ left**2) / trust.sum() / (len(told) - 1)))
    size = float(np.sqrt((trust @ shape**2) / trust.sum()))
    return max(k, 0.0), spread / max(size, 1.0)


def _with_one_radius(found: Edged, oval: Array) -> Located:
    """Return places told anew by what all regions together say of the ball's radius.

    Where a fit's own radius is far from that, a pattern at the rim was taken for the outline:
    the place may be off by as much.
    """
    located = found.located
    good = (located.flags == 0) & np.isfinite(found.radius_u)
    if good.sum() < POOLED or located.pattern_u is None:
        return located
    radius, radius_u = _radius(found, good, oval)
    off = radius - located.radius
    own = found.covariance[:, 2, 2]
    gain = found.covariance[:, :2, 2] / (own + radius_u**2)[:, None]
    total = np.diagonal(found.covariance, axis1=1, axis2=2)[:, :2]
    left = np.sqrt(np.clip(1 - gain * found.covariance[:, :2, 2] / total, 0.0, 1.0))
    strange = np.where(np.abs(off) > STRANGE * np.hypot(found.radius_u, radius_u), off, 0.0)
    pattern = [found.x_pattern_u * left[:, 0], found.y_pattern_u * left[:, 1], strange, strange]
    return replace(
        located,
        x=located.x + gain[:, 0] * off,
        y=located.y + gain[:, 1] * off,
        radius=located.radius + own / (own + radius_u**2) * off,
        x_u=located.x_u * left[:, 0],
        y_u=located.y_u * left[:, 1],
        pattern_u=np.sqrt(np.sum(np.square(pattern), axis=0) / 2),
    )


def _radius(found: Edged, good: Mask, oval: Array) -> tuple[Array, float]:
    """Return each region's radius as all tell it, and its uncertainty [pixel].

    The scale may slope over the picture, and a sphere's radius grows as its oval does.
    """
    places = _places(found.located)
    off = np.where(np.isfinite(places), places - np.nanmean(places[good], axis=0), 0.0) / 1000.0
    design = np.column_stack([np.ones(len(off)), off]) * (1 + oval)[:, None]
    shown, told, u = design[good], found.located.radius[good], found.radius_u[good]
    trust, usual = 1 / u**2, 1.0
    slope = np.diag([0.0, 1.0, 1.0])  # 1 px over 1000: as much as a camera is likely to be tilted
    for _ in range(6):
        inverse = np.linalg.inv((shown.T * trust) @ shown + slope)
        solved = inverse @ (shown.T @ (trust * told))
        left = (told - shown @ solved) / u
        usual = max(1.4826 * float(np.median(np.abs(left))), 1.0)
        trust = 1 / (u**2 * np.maximum(1.0, np.abs(left) / (2 * usual)))
    spread = usual * np.sqrt(np.einsum("ij,jk,ik->i", design, inverse, design).max())
    return design @ solved, max(SHARED[0], float(spread))


def _chosen(which: Mask, one: Located, other: Located) -> Located:
    """Return the regions of one where `which` says so, of the other elsewhere."""
    taken: dict[str, Any] = {}
    for name in NAMES:
        first, second = getattr(one, name), getattr(other, name)
        taken[name] = None if first is None or second is None else np.where(which, first, second)
    return Located(**taken)
