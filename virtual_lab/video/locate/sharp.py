"""Sharp positions of one ball in a clip, by a fit of its outline in each region."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.edge_fit import RIM_FIT, fit_edge
from virtual_lab.video.locate.located import Located, Regions, part_of
from virtual_lab.video.locate.noise import Noise

NOISE_SAMPLE_PX = 5e5  # number of pixels from the sampled frames, enough for the noise to 1 %
# smallest radius of a blob that is a whole ball [share of the ball's radius]; part of a smaller
# blob is in the dark
LIT_SHARE = 0.93
# largest shift from start to end of a fit. After a larger shift the fit is repeated, because it may
# have mistaken the outline for a pattern.
REFIT_SHIFT_PX = 0.3
ROUNDS = 4


def sharp_places(
    clip: Clip, regions: Regions, start: Located, *, lens: float, ball_radius: float | None = None
) -> Located:
    """Return position and radius of the ball in regions of a clip, from fits of its outline.

    Positions are in pixels of the full frame. A ball that cannot be fitted has the flag
    `NOT_FOUND`, and its position is NaN. The noise of the pixels is found from the differences
    between the sampled frames, of which there must be at least two.

    Parameters
    ----------
    start
        Position of the ball to about a pixel, its radius, and its motion blur.
    lens
        Standard deviation of the blur of the lens [pixels].
    ball_radius
        Radius of the ball [pixels]; None if the scale of the clip is unknown. With it, a ball that
        is lit from the side is located by its lit edge.
    """
    if ball_radius and float(np.median(start.radius)) < LIT_SHARE * ball_radius:
        start = on_the_limb(regions, replace(start, radius=np.full(len(start.x), ball_radius)))
    middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
    every = max(1, int(np.sqrt(clip.samples.size / NOISE_SAMPLE_PX)))
    noise = Noise.from_frames(clip.grey_samples(every), clip.full_scale)
    return place(regions, start, noise=noise, lens=lens, middle=middle)


def place(
    regions: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    oval: tuple[float, float] = (0.0, RIM_FIT.oval_u),
) -> Located:
    """Return position and radius of the ball in regions, from fits of its outline.

    Positions are in pixels of the full frame. A ball that cannot be fitted has the flag
    `NOT_FOUND`, and all its values are NaN, except for the blur. A fit that changes the position or
    the radius by more than 0.3 pixels is repeated, at most three times.

    Parameters
    ----------
    start
        Position of the ball to about a pixel, its radius, and its motion blur.
    noise
        Noise of the camera.
    lens
        Standard deviation of the blur of the lens [pixels].
    middle
        Position (x, y) of the camera's axis in the frame [pixels].
    oval
        Two numbers that describe the oval outline of a ball away from `middle`: a factor k [1/px²],
        and the standard uncertainty of k d². Here d is the ball's distance from `middle` [pixels].
        In the direction at an angle a from the line through `middle` and the ball, the outline has
        the radius r = R (1 + k d² cos 2a), where R is the mean radius.
    """
    x, y = np.nan_to_num(start.places - middle).T
    k, oval_u = oval
    ovals = k * np.stack([x**2 - y**2, 2 * x * y], axis=1)
    left = np.arange(len(x))
    result = part_of(start, left)  # a copy
    for _ in range(ROUNDS):
        some, begin = part_of(regions, left), part_of(result, left)
        fitted = fit_edge(some, begin, noise=noise, lens=lens, oval=ovals[left], oval_u=oval_u)
        for each in fields(Located):
            getattr(result, each.name)[left] = getattr(fitted, each.name)
        moved = np.hypot(*(fitted.places - begin.places).T)
        left = left[np.fmax(moved, np.abs(fitted.radius - begin.radius)) > REFIT_SHIFT_PX]
        if not left.size:
            break
    return result


def standing_out(off: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a mask of the pixels with a large difference from the background; 1 is selected.

    `off` is this difference [DN]; negative values count as 0. The limit is Otsu's threshold. The
    mask has the shape of `off`.
    """
    import cv2

    grey = np.clip(255 * off / max(float(off.max()), 1.0), 0, 255).astype(np.uint8)
    return np.asarray(cv2.threshold(grey, 0, 1, cv2.THRESH_OTSU)[1], np.uint8)


def on_the_limb(regions: Regions, start: Located) -> Located:
    """Return a copy of `start` with approximate positions of balls that are lit from the side.

    A lamp at the side lights only part of a ball. The outline of this part is the edge of the ball
    (the limb) on one side, and the border of the shade on the other side. The new position is the
    center of the circle that contains most of the outline. It is accurate to one or two pixels. The
    circle has the radius in `start`, which must be correct to 3 %. The shift of the ball during an
    exposure must be small compared with the radius. If no limb is found in a region, the position
    in `start` is kept.
    """
    import cv2

    x, y = start.x.copy(), start.y.copy()
    for k, (left, top) in enumerate(regions.corners):
        off = np.abs(regions.pixels[k].astype(np.float32) - regions.background[k])
        smooth = cv2.GaussianBlur(off, (0, 0), 1.0)
        mask = standing_out(smooth)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
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
