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
SHARED = 0.004, 2e-4  # least uncertainties of what is shared: radius [pixel], oval
NAMES = tuple(each.name for each in fields(Located))
CUT = Flag.CLIPPED | Flag.SATURATED
SPOILT = Flag.NOT_FOUND | Flag.POOR_FIT
FAR = 0.05  # of the radius: a fit that goes so far from its start may be led astray
NEAR = 0.15  # of the radius, from where the ball was found to the occlusion model


@dataclass(slots=True)
class Refined:
    """A `Locator` of one clip, which learns noise and lens from its first regions."""

    known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        start = replace(start, pattern_u=None)
        middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
        if not self.known:
            tried = _spread(len(start.x))
            first, begin = seen.part(tried), part_of(start, tried)
            begin = _nearer(begin, quick(clip, first, begin))
            noise = noise_of_ball(noise_of_clip(clip), first, begin)
            self.known = {"noise": noise, "lens": lens_of(first, begin, noise, middle)}
        fine = locate(seen, start, middle=middle, **self.known)
        far = np.hypot(fine.x - start.x, fine.y - start.y) > FAR * start.radius
        far |= np.abs(fine.radius - start.radius) > 2 * FAR * start.radius
        spoilt = np.flatnonzero((fine.flags & SPOILT > 0) | far)
        if not spoilt.size:
            return fine
        # a better start may be all that is missing
        some, begin = seen.part(spoilt), part_of(start, spoilt)
        rough = quick(clip, some, begin)
        again = locate(some, _nearer(begin, rough), middle=middle, **self.known)
        poor = (again.flags & Flag.POOR_FIT > 0) & (rough.flags == 0)
        again = _chosen(poor, _as_far_apart(rough, again), again)
        return _put(again, spoilt, fine)


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
    # where half the rim is dark the occlusion model takes the lit part for a smaller ball
    near = np.abs(plain.radius / start.radius - 1) < NEAR
    start = replace(
        start,
        x=np.where(near, plain.x, start.x),
        y=np.where(near, plain.y, start.y),
        radius=np.where(near, plain.radius, start.radius),
    )
    tried = _spread(len(start.x))
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


def _spread(count: int) -> NDArray[np.intp]:
    """Return some of so many regions."""
    return np.unique(np.linspace(0, count - 1, min(count, TRIED)).astype(int))


def _nearer(start: Located, rough: Located) -> Located:
    """Return where quick saw the ball, or may have, and the start elsewhere."""
    found = (rough.flags | np.uint16(CUT)) == CUT
    return _chosen(found, replace(rough, pattern_u=None), start)


def _as_far_apart(rough: Located, fine: Located) -> Located:
    """Return quick's places, each as uncertain as a poor fit's is off it."""
    return replace(
        rough,
        x_u=np.hypot(rough.x_u, rough.x - fine.x),
        y_u=np.hypot(rough.y_u, rough.y - fine.y),
    )


def _chosen(which: Mask, one: Located, other: Located) -> Located:
    """Return the regions of one where `which` says so, of the other elsewhere."""
    taken: dict[str, Any] = {}
    for name in NAMES:
        first, second = getattr(one, name), getattr(other, name)
        taken[name] = None if first is None or second is None else np.where(which, first, second)
    return Located(**taken)


def _put(some: Located, where: NDArray[np.intp], all_: Located) -> Located:
    """Return all regions with some of them replaced."""
    taken: dict[str, Any] = {}
    for name in NAMES:
        whole, part = getattr(all_, name), getattr(some, name)
        taken[name] = whole
        if whole is not None and part is not None:
            taken[name] = whole.copy()
            taken[name][where] = part
    return Located(**taken)
