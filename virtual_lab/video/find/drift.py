"""Drift of a picture from the still frame: shift, growth and turn, by least squares on its edges.

The method is Gauss-Newton on gray values (Lucas and Kanade 1981) with Tukey's biweight: pixels of
moving objects have a large residual and are left out. Steep edges have the largest weight, because
a codec keeps flat edges in place. A step that is too large for this method is found by phase
correlation of small pictures.

A drift is an array (4,): shift to the right and down [pixels], growth, and turn [rad] from x to y.
Growth and turn are about the middle of the picture; during a clip a hand turns a phone by a degree,
and its lens focuses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _Alignment:
    """Settings of the alignment of two pictures."""

    pixels: int = 4000  # largest number of pixels that take part
    steps: int = 10
    settled: float = 0.01  # largest step at which the alignment has converged [pixels]
    tukey: float = 4.7  # residual beyond which a pixel has no weight [standard deviations]
    # weights that keep shift, growth and turn near their start [shares of the weight of a shift],
    # because an edge does not show a shift along itself, and a small object shows neither growth
    # nor turn
    hold: tuple[float, ...] = (0.01, 0.01, 0.2, 0.05)
    # longer side of the small pictures in which a large step is searched [pixels]
    coarse: int = 128
    # smallest steepness of an edge that shows a drift if there are few [DN/px]; H.264 keeps flatter
    # edges in place while the camera drifts
    coded: float = 6.0
    # largest ratio of costs at which a drift far from the likely drift replaces it
    far: float = 0.6


_ALIGN = _Alignment()
STEEP = 2.0  # smallest steepness of an edge [DN/px]; smaller values are noise
PARTS = 12  # number of parts of a picture along each axis in which edges are counted
FAR_OFF = 2.0  # distance beyond which an edge moves by itself, or a picture has leapt [pixels]
BLACK = 12  # gray level [DN] of a pixel that is not part of the picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """Pixels of a picture at steep edges, (pixel,)."""

    places: Array  # (pixel, 1, 2) x and y in the still frame [pixels]
    value: Array  # gray value [DN]
    # (pixel, 4), change of the gray value per unit of drift; growth and turn are in pixels at the
    # middle of the longer side [DN/px]
    design: Array

    def drift(self, grey: Image, *starts: Array) -> Array:
        """Return the drift (4,) near the first start, or near another start that fits far better.

        It is the first start itself if no other drift fits better.
        """
        grey = grey.astype(np.float32)  # converted once for all calls of `_cost`
        best, least = starts[0], self._cost(grey, starts[0])
        for k, start in enumerate(starts):
            leaps = np.hypot(*(start - best)[:2]) > FAR_OFF
            if leaps or k == 0:
                drift = self._settle(grey, start)
                cost = self._cost(grey, drift)
                if cost < (_ALIGN.far if leaps else 1.0) * least:
                    best, least = drift, cost
        return best

    def _cost(self, grey: Image, drift: Array) -> float:
        """Return the sum of the clipped deviations at all edges for a drift [DN].

        An edge outside the picture counts as the limit of the clipping.
        """
        clip = FAR_OFF * np.hypot(*self.design[:, :2].T)
        return float(np.fmin(np.abs(self.deviation(grey, drift)), clip).sum())

    def deviation(self, grey: Image, drift: Array) -> Array:
        """Return the gray values of a drifted picture minus those of the edges [DN].

        The deviation is NaN for an edge outside the picture.
        """
        if not self.value.size:  # OpenCV fails without a pixel
            return self.value
        at = cv2.transform(self.places, matrix_of(drift, grey.shape[1::-1])).astype(np.float32)
        real, (x, y) = grey.astype(np.float32, copy=False), cv2.split(at)
        view = cv2.remap(real, x, y, cv2.INTER_LINEAR, borderValue=np.nan).ravel()
        visible = view > 0
        light = upper_median(self.value[visible] / view[visible]) if visible.any() else 1.0
        return np.where(visible, light * view - self.value, np.nan)

    def count_parts(self, size: tuple[int, int]) -> int:
        """Count the parts of a picture of this size that have edges.

        One object may move by itself, so the largest group of parts that spans less than half of
        the picture is left out.
        """
        x, y = self.places[np.hypot(*self.design[:, :2].T) > _ALIGN.coded, 0].T
        ends = [(0, side) for side in size]
        textured = np.histogram2d(x, y, PARTS, ends)[0] >= 3
        _, _, stats, _ = cv2.connectedComponentsWithStats(textured.astype(np.uint8))
        reach = stats[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1, initial=0)
        return int(textured.sum() - stats[1:, cv2.CC_STAT_AREA][reach < PARTS / 2].max(initial=0))

    def _settle(self, grey: Image, start: Array) -> Array:
        """Return the drift of a picture, refined from a start close to the true drift."""
        drift, side = start, max(grey.shape) / 2
        units = np.array([1.0, 1.0, side, side])
        for _ in range(_ALIGN.steps):
            left = self.deviation(grey, drift)
            finite = np.isfinite(left)
            left, design = left[finite], self.design[finite]
            if not left.size:
                break
            spread = 1.0 + 1.4826 * upper_median(np.abs(left))
            weight = np.maximum(0, 1 - (left / (_ALIGN.tukey * spread)) ** 2) ** 2
            normal = design.T @ (weight[:, None] * design)
            hold = (np.trace(normal[:2, :2]) + 1e-3) * np.array(_ALIGN.hold)
            # A picture shifted by s has, at x + s, the value of x.
            away = np.clip(units * (drift - start), -1.0, 1.0)
            off = design.T @ (weight * left) + hold * away
            step = np.linalg.solve(normal + np.diag(hold), off)
            drift = drift - step / units
            if np.abs(step).max() < _ALIGN.settled:
                break
        return drift


def edges_of(
    grey: Image,
    size: tuple[int, ...] | None = None,
    origin: tuple[int, int] = (0, 0),
    *,
    turns: bool = True,
) -> Edges:
    """Return the pixels at steep edges of a gray picture, for the alignment of pictures.

    Positions refer to the first picture of the clip, to which the other pictures are aligned.
    Pixels near the border of the picture or near black bars are left out. If there are too many
    pixels, every n-th one is kept.

    Parameters
    ----------
    grey
        Gray values, (row, column) [DN].
    size
        Columns and rows of the pictures to align; by default those of `grey`.
    origin
        x and y of the first pixel of `grey` in the first picture of the clip [pixels].
    turns
        Whether the alignment also fits a turn and an enlargement. If False, it fits only a shift.
    """
    across, down = (cv2.Scharr(grey, cv2.CV_32F, *way, scale=1 / 32) for way in ((1, 0), (0, 1)))
    # The border of a picture and black bars around it do not move with a drift.
    lit = np.pad((grey > BLACK).astype(np.uint8), 3)
    slope = np.hypot(across, down) * cv2.erode(lit, np.ones((7, 7)))[3:-3, 3:-3]
    y, x = np.nonzero(slope > STEEP)
    y, x = (each[:: len(y) // _ALIGN.pixels + 1] for each in (y, x))
    value, by_x, by_y = (each[y, x].astype(float) for each in (grey, across, down))
    places = np.stack([x, y], axis=1) + np.array(origin, float)
    size = size or grey.shape[1::-1]
    far, deep = turns * ((2 * places + 1 - size) / max(size)).T
    turned = (by_x * far + by_y * deep, by_y * far - by_x * deep)
    design = np.stack([by_x, by_y, *turned], axis=1)
    return Edges(places=places[:, None], value=value, design=design)


def leap_of(before: Image, after: Image) -> Array:
    """Return the drift from picture `before` to picture `after`, (4,), accurate to a few pixels.

    The four numbers are the shift in x and y [pixels], the growth, and the turn. Growth and turn
    are always 0. The pictures are gray and have the same size.
    """
    scale = max(1.0, max(before.shape) / _ALIGN.coarse)
    size = tuple(round(side / scale) for side in before.shape[::-1])
    one, other = (cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in (before, after))
    window = cv2.createHanningWindow(size, cv2.CV_32F)
    (x, y), _ = cv2.phaseCorrelate(one.astype(np.float32), other.astype(np.float32), window)
    return np.array([scale * x, scale * y, 0.0, 0.0])


def upper_median(values: NDArray[Any]) -> NDArray[Any]:
    """Return the upper median along the last axis, which must not be empty."""
    place = values.shape[-1] // 2
    return np.asarray(np.partition(values, place, axis=-1)[..., place])


def matrix_of(drift: Array, size: tuple[int, ...]) -> Array:
    """Return the matrix (2, 3) that maps positions in the still frame to positions in a picture.

    The still frame is the system of coordinates in which the background does not move. A position
    in it is the position in the first picture of the clip.

    Parameters
    ----------
    drift
        Drift of the picture, (4,): shift in x and in y [pixels], relative growth (0 for none), and
        turn about the middle of the picture [rad].
    size
        Number of columns and rows of the picture.
    """
    grown, turn, middle = 1 + drift[2], drift[3], (np.array(size) - 1) / 2
    linear = np.array([[grown, -turn], [turn, grown]])
    return np.column_stack([linear, middle + drift[:2] - linear @ middle])
