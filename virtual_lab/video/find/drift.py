"""How far a picture lies from another one: translation by least squares on what has an edge.

Gauss and Newton on grey values, coarse to fine, with the light's gain and level beside the shift;
what moves on its own is left out by its residual (Lucas and Kanade 1981, robust by Tukey's
biweight). Only the pixels with the steepest edges take part, an equal share of every part of the
picture: a thousand say as much as all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from virtual_lab.units import Array

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _Alignment:
    """How two pictures are laid upon one another."""

    levels: int = 4  # of the pyramid: each half as large
    smallest: int = 24  # pixels of its top
    parts: int = 12  # of the picture, each way, that take part alike
    part_pixels: int = 8  # steep ones of a part that has an edge: noise leaves one or two
    pixels: int = 3000
    steepest: float = 2.0  # DN a pixel: less is noise
    steps: int = 12
    near: float = 1.5  # pixels: a shift found so near to its guess is looked for no farther
    fits: float = 0.5  # pixels that edges may lie off for that, what moves on its own clipped
    fewest: float = 6.0  # pixels that show a shift: of fewer it stays
    black: float = 24.0  # DN: a row or column that has nothing lighter is no picture
    border: int = 4  # pixels of the picture's edge that take no part
    settled: float = 0.003  # pixels
    tukey: float = 4.7  # standard deviations: what is farther off does not count
    least_spread: float = 0.1  # pixels
    clipped: float = 2.0  # pixels: what is farther off moves on its own
    least_shown: float = 0.2  # of the edges, that lie in the other picture
    stand: float = 0.98  # of its cost: a camera on a stand is the simpler explanation
    far: float = 0.7  # of the cost near the guess, that a shift far from it has at most
    ridge: float = 1e-3  # of what shows a shift: an edge does not hold one along it


_ALIGN = _Alignment()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Level:
    x: Array
    y: Array
    value: Array
    design: Array  # (pixel, 4): gradients, value, 1, as below
    slope: Array  # that pixels are counted by, so that a step of a pixel counts alike [DN/px]


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """The steep pixels of a picture, level by level, the coarsest first."""

    levels: Sequence[_Level]

    def spans(self, shape: tuple[int, ...], steeper: float, *, own: bool) -> Array:
        """Return over how much of each side those reach that are so steep [DN/px], (2,).

        `own`: so steep along that side. A man who walks through the picture has upright edges, but
        not over its whole width.
        """
        level, sides, found = self.levels[-1], np.array(shape[1::-1], dtype=float), np.zeros(2)
        for axis in (0, 1):
            slope = level.slope * (np.abs(level.design[:, axis]) if own else 1.0)
            places = np.stack([level.x, level.y])[:, slope > steeper]
            places -= places.min(axis=1, keepdims=True, initial=np.inf)
            part = (places / sides[:, None] * _ALIGN.parts).astype(int)
            each, count = np.unique(part, axis=1, return_counts=True)
            shown = each[axis, count >= _ALIGN.part_pixels]
            found[axis] = (np.ptp(shown) + 1) / _ALIGN.parts if shown.size else 0.0
        return found

    def shift(self, grey: Image, guess: Array, before: Array | None = None) -> Array:
        """Return how far a picture lies from this one, (2,) [pixels], found from near a guess.

        `before`: of the picture before, if it is known, which is also that of this one where none
        fits better; far from it one must fit far better.
        """
        pictures = _pyramid(grey, len(self.levels))[::-1]
        finest = len(self.levels) - 1
        tried = [np.zeros(2), np.array(guess if before is None else before, float)]
        for first in (finest, 0):
            shift = np.array(guess, float)
            for k in range(first, finest + 1):
                scale = 2.0 ** (finest - k)
                shift = scale * _settled(self.levels[k], pictures[k], shift / scale)
            tried.append(shift)
            near = np.hypot(*(shift - guess)) < _ALIGN.near
            if near and _cost(self.levels[-1], pictures[-1], shift) < _ALIGN.fits:
                break  # of what moves so little the coarser levels show no more
        costs = np.array([_cost(self.levels[-1], pictures[-1], each) for each in tried])
        costs[0] *= _ALIGN.stand
        far = np.hypot(*(np.array(tried) - tried[1]).T) > _ALIGN.near
        far[:-1] &= before is not None  # what the finest level finds near a guess is no jump
        costs[far] /= _ALIGN.far
        return tried[int(np.argmin(costs))]

    def cost(self, grey: Image, shift: Array) -> float:
        """Return how far they lie from where a shift puts them in a picture, a mean [pixels].

        What moves on its own is clipped.
        """
        return _cost(self.levels[-1], _pyramid(grey, 1)[0], shift)

    def costs(self, grey: Image, shift: Array, steeper: float) -> Array:
        """Return the same of each part of the picture with edges so steep [DN/px], else NaN."""
        level = self.levels[-1]
        inside, off = _off(level, _pyramid(grey, 1)[0], shift)
        used = inside & (level.slope > steeper)
        part = _part(level, grey.shape)[used]
        count, total = (np.bincount(part, w, _ALIGN.parts**2) for w in (None, off[used]))
        return np.where(count >= _ALIGN.part_pixels, total / np.maximum(count, 1), np.nan)

    def parts(self, shape: tuple[int, ...], steeper: float) -> int:
        """Return how many parts of a picture have edges so steep [DN/px], but for one thing's.

        What moves on its own is the largest group that reaches over less than half of the picture.
        """
        level, parts = self.levels[-1], _ALIGN.parts
        count = np.bincount(_part(level, shape)[level.slope > steeper], minlength=parts**2)
        shown = (count >= _ALIGN.part_pixels).reshape(parts, parts)
        groups, _ = ndimage.label(shown, np.ones((3, 3)))
        own = [
            int((groups[box] == k).sum())
            for k, box in enumerate(ndimage.find_objects(groups), 1)
            if max(side.stop - side.start for side in box) < parts / 2
        ]
        return int(shown.sum()) - max(own, default=0)


def upper_median(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the upper median along the last axis: without numpy's checks, which cost ten times."""
    place = values.shape[-1] // 2
    return np.asarray(np.partition(values, place, axis=-1)[..., place])


