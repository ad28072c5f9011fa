"""The ball's place to the physical limit in a clip that tells of its camera itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.located import Flag, Located, chosen, part_of, put
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.place import place, spread
from virtual_lab.video.locate.plain_ball.refining import Optics
from virtual_lab.video.locate.quick import quick
from virtual_lab.video.locate.regions import Regions
from virtual_lab.video.locate.seeing import lens_of, noise_of_ball, noise_of_clip

__all__ = ["Refined", "locate"]

Mask = NDArray[np.bool_]

BLUR = 0.05  # of a blur, how far it may be off, and as many pixels
CUT = Flag.CLIPPED | Flag.SATURATED
SPOILT = Flag.NOT_FOUND | Flag.POOR_FIT
FAR = 0.05  # of the radius: a fit that goes so far from its start may be led astray


@dataclass(slots=True)
class Refined:
    """A `Locator` of one clip, which learns noise and lens from its first regions."""

    known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        start = replace(start, pattern_u=None)
        middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
        if not self.known:
            tried = spread(len(start.x))
            first, begin = seen.part(tried), part_of(start, tried)
            begin = _nearer(begin, quick(clip, first, begin))
            noise = noise_of_ball(noise_of_clip(clip), first, begin)
            self.known = {"noise": noise, "lens": lens_of(first, begin, noise, middle)}
        fine = locate(seen, start, middle=middle, mask=seen.mask, **self.known)
        far = np.hypot(fine.x - start.x, fine.y - start.y) > FAR * start.radius
        far |= np.abs(fine.radius - start.radius) > 2 * FAR * start.radius
        astray = (fine.flags & SPOILT > 0) | far
        if seen.mask is not None:  # quick would take what hides the ball for its edge
            astray &= seen.mask.all(axis=(1, 2))
        spoilt = np.flatnonzero(astray)
        if not spoilt.size:
            return fine
        # a better start may be all that is missing
        some, begin = seen.part(spoilt), part_of(start, spoilt)
        rough = quick(clip, some, begin)
        again = locate(some, _nearer(begin, rough), middle=middle, **self.known)
        poor = (again.flags & Flag.POOR_FIT > 0) & (rough.flags == 0)
        again = chosen(poor, _as_far_apart(rough, again), again)
        return put(again, spoilt, fine)


def locate(
    seen: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    mask: Mask | None = None,
) -> Located:
    """Return the places in the full frame of one ball, whose oval is learnt: see `place`.

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
    blur = float(np.nanmax(np.hypot(start.blur_x, start.blur_y)))
    optics = Optics(lens=lens, blur_u=BLUR * (1 + blur))
    return place(seen, start, noise=noise, optics=optics, middle=middle, mask=mask)


def _nearer(start: Located, rough: Located) -> Located:
    """Return where quick saw the ball, or may have, and the start elsewhere."""
    found = (rough.flags | np.uint16(CUT)) == CUT
    return chosen(found, replace(rough, pattern_u=None), start)


def _as_far_apart(rough: Located, fine: Located) -> Located:
    """Return quick's places, each as uncertain as a poor fit's is off it."""
    return replace(
        rough,
        x_u=np.hypot(rough.x_u, rough.x - fine.x),
        y_u=np.hypot(rough.y_u, rough.y - fine.y),
    )
