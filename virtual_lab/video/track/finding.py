"""What moves in a full frame, and which of it may be a ball: a millisecond a frame."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.background import Image
from virtual_lab.video.clips.reading import Frame

__all__ = ["HALVINGS", "LEAST_RADIUS", "Finder", "Spot", "finder"]

HALVINGS = 2  # a frame is searched at a quarter of its size
LEAST_RADIUS = 3.0  # of a ball in the picture that is searched [pixels]
NOISES = 6.0  # of the picture searched: what differs by less is nothing
LEAST_STEP = 0.012  # of full scale, likewise: faint shadows
HALF = 0.45  # of a spot's own contrast: what is brighter is its inside
SHADED = 0.3  # of a spot's core darker than that: more shows light from one side
MOST = 8  # spots looked at in a frame, the largest
FILLED = (0.82, 1.12)  # of the area that an ellipse of its moments would have
GRID = 8  # every eighth pixel tells how bright the light is


@dataclass(frozen=True, slots=True)
class Spot:
    """Something that differs from the background, in pixels of the full frame."""

    x: float
    y: float
    radius: float  # across its longer axis
    blur_x: float  # by how much longer that is than its width
    blur_y: float
    contrast: float  # lighter than the background: above 0 [DN]
    round: bool  # the area fits its moments: no frame, no crescent
    cut: bool  # touches the frame's edge


@dataclass(frozen=True, slots=True, kw_only=True)
class Finder:
    """Finds spots; build it with `finder`."""

    halvings: int
    small: Image  # the background, made small
    threshold: float  # DN
    least: float  # area of a spot [pixels of the small picture]

    def spots(self, frame: Frame) -> list[Spot]:
        """Return what moves in a frame, the largest first."""
        import cv2

        seen = _shrunk(frame, self.halvings).astype(np.float32)
        level = np.median(seen[::GRID, ::GRID] / np.maximum(self.small[::GRID, ::GRID], 1.0))
        off = cv2.absdiff(seen, self.small * np.float32(level if 0.7 < level < 1.4 else 1.0))
        mask = cv2.inRange(off, self.threshold, np.inf)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(
            mask, connectivity=8, ltype=cv2.CV_16U
        )
        areas = stats[1:count, cv2.CC_STAT_AREA]
        largest = np.argsort(-areas, kind="stable")[:MOST] + 1
        kept = [k for k in largest.tolist() if stats[k, cv2.CC_STAT_AREA] >= self.least]
        return [self._spot(k, stats[k], labels, off, seen) for k in kept]

    def _spot(
        self,
        label: int,
        box: NDArray[np.int32],
        labels: NDArray[Any],
        off: NDArray[Any],
        seen: NDArray[Any],
    ) -> Spot:
        import cv2

        left, top, wide, high = map(int, box[:4])
        place = np.s_[top : top + high, left : left + wide]
        mine = labels[place] == label
        values = off[place][mine]
        bright = int(0.9 * len(values))
        peak = float(np.partition(values, bright)[bright])
        inside = mine & (off[place] > HALF * peak)
        core = cv2.erode(mine.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)
        if (core & ~inside).sum() > SHADED * core.sum():
            inside = mine  # a shaded side is the ball's too
        moments = cv2.moments(inside.view(np.uint8), binaryImage=True)
        area = moments["m00"]
        xx, yy, xy = (moments[key] / area for key in ("mu20", "mu02", "mu11"))
        apart = hypot((xx - yy) / 2, xy)
        short, long = (xx + yy) / 2 - apart + 1 / 12, (xx + yy) / 2 + apart + 1 / 12
        turned = atan2(2 * xy, xx - yy) / 2
        radius = 2 * sqrt(max(short, 1e-3))
        blur = sqrt(12 * max(0.0, long - short))
        scale = 2**self.halvings
        x = left + moments["m10"] / area
        y = top + moments["m01"] / area
        lighter = float((seen[place] - self.small[place])[mine].sum()) > 0
        rows, columns = self.small.shape
        return Spot(
            x=(x + 0.5) * scale - 0.5,
            y=(y + 0.5) * scale - 0.5,
            radius=radius * scale,
            blur_x=blur * cos(turned) * scale,
            blur_y=blur * sin(turned) * scale,
            contrast=peak if lighter else -peak,
            round=FILLED[0] < area / (4 * pi * sqrt(short * long)) < FILLED[1],
            cut=left == 0 or top == 0 or left + wide == columns or top + high == rows,
        )


def finder(
    background: Image, samples: Frame, full_scale: float, halvings: int = HALVINGS
) -> Finder:
    """Return the finder for a clip.

    Parameters
    ----------
    background
        The scene without the ball, (row, column) [DN].
    samples
        Some frames, for their noise.
    full_scale
        Greatest grey value [DN].
    halvings
        How often the frame is halved before it is searched: less often for a small ball.
    """
    small = _shrunk(background, halvings)
    few = [_shrunk(sample, halvings)[::4, ::4].astype(np.float32) for sample in samples[::4]]
    off = [after - before for before, after in itertools.pairwise(few)] or [np.zeros(1)]
    # what all pixels have in common is the light's flicker
    apart = np.concatenate([np.abs(each - np.median(each)).ravel() for each in off])
    noise = 1.4826 * float(np.median(apart)) / sqrt(2)
    return Finder(
        halvings=halvings,
        small=small,
        threshold=max(NOISES * noise, LEAST_STEP * full_scale),
        least=0.5 * pi * LEAST_RADIUS**2,
    )


def _shrunk(image: Frame, halvings: int) -> Frame:
    """Return an image at half its size, some times over: much quicker than at once."""
    import cv2

    for _ in range(halvings):
        rows, columns = image.shape[0] // 2, image.shape[1] // 2
        whole = image[: 2 * rows, : 2 * columns]  # else it would be stretched
        image = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
    return image