def edges_of(grey: Image, origin: Array | None = None) -> Edges:
    """Return the steep pixels of a picture (row, column); `origin`: x, y of its first pixel."""
    count = 1
    while count < _ALIGN.levels and min(grey.shape) >> count >= _ALIGN.smallest:
        count += 1
    first = np.zeros(2) if origin is None else origin
    levels = [_level(p, first / 2**k) for k, p in enumerate(_pyramid(grey, count))]
    return Edges(levels=levels[::-1])


def _pyramid(grey: Image, count: int) -> list[NDArray[np.float32]]:
    pictures = [cv2.GaussianBlur(grey, (0, 0), 1.0)]
    for _ in range(count - 1):
        pictures.append(cv2.pyrDown(pictures[-1]))
    return [each.astype(np.float32) for each in pictures]


def _level(picture: NDArray[np.float32], first: Array) -> _Level:
    across = cv2.Scharr(picture, cv2.CV_32F, 1, 0, scale=1 / 32)
    down = cv2.Scharr(picture, cv2.CV_32F, 0, 1, scale=1 / 32)
    rim = _rim(picture)
    slopes = [np.where(rim, 0, np.abs(each)) for each in (across, down)]
    places = np.unique(np.concatenate([_steepest(each) for each in slopes]), axis=0)
    y, x = places.T
    value = picture[y, x].astype(float)
    slope = np.hypot(across[y, x], down[y, x]).astype(float)
    design = np.stack([across[y, x], down[y, x], value, np.ones_like(value)], axis=1)
    return _Level(
        x=x + first[0],
        y=y + first[1],
        value=value,
        design=design / slope[:, None],
        slope=slope,
    )


