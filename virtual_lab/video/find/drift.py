"""How a picture lies upon another one: shifted, larger and turned, by least squares on its edges.

Gauss and Newton on grey values, coarse to fine, with the light's gain and level beside the shift;
what moves on its own is left out by its residual (Lucas and Kanade 1981, robust by Tukey's
biweight). Only the pixels with the steepest edges take part, an equal share of every part of the
picture: a thousand say as much as all.

A drift is an array (4,): right and down [pixels], growth, and turn [rad] from x to y, the last two
about the picture's middle. A hand turns a phone by a degree in a clip, and its lens focuses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

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
    steps: int = 8
    near: float = 1.5  # pixels: a shift found so near to its guess is looked for no farther
    fits: float = 0.5  # pixels that edges may lie off for that, what moves on its own clipped
    fewest: float = 6.0  # pixels that show a shift: of fewer it stays
    black: float = 24.0  # DN: a row or column that has nothing lighter is no picture
    border: int = 4  # pixels of the picture's edge that take no part
    settled: float = 0.003  # pixels
    tukey: float = 4.7  # standard deviations: what is farther off does not count
    least_spread: float = 0.1  # pixels
    least_shown: float = 0.2  # of the edges, that lie in the other picture
    far: float = 0.6  # of the cost near the guess, that a shift far from it has at most
    # of what shows a shift, that keeps growth and turn near where they were, and near none
    near_turn: float = 0.02
    no_turn: float = 0.002
    ridge: float = 1e-3  # of what shows a shift: an edge does not hold one along it


_ALIGN = _Alignment()
FAR_OFF = 2.0  # pixels: what is farther off moves on its own


@dataclass(frozen=True, slots=True, kw_only=True)
class _Level:
    x: Array
    y: Array
    value: Array
    design: Array  # (pixel, 6): gradients by a drift's four, value, 1, as below
    slope: Array  # that pixels are counted by, so that a step of a pixel counts alike [DN/px]
    middle: Array  # (2,) about which a picture grows and turns [pixels]


@dataclass(frozen=True, slots=True, kw_only=True)
class Edges:
    """The steep pixels of a picture, level by level, the coarsest first."""

    levels: Sequence[_Level]

    def steeper(self, slope: float) -> Edges:
        """Edges so steep at full size [DN/px], alone."""
        level = self.levels[-1]
        kept = level.slope > slope
        names = ("x", "y", "value", "design", "slope")
        return Edges(levels=[replace(level, **{n: getattr(level, n)[kept] for n in names})])

    def shift(self, grey: Image, guess: Array, before: Array | None = None) -> Array:
        """Find the drift (4,) of a picture from this one: a shift alone, near a guess.

        `before`: how the picture before does, or those about it, if that is known; so does this one
        where none fits better, and far from there one must fit far better.
        """
        pictures = _pyramid(grey, len(self.levels))[::-1]
        finest = len(self.levels) - 1
        tried = [np.zeros(4), np.array(guess if before is None else before, float)]
        for first in (finest, 0):
            drift = np.array(guess, float)
            for k in range(first, finest + 1):
                scale = np.array([2.0 ** (finest - k)] * 2 + [1.0, 1.0])
                drift = scale * _settle(self.levels[k], pictures[k], drift / scale, 2)
            tried.append(drift)
            near = np.hypot(*(drift - guess)[:2]) < _ALIGN.near
            if near and _cost(self.levels[-1], pictures[-1], drift) < _ALIGN.fits:
                break  # of what moves so little the coarser levels show no more
        costs = np.array([_cost(self.levels[-1], pictures[-1], each) for each in tried])
        far = np.hypot(*(np.array(tried) - tried[1]).T[:2]) > _ALIGN.near
        far[:-1] &= before is not None  # what the finest level finds near a guess is no jump
        costs[far] /= _ALIGN.far
        return tried[int(np.argmin(costs))]

    def turn(self, grey: Image, drift: Array) -> Array:
        """Find the drift (4,) of a picture from this one: shift, growth and turn, near a drift.

        The drift itself where that fits better: what is beside a hand shows little.
        """
        level, picture = self.levels[-1], _pyramid(grey, 1)[0]
        tried = [_settle(level, picture, drift, 4), drift]
        return min(tried, key=lambda each: _cost(level, picture, each))

    def lie_in(self, grey: Image, drift: Array) -> bool:
        """Whether enough of them lie in a drifted picture to show its drift."""
        inside = _inside(self.levels[-1], grey, drift)
        return bool(inside.sum() > _ALIGN.least_shown * inside.size)

    def costs(self, grey: Image, drift: Array, steeper: float) -> Array:
        """Mean distance of edges from where a drift puts them, by part of the picture [pixels].

        Edges steeper than `steeper` [DN/px] count; NaN in a part that has too few.
        """
        level = self.levels[-1]
        inside, off = _off(level, _pyramid(grey, 1)[0], drift)
        used = inside & (level.slope > steeper)
        part = _part(level, grey.shape)[used]
        count, total = (np.bincount(part, w, _ALIGN.parts**2) for w in (None, off[used]))
        return np.where(count >= _ALIGN.part_pixels, total / np.maximum(count, 1), np.nan)

    def parts(self, shape: tuple[int, ...], steeper: float) -> NDArray[np.bool_]:
        """Parts of a picture with edges so steep [DN/px], but for one thing's, (part,).

        What moves on its own is the largest group that reaches over less than half of the picture.
        """
        level, parts = self.levels[-1], _ALIGN.parts
        count = np.bincount(_part(level, shape)[level.slope > steeper], minlength=parts**2)
        shown = (count >= _ALIGN.part_pixels).reshape(parts, parts)
        groups, _ = ndimage.label(shown, np.ones((3, 3)))
        own = [
            groups == k
            for k, box in enumerate(ndimage.find_objects(groups), 1)
            if max(side.stop - side.start for side in box) < parts / 2
        ]
        return np.asarray(shown & ~max(own, key=np.sum, default=~shown & shown)).ravel()


def upper_median(values: NDArray[Any]) -> NDArray[Any]:
    """Upper median along the last axis: without numpy's checks, which cost ten times."""
    place = values.shape[-1] // 2
    return np.asarray(np.partition(values, place, axis=-1)[..., place])


