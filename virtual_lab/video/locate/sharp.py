"""Sharp places of one ball in a clip: its outline fitted, region by region.

Noise, lens and the oval that a sphere off the camera's axis shows are learnt from some of the
regions, where the camera is not known.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.edge_fit import OVAL, EdgeFit, fit_edge
from virtual_lab.video.locate.limb import on_the_limb
from virtual_lab.video.locate.located import Located, part_of, put
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.regions import Regions
from virtual_lab.video.locate.seeing import lens_of, noise_of_ball, noise_of_clip

__all__ = ["Sharp", "place"]

Array = NDArray[np.float64]

TRIED = 16  # regions in which it is looked for what all share
LIT = 0.93  # of the ball: less of it is light, the rest in the dark
LEAST = 6  # good ones among them that tell it
FIRST_OVAL_U = 0.01  # of outlines whose oval is to be learnt
LEAST_OVAL_U = 2e-4  # of those whose oval was
AGAIN = 0.3  # pixels, from start to end: by then the fit may have taken outline for pattern
ROUNDS = 4


@dataclass(slots=True)
class Sharp:
    """A `Locator` of one clip, which learns noise and lens from its first regions."""

    ball_radius: float | None = None  # [pixel], where the clip's scale is known
    known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        if self.ball_radius and float(np.median(start.radius)) < LIT * self.ball_radius:
            whole = np.full(len(start.x), self.ball_radius)
            start = on_the_limb(seen, replace(start, radius=whole))
        middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
        if not self.known:
            tried = _spread(len(start.x))
            first, begin = seen.part(tried), part_of(start, tried)
            noise = noise_of_ball(noise_of_clip(clip), first, begin)
            self.known = {"noise": noise, "lens": lens_of(first, begin, noise, middle)}
        return place(seen, start, middle=middle, **self.known)


def place(
    seen: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    oval: tuple[float, float] | None = None,
) -> Located:
    """Return the ball's places in the full frame.

    Parameters
    ----------
    seen
        Regions that show a ball.
    start
        Where it is to a pixel or so.
    noise, lens
        Of the camera: its noise, the standard deviation of its lens's blur [pixel].
    middle
        Pixel that the camera's axis meets.
    oval
        k, a sphere at d from the middle having the outline r = R (1 + k d² cos 2(a - a_d)) [1/px²],
        and the standard uncertainty of what is beside the 1; learnt from some regions by default.
    """

    def outlined(which: NDArray[np.intp], start: Located, **known: Any) -> EdgeFit:
        return fit_edge(
            seen.pixels[which],
            seen.corners[which],
            start,
            noise=noise,
            lens=lens,
            background=seen.background[which].astype(float),
            **known,
        )

    axis = np.array(middle)
    off = _stretched(_places(start), axis)
    if oval is None:
        some = _spread(len(off))
        first = outlined(some, part_of(start, some), oval_u=FIRST_OVAL_U)
        oval = _learnt(first, axis, float(np.hypot(*off.T).max()))
    k, oval_u = oval
    found, left = replace(start, pattern_u=np.full(len(off), np.nan)), np.arange(len(off))
    for _ in range(ROUNDS):
        begin = part_of(found, left)
        fitted = outlined(left, begin, oval=k * off[left], oval_u=oval_u).located
        found = put(fitted, left, found)
        moved = np.hypot(*(_places(fitted) - _places(begin)).T)
        left = left[np.fmax(moved, np.abs(fitted.radius - begin.radius)) > AGAIN]
        if not left.size:
            break
    return found


def _spread(count: int) -> NDArray[np.intp]:
    """Return some of so many regions."""
    return np.unique(np.linspace(0, count - 1, min(count, TRIED)).astype(int))


def _stretched(places: Array, middle: Array) -> Array:
    """Return d² (cos 2a, sin 2a) of places (region, 2) at d off the axis, in the direction a."""
    x, y = np.where(np.isfinite(places), places - middle, 0.0).T
    return np.stack([x**2 - y**2, 2 * x * y], axis=1)


def _learnt(first: EdgeFit, middle: Array, most: float) -> tuple[float, float]:
    """Return what `place` wants of the oval: k, and what it leaves open of ovals up to k `most`.

    An outline is longer by 1 / cos b along the way from the axis, seen at an angle b off it.
    """
    good = (first.located.flags == 0) & np.isfinite(first.radius_u)
    if good.sum() < LEAST:
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