def _rim(picture: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the edge of a picture and the black bars about it, which no drift moves."""
    rim = np.ones(picture.shape, bool)
    lines, files = (np.flatnonzero(picture.max(axis=a) > _ALIGN.black) for a in (1, 0))
    if lines.size and files.size:
        rim[
            lines[0] + _ALIGN.border : lines[-1] + 1 - _ALIGN.border,
            files[0] + _ALIGN.border : files[-1] + 1 - _ALIGN.border,
        ] = False
    return rim


def _steepest(slope: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return row and column of the steepest pixels of each part of a picture, (pixel, 2)."""
    rows, columns = slope.shape
    share, chosen = _ALIGN.pixels // (2 * _ALIGN.parts**2), []
    for i in range(_ALIGN.parts):
        for j in range(_ALIGN.parts):
            top, left = i * rows // _ALIGN.parts, j * columns // _ALIGN.parts
            part = slope[
                top : (i + 1) * rows // _ALIGN.parts, left : (j + 1) * columns // _ALIGN.parts
            ]
            flat = part.ravel()
            kept = np.argpartition(-flat, min(share, flat.size - 1))[:share]
            y, x = np.unravel_index(kept[flat[kept] > _ALIGN.steepest], part.shape)
            chosen.append((y + top, x + left))
    return np.concatenate(chosen, axis=1).T


def _part(level: _Level, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Return in which part of a picture (row, column) edges lie, numbered row by row."""
    places = np.stack([level.x, level.y])
    # what a drifting camera sees begins left of the first picture, or above it
    places = (places - places.min(axis=1, keepdims=True, initial=0.0)) / [[shape[1]], [shape[0]]]
    x, y = np.clip(_ALIGN.parts * places, 0, _ALIGN.parts - 1).astype(int)
    return np.asarray(x + _ALIGN.parts * y)


def _inside(level: _Level, picture: NDArray[np.float32], shift: Array) -> NDArray[np.bool_]:
    rows, columns = picture.shape
    x, y = level.x + shift[0], level.y + shift[1]
    return np.asarray((x > 0) & (x < columns - 1) & (y > 0) & (y < rows - 1))


def _cost(level: _Level, picture: NDArray[np.float32], shift: Array) -> float:
    """Return how far edges lie from where they should, what moves on its own clipped [pixels]."""
    inside, off = _off(level, picture, shift)
    if inside.sum() <= _ALIGN.least_shown * inside.size:
        return _ALIGN.clipped
    # edges count by their slope: a codec keeps flat ones in place
    return float(np.average(off[inside], weights=level.slope[inside]))


def _off(
    level: _Level, picture: NDArray[np.float32], shift: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Return which edges lie in a picture, and how far each is off there, clipped [pixels]."""
    inside = _inside(level, picture, shift)
    if not inside.any():
        return inside, np.full(inside.shape, _ALIGN.clipped)
    left = _seen(level, picture, shift) - level.value
    off = np.abs(left - upper_median(left[inside])) / level.slope
    return inside, np.minimum(off, _ALIGN.clipped)


def _seen(level: _Level, picture: NDArray[np.float32], shift: Array) -> Array:
    if not level.x.size:
        return np.zeros(0)
    x, y = ((p + s).astype(np.float32) for p, s in zip((level.x, level.y), shift, strict=True))
    seen = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen.ravel(), float)


def _settled(level: _Level, picture: NDArray[np.float32], shift: Array) -> Array:
    if level.x.size < 4:
        return shift
    gain, offset = 1.0, 0.0
    for _ in range(_ALIGN.steps):
        inside = _inside(level, picture, shift)
        if not inside.any():
            break
        left = (_seen(level, picture, shift) - gain * level.value - offset) / level.slope
        spread = max(_ALIGN.least_spread, 1.4826 * float(upper_median(np.abs(left[inside]))))
        weight = np.where(
            inside, np.maximum(0, 1 - (left / (_ALIGN.tukey * spread)) ** 2) ** 2, 0.0
        )
        weighted = level.design * weight[:, None]
        normal = weighted.T @ level.design
        most = float(np.trace(normal[:2, :2]))
        if most < _ALIGN.fewest:
            break
        normal[[0, 1], [0, 1]] += _ALIGN.ridge * most
        normal[[2, 3], [2, 3]] += 1e-3
        step = np.linalg.solve(normal, weighted.T @ left)
        # a picture shifted by s has, at x + s, the value of x
        shift = shift - step[:2]
        gain, offset = gain + step[2], offset + step[3]
        if np.hypot(*step[:2]) < _ALIGN.settled:
            break
    return shift