def edges_of(
    grey: Image, origin: tuple[int, int] = (0, 0), size: tuple[int, int] | None = None
) -> Edges:
    """Steep pixels of a picture (row, column).

    Parameters
    ----------
    origin
        x and y of its first pixel.
    size
        Columns and rows of the pictures to lay upon it, if not its own.
    """
    count = 1
    while count < _ALIGN.levels and min(grey.shape) >> count >= _ALIGN.smallest:
        count += 1
    first, middle = np.array(origin), _middle(size or grey.shape[::-1])
    pictures = _pyramid(grey, count)
    levels = [_level(p, first / 2**k, middle / 2**k) for k, p in enumerate(pictures)]
    return Edges(levels=levels[::-1])


def matrix_of(drift: Array, size: tuple[int, int]) -> Array:
    """Matrix (2, 3) that takes places to where they lie in a drifted picture of that size."""
    grown, turn, middle = 1 + drift[2], drift[3], _middle(size)
    linear = np.array([[grown, -turn], [turn, grown]])
    return np.column_stack([linear, middle + drift[:2] - linear @ middle])


def upon(drift: Array, first: Array) -> Array:
    """Drift (4,) of a picture from another one, by the drifts of both."""
    (turn, shift), (first_turn, first_shift) = _turn_and_shift(drift), _turn_and_shift(first)
    left = turn / first_turn
    return _drift(left, shift - left * first_shift)


def onward(drift: Array, step: Array) -> Array:
    """Drift (4,) of a picture that drifts by `step` from one of a drift."""
    (turn, shift), (next_turn, next_shift) = _turn_and_shift(drift), _turn_and_shift(step)
    return _drift(next_turn * turn, next_shift + next_turn * shift)


