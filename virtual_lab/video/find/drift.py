"""Drift of a picture from the still frame: shift, growth and turn, by least squares on its edges.

Gauss and Newton on grey values (Lucas and Kanade 1981), robust by Tukey's biweight: pixels that
move on their own are left out by their residual. Steep edges count most, because a codec keeps flat
ones in place. A step too large for that is found by phase correlation of small pictures.

A drift is an array (4,): right and down [pixels], growth, and turn [rad] from x to y, the last two
about the picture's middle. A hand turns a phone by a degree in a clip, and its lens focuses.
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
    settled: float = 0.01  # largest step after which the alignment is done [pixels]
    tukey: float = 4.7  # residual beyond which a pixel does not count [standard deviations]
    # weights that hold shift, growth and turn near their start [shares of a shift's weight]: edges
    # do not show a shift along themselves, and those of a small thing neither growth nor turn
    hold: tuple[float, ...] = (0.01, 0.01, 0.2, 0.05)
    # longer side of the small pictures in which a large step is looked for [pixels]
    coarse: int = 128
    # largest ratio of the cost of a drift far from the likely one to the cost of the likely one
    far: float = 0.6


_ALIGN = _Alignment()
STEEP = 2.0  # smallest steepness of an edge [DN/px]: less is noise
FAR_OFF = 2.0  # distance beyond which an edge moves on its own, or a picture has leapt [pixels]
BLACK = 12  # grey level [DN] of a pixel that is not part of the picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """The steep pixels of a picture, (pixel,)."""

    places: Array  # (pixel, 1, 2) x and y in the still frame [pixels]
    value: Array  # grey value [DN]
    # (pixel, 4) change of the grey value by a drift, growth and turn in pixels at the middle of the
    # longer side [DN/px]
    design: Array

    def drift(self, grey: Image, *starts: Array) -> Array:
        """Return the drift (4,) near the first start, or near another one that fits far better.

        It is the first start itself if no other drift fits better.
        """
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
        """Sum of the clipped residuals of a drift [DN]; an edge outside counts as far off."""
        clip = FAR_OFF * np.hypot(*self.design[:, :2].T)
        return float(np.fmin(np.abs(self._left(grey, drift)), clip).sum())

    def _left(self, grey: Image, drift: Array) -> Array:
        """Return grey values of a drifted picture at the edges minus their own [DN], or NaN."""
        at = cv2.transform(self.places, matrix_of(drift, grey.shape[1::-1])).astype(np.float32)
        real, (x, y) = grey.astype(np.float32), cv2.split(at)
        view = cv2.remap(real, x, y, cv2.INTER_LINEAR, borderValue=np.nan).ravel()
        visible = view > 0
        light = upper_median(self.value[visible] / view[visible]) if visible.any() else 1.0
        return np.where(visible, light * view - self.value, np.nan)

    def _settle(self, grey: Image, start: Array) -> Array:
        """Refine the drift of a picture from a start that is near it."""
        drift, side = start, max(grey.shape) / 2
        units = np.array([1.0, 1.0, side, side])
        for _ in range(_ALIGN.steps):
            left = self._left(grey, drift)
            finite = np.isfinite(left)
            left, design = left[finite], self.design[finite]
            if not left.size:
                break
            spread = 1.0 + 1.4826 * upper_median(np.abs(left))
            weight = np.maximum(0, 1 - (left / (_ALIGN.tukey * spread)) ** 2) ** 2
            normal = design.T @ (weight[:, None] * design)
            hold = (np.trace(normal[:2, :2]) + 1e-3) * np.array(_ALIGN.hold)
            # a picture shifted by s has, at x + s, the value of x
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
    """Return the steep pixels of a picture (row, column) in the still frame.

    Parameters
    ----------
    size
        Columns and rows of the pictures to align with it, if different from its own.
    origin
        x and y of its first pixel.
    turns
        Whether those pictures may also turn and grow.
    """
    across, down = (cv2.Scharr(grey, cv2.CV_32F, *way, scale=1 / 32) for way in ((1, 0), (0, 1)))
    # the border of a picture and black bars around it do not move with a drift
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
    """Return the drift (4,) between two pictures by phase correlation: a shift, to a few pixels."""
    scale = max(1.0, max(before.shape) / _ALIGN.coarse)
    size = tuple(round(side / scale) for side in before.shape[::-1])
    one, other = (
        cv2.resize(each, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        for each in (before, after)
    )
    (x, y), _ = cv2.phaseCorrelate(one, other, cv2.createHanningWindow(size, cv2.CV_32F))
    return np.array([scale * x, scale * y, 0.0, 0.0])


def upper_median(values: NDArray[Any]) -> NDArray[Any]:
    """Return the upper median along the last axis, which must not be empty.

    `numpy.median` would take ten times as long, because of its checks.
    """
    place = values.shape[-1] // 2
    return np.asarray(np.partition(values, place, axis=-1)[..., place])


def matrix_of(drift: Array, size: tuple[int, ...]) -> Array:
    """Return the matrix (2, 3) from positions to those in a drifted picture of this size."""
    grown, turn, middle = 1 + drift[2], drift[3], (np.array(size) - 1) / 2
    linear = np.array([[grown, -turn], [turn, grown]])
    return np.column_stack([linear, middle + drift[:2] - linear @ middle])
