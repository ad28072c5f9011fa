"""Sharp positions of one ball in a clip, by a fit of its outline in each region."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.edge_fit import RIM_FIT, fit_edge
from virtual_lab.video.locate.located import Located, Regions, part_of
from virtual_lab.video.locate.noise import Noise


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpSettings:
    """Settings of a ball's fit: its rounds and starting points."""

    # number of pixels from the sampled frames, enough for the noise to 1 %
    noise_sample_px: float = 5e5
    # smallest radius of a blob that is a whole ball [share of the ball's radius]; part of a smaller
    # blob is in the dark
    lit_share: float = 0.93
    # largest shift from start to end of a fit. After a larger shift the fit is repeated, because it
    # may have mistaken the outline for a pattern.
    refit_shift_px: float = 0.3
    rounds: int = 4


SHARP = SharpSettings()


def noise_of_clip(clip: Clip) -> Noise:
    """Return the noise of a clip's pixels from frame to frame.

    It is estimated from the frames that were sampled for the background, of which there must be at
    least two.
    """
    every = max(1, int(np.sqrt(clip.samples.size / SHARP.noise_sample_px)))
    return Noise.from_frames(clip.grey_samples(every), clip.full_scale)


def sharp_places(
    clip: Clip, regions: Regions, start: Located, *, lens: float, ball_radius: float | None = None
) -> Located:
    """Return the ball in regions of a clip, with its positions in pixels of the full frame.

    A ball that cannot be fitted has the flag `NOT_FOUND`, and its position is NaN.

    Parameters
    ----------
    start
        Position of the ball to about a pixel, its radius, and its motion blur.
    lens
        Standard deviation of the blur of the lens [pixels].
    ball_radius
        Radius of the ball, if the scale of the clip is known [pixels]. With it, a ball that is lit
        from the side is located by its lit limb.
    """
    if ball_radius and float(np.median(start.radius)) < SHARP.lit_share * ball_radius:
        start = on_the_limb(regions, replace(start, radius=np.full(len(start.x), ball_radius)))
    middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
    return place(regions, start, noise=noise_of_clip(clip), lens=lens, middle=middle)


def place(
    regions: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    oval: tuple[float, float] = (0.0, RIM_FIT.oval_u),
) -> Located:
    """Return the ball in regions, with its positions in pixels of the full frame.

    A ball that cannot be fitted has the flag `NOT_FOUND`, and its position is NaN.

    Parameters
    ----------
    start
        Position of the ball to about a pixel, its radius, and its motion blur.
    lens
        Standard deviation of the blur of the lens [pixels].
    middle
        Position (x, y) of the camera's axis in the frame [pixels].
    oval
        The factor k [1/px²], and the standard uncertainty of k d². A sphere at the distance d from
        `middle`, in the direction a_d, has the outline r = R (1 + k d² cos 2(a - a_d)).
    """
    x, y = np.nan_to_num(start.places - middle).T
    k, oval_u = oval
    ovals = k * np.stack([x**2 - y**2, 2 * x * y], axis=1)
    left = np.arange(len(x))
    result = part_of(start, left)  # a copy
    for _ in range(SHARP.rounds):
        some, begin = part_of(regions, left), part_of(result, left)
        fitted = fit_edge(some, begin, noise=noise, lens=lens, oval=ovals[left], oval_u=oval_u)
        for each in fields(Located):
            getattr(result, each.name)[left] = getattr(fitted, each.name)
        moved = np.hypot(*(fitted.places - begin.places).T)
        left = left[np.fmax(moved, np.abs(fitted.radius - begin.radius)) > SHARP.refit_shift_px]
        if not left.size:
            break
    return result


def standing_out(off: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a mask (1: set) of the pixels brighter than the background, by Otsu's threshold.

    `off` is the difference of a picture from its background [DN]; the mask has its shape.
    """
    import cv2

    grey = np.clip(255 * off / max(float(off.max()), 1.0), 0, 255).astype(np.uint8)
    return np.asarray(cv2.threshold(grey, 0, 1, cv2.THRESH_OTSU)[1], np.uint8)


def on_the_limb(regions: Regions, start: Located) -> Located:
    """Return `start` with positions from the lit limb of the ball, correct to a pixel or two.

    A lamp at the side lights only part of a ball. One side of the outline of this part is the limb
    of the ball, and the other side is the border of the shade. The position is the center of the
    circle with the radius in `start` that contains most of the outline. A region without a limb
    keeps the position of `start`. The motion during an exposure must be small compared with the
    radius, which must be correct to 3 %.
    """
    import cv2

    x, y = start.x.copy(), start.y.copy()
    for k, (left, top) in enumerate(regions.corners):
        off = np.abs(regions.pixels[k].astype(np.float32) - regions.background[k])
        smooth = cv2.GaussianBlur(off, (0, 0), 1.0)
        contours, _ = cv2.findContours(
            standing_out(smooth), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        largest = max(contours, key=cv2.contourArea, default=None)
        if largest is None or len(largest) < start.radius[k]:
            continue
        outline = np.zeros(off.shape, np.float32)
        cv2.polylines(outline, [cv2.convexHull(largest)], True, 1.0)
        radius = round(float(start.radius[k]))
        ring = np.zeros([2 * radius + 3] * 2, np.float32)
        cv2.circle(ring, (radius + 1, radius + 1), radius, 1.0)
        votes = cv2.filter2D(outline, -1, ring, borderType=cv2.BORDER_CONSTANT)
        column, row = cv2.minMaxLoc(cv2.GaussianBlur(votes, (0, 0), 1.0))[3]
        x[k], y[k] = left + column, top + row
    return replace(start, x=x, y=y)