def _turn_and_shift(drift: Array) -> tuple[complex, complex]:
    """Complex factor of places about the middle, as x + iy, and what is added."""
    return complex(1 + drift[2], drift[3]), complex(drift[0], drift[1])


def _drift(turn: complex, shift: complex) -> Array:
    return np.array([shift.real, shift.imag, turn.real - 1, turn.imag])


def at_rim(size: tuple[int, int]) -> Array:
    """Factors (4,) that make a drift's numbers pixels at the middle of a side."""
    far = float(_middle(size).max())
    return np.array([1.0, 1.0, far, far])


def _middle(size: tuple[int, int]) -> Array:
    return (np.array(size) - 1.0) / 2


def _pyramid(grey: Image, count: int) -> list[NDArray[np.float32]]:
    pictures = [cv2.GaussianBlur(grey, (0, 0), 1.0)]
    for _ in range(count - 1):
        pictures.append(cv2.pyrDown(pictures[-1]))
    return [each.astype(np.float32) for each in pictures]


def _level(picture: NDArray[np.float32], first: Array, middle: Array) -> _Level:
    across = cv2.Scharr(picture, cv2.CV_32F, 1, 0, scale=1 / 32)
    down = cv2.Scharr(picture, cv2.CV_32F, 0, 1, scale=1 / 32)
    # the edge of a picture and black bars about it move with no drift
    rim = np.ones(picture.shape, bool)
    lit, edge = picture > _ALIGN.black, _ALIGN.border
    ends = [np.flatnonzero(lit.any(axis=axis))[[0, -1]] for axis in (1, 0)] if lit.any() else []
    rim[tuple(slice(one + edge, last + 1 - edge) for one, last in ends)] = not ends
    slopes = [np.where(rim, 0, np.abs(each)) for each in (across, down)]
    places = np.unique(np.concatenate([_steepest(each) for each in slopes]), axis=0)
    y, x = places.T
    value = picture[y, x].astype(float)
    by_x, by_y = (each[y, x].astype(float) for each in (across, down))
    slope = np.hypot(by_x, by_y)
    # growth and turn in pixels at the middle of a side, to count like a shift
    far, deep = ((np.stack([x, y], axis=1) + first - middle) / middle.max()).T
    turned = (by_x * far + by_y * deep, by_y * far - by_x * deep)
    design = np.stack([by_x, by_y, *turned, value, np.ones_like(value)], axis=1)
    return _Level(
        x=x + first[0],
        y=y + first[1],
        value=value,
        design=design / slope[:, None],
        slope=slope,
        middle=middle,
    )


def _steepest(slope: NDArray[np.float32]) -> NDArray[np.intp]:
    """Row and column of the steepest pixels of each part of a picture, (pixel, 2)."""
    rows, columns = slope.shape
    share, chosen = _ALIGN.pixels // (2 * _ALIGN.parts**2), []
    for i in range(_ALIGN.parts):
        for j in range(_ALIGN.parts):
            top, left = i * rows // _ALIGN.parts, j * columns // _ALIGN.parts
            part = slope[
                top : (i + 1) * rows // _ALIGN.parts, left : (j + 1) * columns // _ALIGN.parts
            ]
            flat = part.ravel()
            kept = np.flatnonzero(flat > _ALIGN.steepest)
            if kept.size > share:
                kept = kept[np.argpartition(flat[kept], -share)[-share:]]
            y, x = np.divmod(kept, part.shape[1])
            chosen.append((y + top, x + left))
    return np.concatenate(chosen, axis=1).T


