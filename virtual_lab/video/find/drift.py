"""Drift of a picture from the still frame: shift, growth and turn, by least squares on its edges.

Gauss and Newton on grey values, with the light's gain and level beside the drift; what moves on
its own is left out by its residual (Lucas and Kanade 1981, robust by Tukey's biweight). Only the
steepest pixels take part, one of each small cell of the picture: a thousand show as much as all. A
step too large for that is found by phase correlation of small pictures.

A drift is an array (4,): right and down [pixels], growth, and turn [rad] from x to y, the last two
about the picture's middle. A hand turns a phone by a degree in a clip, and its lens focuses.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _Alignment:
    """Settings of the alignment of two pictures."""

    cell: int = 5  # size of a cell, whose steepest pixel takes part [pixels along each axis]
    pixels: int = 3000  # largest number of pixels that take part
    steepest: float = 2.0  # smallest steepness of an edge [DN/px]: less is noise
    # number of parts along each axis of the picture: some show a drift, others do not
    parts: int = 12
    # smallest number of steep pixels in a part that has an edge: noise leaves one or two
    part_pixels: int = 3
    steps: int = 8
    # longer side of the small pictures in which a large step is looked for [pixels]
    coarse: int = 128
    fits: float = 1.5  # ratio to the usual cost below which no other start is tried
    # largest ratio of the cost of a drift far from the likely one to the cost of the likely one
    far: float = 0.6
    settled: float = 0.005  # smallest step after which the alignment continues [pixels]
    tukey: float = 4.7  # residual beyond which a pixel does not count [standard deviations]
    least_spread: float = 0.1  # pixels
    least_shown: float = 0.2  # smallest share of the edges that lie in the other picture
    # weight that holds growth and turn near their start [share of a shift's weight]
    near_turn: float = 0.02
    # damping of a step [share of a shift's weight]: an edge does not show a shift along itself
    ridge: float = 1e-3


_ALIGN = _Alignment()
FAR_OFF = 2.0  # distance beyond which an edge moves on its own, or a picture has leapt [pixels]
BLACK = 24  # grey level [DN]: a row or column without a lighter pixel is not part of the picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """The steep pixels of a picture, (pixel,)."""

    x: Array  # position in the still frame, from its middle [pixels]
    y: Array
    part: NDArray[np.intp]  # number of the picture's part, counted row by row
    value: Array  # grey value [DN]
    # (pixel, free + 2): gradients by the free numbers of a drift (2 or 4), value and 1, each
    # divided by `slope`
    design: Array
    # steepness by which residuals are divided, so that a step of one pixel counts alike [DN/px]
    slope: Array
    middle: Array  # (2,) centre about which a picture grows and turns [pixels]

    def drift(self, grey: Image, starts: Iterable[Array], usual: float | None = None) -> Array:
        """Find the drift (4,) of a picture, near the best of several starts.

        `usual` is the cost [pixels] of aligned pictures. It is given if the first start is likely:
        others are then tried only if its cost is clearly higher, and must fit far better.
        """
        tried, costs = list[Array](), list[float]()
        for start in starts:
            for drift in (start, self._settle(grey, start)):
                cost = self.cost(grey, drift)
                leaps = bool(tried) and np.hypot(*(drift - tried[0])[:2]) > FAR_OFF
                tried.append(drift)
                costs.append(cost / _ALIGN.far if usual is not None and leaps else cost)
            if usual is not None and cost < _ALIGN.fits * usual:
                break
        return tried[int(np.argmin(costs))]

    def cost(self, grey: Image, drift: Array) -> float:
        """Mean distance of edges from where a drift puts them, each clipped [pixels]."""
        left = self._left(grey, drift)
        shown = np.isfinite(left)
        if shown.sum() <= _ALIGN.least_shown * shown.size:
            return FAR_OFF
        off = np.minimum(np.abs(left - upper_median(left[shown])) / self.slope, FAR_OFF)
        # edges are weighted by their slope, because a codec keeps flat ones in place
        return float(np.average(off[shown], weights=self.slope[shown]))

    def costs(self, grey: Image, drift: Array, steeper: float) -> Array:
        """Mean clipped distance of the edges in each part of the picture [pixels], (part,).

        Edges steeper than `steeper` [DN/px] are used; a part with too few of them has inf. The
        light's level is not fitted here: if all edges are on one line, nothing else shows a motion.
        """
        left = self._left(grey, drift)
        used = np.isfinite(left) & (self.slope > steeper)
        off = np.minimum(np.abs(left) / self.slope, FAR_OFF)[used]
        count, total = (np.bincount(self.part[used], w, _ALIGN.parts**2) for w in (None, off))
        return np.where(count >= _ALIGN.part_pixels, total / np.maximum(count, 1), np.inf)

    def share_in(self, grey: Image, drift: Array) -> float:
        """Share of the edges that are inside a drifted picture."""
        return float(np.isfinite(self._left(grey, drift)).mean())

    def parts(self, steeper: float) -> Mask:
        """Mask of the picture's parts with edges steeper than `steeper` [DN/px], (part,).

        One thing may move on its own, so the largest group of parts that spans less than half of
        the picture is left out.
        """
        count = np.bincount(self.part[self.slope > steeper], minlength=_ALIGN.parts**2)
        shown = (count >= _ALIGN.part_pixels).reshape(_ALIGN.parts, -1)
        _, groups, stats, _ = cv2.connectedComponentsWithStats(shown.astype(np.uint8))
        reach = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
        area = np.where(reach < _ALIGN.parts / 2, stats[:, cv2.CC_STAT_AREA], 0)
        area[0] = 0
        return np.asarray(shown & ((groups != area.argmax()) | (area.max() == 0))).ravel()

    def _left(self, grey: Image, drift: Array, gain: float = 1.0, level: float = 0.0) -> Array:
        """Brightness at the edges in a drifted picture minus their own [DN]; NaN: outside it."""
        right, down, grown, turn = drift
        x = self.middle[0] + right + (1 + grown) * self.x - turn * self.y
        y = self.middle[1] + down + (1 + grown) * self.y + turn * self.x
        if not x.size:
            return np.zeros(0)
        rows, columns = grey.shape
        inside = (x > 0) & (x < columns - 1) & (y > 0) & (y < rows - 1)
        seen = cv2.remap(grey, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        return np.where(inside, seen.ravel() - gain * self.value - level, np.nan)

    def _settle(self, grey: Image, start: Array) -> Array:
        """Refine the drift of a picture from a start that is near it.

        Growth and turn are held near their start, the more so the less the edges show them: if all
        edges are in one place, they would diverge.
        """
        free = self.design.shape[1] - 2
        units, turns = at_rim(2 * self.middle + 1)[:free], np.array([0.0, 0.0, 1.0, 1.0])[:free]
        drift, gain, level = start.copy(), 1.0, 0.0
        for _ in range(_ALIGN.steps):
            left = self._left(grey, drift, gain, level) / self.slope
            shown = np.isfinite(left)
            if not shown.any():
                break
            spread = _ALIGN.least_spread + 1.4826 * float(upper_median(np.abs(left[shown])))
            left = np.nan_to_num(left)
            weight = shown * np.maximum(0, 1 - (left / (_ALIGN.tukey * spread)) ** 2) ** 2
            weighted = self.design * weight[:, None]
            normal = weighted.T @ self.design
            most = float(np.trace(normal[:2, :2]))
            near = _ALIGN.near_turn * most * turns
            normal += np.diag([*(_ALIGN.ridge * most + near), 0.0, 0.0]) + 1e-3 * np.eye(free + 2)
            right = weighted.T @ left
            right[:free] += units * near * (drift - start)[:free]
            step = np.linalg.solve(normal, right)
            # a picture shifted by s has, at x + s, the value of x
            drift[:free] -= step[:free] / units
            gain, level = gain + step[free], level + step[free + 1]
            if np.abs(step[:free]).max() < _ALIGN.settled:
                break
        return drift


def edges_of(
    grey: Image,
    drift: Array | None = None,
    origin: tuple[int, int] = (0, 0),
    size: tuple[int, int] | None = None,
    turns: bool = False,
) -> Edges:
    """Steep pixels of a picture (row, column).

    Parameters
    ----------
    drift
        Drift of the picture from the still frame, (4,); none by default.
    origin
        x and y of its first pixel.
    size
        Columns and rows of the pictures to align with it, if different from its own.
    turns
        Whether those pictures may also turn and grow.
    """
    # the border of a picture and black bars around it do not move with a drift
    left, top, wide, high = cv2.boundingRect((grey > BLACK).astype(np.uint8))
    inner = np.zeros(grey.shape, np.float32)
    edge = 3  # width of the border that blur and slope affect [pixels]
    inner[top + edge : max(0, top + high - edge), left + edge : max(0, left + wide - edge)] = 1.0
    across, down = (cv2.Scharr(grey, cv2.CV_32F, *way, scale=1 / 32) for way in ((1, 0), (0, 1)))
    steepest = np.zeros(grey.shape, bool)
    for each in (across, down):
        slope = np.abs(each) * inner
        near = cv2.dilate(slope, np.ones((_ALIGN.cell, _ALIGN.cell)))
        steepest |= (slope == near) & (slope > _ALIGN.steepest)
    places = np.argwhere(steepest)
    spread = np.linspace(0, len(places) - 1, min(len(places), _ALIGN.pixels)).astype(int)
    y, x = places[spread].T
    value, by_x, by_y = (each[y, x].astype(float) for each in (grey, across, down))
    slope = np.hypot(by_x, by_y)
    middle = _middle(size or grey.shape[::-1])
    # growth and turn in pixels at the middle of a side, to count like a shift
    far, deep = ((np.stack([x, y], axis=1) + np.array(origin) - middle) / middle.max()).T
    turned = (by_x * far + by_y * deep, by_y * far - by_x * deep)
    free = (by_x, by_y, *turned) if turns else (by_x, by_y)
    design = np.stack([*free, value, np.ones_like(value)], axis=1)
    rows, columns = (_ALIGN.parts * k // n for k, n in zip((y, x), grey.shape, strict=True))
    still = middle.max() * (far + 1j * deep)
    if drift is not None:
        still = (still - complex(*drift[:2])) / complex(1 + drift[2], drift[3])
    return Edges(
        x=still.real,
        y=still.imag,
        part=np.asarray(columns + _ALIGN.parts * rows),
        value=value,
        design=design / slope[:, None],
        slope=slope,
        middle=middle,
    )


def leap_of(before: Image, after: Image) -> Array:
    """Drift (4,) from one picture to the next, a shift to a few pixels: by phase correlation."""
    scale = max(1.0, max(before.shape) / _ALIGN.coarse)
    size = tuple(round(side / scale) for side in before.shape[::-1])
    one, other = (
        cv2.resize(each, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        for each in (before, after)
    )
    (x, y), _ = cv2.phaseCorrelate(one, other, cv2.createHanningWindow(size, cv2.CV_32F))
    return np.array([scale * x, scale * y, 0.0, 0.0])


def upper_median(values: NDArray[Any]) -> NDArray[Any]:
    """Upper median along the last axis: without numpy's checks, which cost ten times."""
    place = values.shape[-1] // 2
    return np.asarray(np.partition(values, place, axis=-1)[..., place])


def matrix_of(drift: Array, size: tuple[int, int]) -> Array:
    """Matrix (2, 3) that takes places to where they lie in a drifted picture of that size."""
    grown, turn, middle = 1 + drift[2], drift[3], _middle(size)
    linear = np.array([[grown, -turn], [turn, grown]])
    return np.column_stack([linear, middle + drift[:2] - linear @ middle])


def at_rim(size: Any) -> Array:
    """Factors (4,) that convert a drift to pixels at the middle of a side."""
    far = float(_middle(size).max())
    return np.array([1.0, 1.0, far, far])


def _middle(size: Any) -> Array:
    return (np.array(size) - 1.0) / 2