def _part(level: _Level, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Part of a picture (row, column) in which each edge lies, numbered row by row."""
    places = np.stack([level.x, level.y])
    # what a drifting camera sees begins left of the first picture, or above it
    places = (places - places.min(axis=1, keepdims=True, initial=0.0)) / [[shape[1]], [shape[0]]]
    x, y = np.clip(_ALIGN.parts * places, 0, _ALIGN.parts - 1).astype(int)
    return np.asarray(x + _ALIGN.parts * y)


def _at(level: _Level, drift: Array) -> tuple[Array, Array]:
    """Places of edges in a drifted picture, x and y [pixels]."""
    right, down, grown, turn = drift
    if not (grown or turn):
        return level.x + right, level.y + down
    x, y = level.x - level.middle[0], level.y - level.middle[1]
    return level.x + right + grown * x - turn * y, level.y + down + grown * y + turn * x


def _inside(level: _Level, picture: Image | NDArray[np.float32], drift: Array) -> NDArray[np.bool_]:
    rows, columns = picture.shape
    x, y = _at(level, drift)
    return np.asarray((x > 0) & (x < columns - 1) & (y > 0) & (y < rows - 1))


def _cost(level: _Level, picture: NDArray[np.float32], drift: Array) -> float:
    """Mean distance of edges from where they should lie, each clipped [pixels]."""
    inside, off = _off(level, picture, drift)
    if inside.sum() <= _ALIGN.least_shown * inside.size:
        return FAR_OFF
    # edges count by their slope: a codec keeps flat ones in place
    return float(np.average(off[inside], weights=level.slope[inside]))


def _off(
    level: _Level, picture: NDArray[np.float32], drift: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Edges that lie in a picture, and the distance of each, clipped [pixels]."""
    inside = _inside(level, picture, drift)
    if not inside.any():
        return inside, np.full(inside.shape, FAR_OFF)
    left = _values_at(level, picture, drift) - level.value
    off = np.abs(left - upper_median(left[inside])) / level.slope
    return inside, np.minimum(off, FAR_OFF)


def _values_at(level: _Level, picture: NDArray[np.float32], drift: Array) -> Array:
    if not level.x.size:
        return np.zeros(0)
    x, y = (each.astype(np.float32) for each in _at(level, drift))
    seen = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen.ravel(), float)


def _settle(level: _Level, picture: NDArray[np.float32], start: Array, free: int) -> Array:
    """Drift of a picture, of which the first `free` parts are, from one near by.

    Growth and turn stay near that, and near none at all, the nearer the less shows them: where all
    edges are in one place they would run off.
    """
    if level.x.size < 4:
        return start
    far = float(level.middle.max())
    units, turns = np.array([1.0, 1.0, far, far])[:free], np.array([0.0, 0.0, 1.0, 1.0])[:free]
    design = level.design[:, [*range(free), 4, 5]]
    drift, gain, offset = start.copy(), 1.0, 0.0
    for _ in range(_ALIGN.steps):
        inside = _inside(level, picture, drift)
        if not inside.any():
            break
        left = (_values_at(level, picture, drift) - gain * level.value - offset) / level.slope
        spread = max(_ALIGN.least_spread, 1.4826 * float(upper_median(np.abs(left[inside]))))
        weight = np.where(
            inside, np.maximum(0, 1 - (left / (_ALIGN.tukey * spread)) ** 2) ** 2, 0.0
        )
        weighted = design * weight[:, None]
        normal = weighted.T @ design
        most = float(np.trace(normal[:2, :2]))
        if most < _ALIGN.fewest:
            break
        near, none = _ALIGN.near_turn * most * turns, _ALIGN.no_turn * most * turns
        normal += np.diag([*(_ALIGN.ridge * most + near + none), 1e-3, 1e-3])
        right = weighted.T @ left
        right[:free] += units * (near * (drift - start)[:free] + none * drift[:free])
        step = np.linalg.solve(normal, right)
        # a picture shifted by s has, at x + s, the value of x
        drift[:free] -= step[:free] / units
        gain, offset = gain + step[-2], offset + step[-1]
        if np.abs(step[:free]).max() < _ALIGN.settled:
            break
    return drift
