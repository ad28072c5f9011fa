"""Blobs that may be a ball, found by thresholds, convex hull and a ring of background.

At a low threshold a shadow or a mirror image is connected to the ball; at half of the ball's
contrast it is separated. A hand that holds the ball covers part of the ring around it, which must
be background.

A ball lit from above may be brighter than the wall on its upper side and darker on its lower side.
The two sides are different blobs, because half a ball is not where the ball is: flights of
different sides would be apart by most of a radius. The lit side is preferred.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask
from virtual_lab.video.find.drift import Image, matrix_of, upper_median
from virtual_lab.video.find.still import Still, area_mean, difference_of

Blobs = NDArray[np.void]
BlobRow = tuple[Any, ...]  # fields of `BLOB`
Hull = tuple[float, float, float, float]  # x, y, shorter and longer half axis [pixels]

# largest share of the ring that is not background; more means a hand, or a ball on an object
CLEAN = 0.35
COARSE = 48  # size of a blob [pixels]; a blob at least twice as large is shrunk first
BLOB = np.dtype(
    [
        ("frame", np.int32),
        ("x", float),  # still frame [pixels]
        ("y", float),
        ("radius", float),  # half the shorter axis of the hull
        ("length", float),  # half the longer axis
        # width of the edge, by blur and shade: decrease of the radius from a low to a high level
        ("edge", float),
        ("contrast", float),  # DN
        ("dirty", float),  # share of the ring that is not background
        ("cut", bool),  # touches the picture's edge
        ("picture_x", float),  # position in the frame itself
        ("picture_y", float),
        ("colour", float, (3,)),
        ("lit", bool),  # brighter than the background
        ("shaded", bool),  # darker side of a ball whose lit side is another blob
    ]
)


def free(blobs: Blobs) -> Mask:
    """Return a mask of the free blobs, (blob,).

    A blob is a region of a frame that differs from the background. A free blob touches no other
    object and no edge of the picture.
    """
    return np.asarray((blobs["dirty"] < CLEAN) & ~blobs["cut"])


@dataclass(frozen=True, kw_only=True)
class _Search:
    """Thresholds for a blob that may be a ball; differences from the background in DN of 8 bits."""

    thresholds: tuple[int, ...] = (10, 40)
    faint: float = 5.0
    softened: float = 0.7  # standard deviation of the smoothing, for blocks of a codec [pixels]
    # smallest area of a blob [pixels of the searched picture], that of a radius of two pixels
    least_area: float = 12.0
    largest: float = 0.12  # largest area of a blob [share of the picture]
    regions: int = 24  # largest number of regions examined per frame and threshold
    solid: float = 0.75  # smallest share of its hull's area that a blob fills
    # smallest ratio of a blob's shorter axis to its longer one: motion blur of almost five balls
    thinnest: float = 0.22
    # smallest share of a blob's area that its lit side covers, if this side is used alone
    lit_share: float = 0.25
    brightness: float = 70  # percentile of a blob's difference that is used as its contrast
    # largest ratio of the longer axes of a hull at a low level and at half of the contrast; a
    # shadow, or a block of a codec, makes the first one longer
    joined: float = 1.2
    # level above which a pixel of the ring is not background [share of the contrast]
    ring_level: float = 0.35
    # levels between which the width of an edge is measured [share of the contrast]
    edge_levels: tuple[float, float] = (0.3, 0.7)
    fine: float = 16.0  # smallest radius of a blob whose outline is not enlarged [pixels]


_SEARCH = _Search()


def blobs(number: int, picture: Image, small: Image, drift: Array, still: Still) -> Blobs:
    """Return the blobs of a picture that may be a ball, (blob,).

    A blob is a region that differs from the background. It is a record of the type `BLOB`.

    A blob has two positions, in pixels to the right and down from the middle of the upper left
    pixel:

    * `picture_x` and `picture_y` are its position in `picture`.
    * `x` and `y` are its position after the drift of the camera is removed. They agree with the
      first frame of the clip.

    Parameters
    ----------
    number
        Number of the frame.
    picture, small
        The picture in full size, and reduced by `Still.shrunk` for the search.
    drift
        Drift of the picture from the still frame, (4,): shift in x and y [pixels], growth, and turn
        [rad].
    still
        The still frame. It has the background without moving objects, seen as in the first frame.
    """
    off, light = still.difference(small, drift)
    rows: list[BlobRow] = []
    for box in _boxes(off, still.shrink):
        if any(_inside(box, each, still.origin) for each in rows):
            continue
        row = _blob(number, picture, drift, light, still, box)
        if row is None:
            continue
        rivals = [each for each in rows if _same(row, each)]
        if all(_doubt(row) < _doubt(each) for each in rivals):
            rows = [*(each for each in rows if not _same(row, each)), row]
    found = np.array(rows, BLOB)
    apart = np.hypot(*(np.subtract.outer(found[axis], found[axis]) for axis in "xy"))
    near = apart < (1.25 * found["length"] + 1.5)[:, None]
    found["shaded"] = ~found["lit"] & (near & found["lit"]).any(axis=1)
    return found


def _inside(box: tuple[int, int, int, int], blob: BlobRow, origin: tuple[int, int]) -> bool:
    """Return whether a box is inside an isolated blob."""
    _, x, y, _, long, _, _, dirty, *_ = blob
    left, top, wide, high = box[0] + origin[0], box[1] + origin[1], *box[2:]
    away = float(np.hypot(left + wide / 2 - x, top + high / 2 - y))
    return bool(dirty < 0.1 and away + max(wide, high) / 2 < 1.4 * long)


def _same(one: BlobRow, other: BlobRow) -> bool:
    away = np.hypot(one[1] - other[1], one[2] - other[2])
    return bool(away < 0.6 * max(one[3], other[3]) and 0.5 < one[3] / other[3] < 2.0)


def _doubt(blob: BlobRow) -> tuple[bool, float]:
    """Return a rank by which the smaller of two blobs in one place is more likely to be a ball."""
    return blob[7] > _SEARCH.ring_level, blob[5] / blob[3]


def _boxes(off: Image, shrink: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield left, top, width and height [full pixels] of differing regions, for each threshold."""
    for threshold in _SEARCH.thresholds:
        mask = cv2.threshold(off, threshold, 1, cv2.THRESH_BINARY)[1]
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        # number of pixels on and in each outline, by Pick's theorem
        areas = [cv2.contourArea(each) + len(each) / 2 + 1 for each in outlines]
        for k in np.argsort(areas, kind="stable")[::-1][: _SEARCH.regions]:
            if _SEARCH.least_area <= areas[k] <= _SEARCH.largest * off.size:
                left, top, wide, high = cv2.boundingRect(outlines[k])
                yield shrink * left, shrink * top, shrink * wide, shrink * high


def _blob(
    number: int,
    picture: Image,
    drift: Array,
    light: Array,
    still: Still,
    box: tuple[int, int, int, int],
) -> BlobRow | None:
    """Return the row of `BLOB` for the content of a box; None if it is no ball."""
    left, top, wide, high = box
    rows, columns = still.background.shape[:2]
    room = max(6, round(0.6 * max(wide, high)))
    x0, y0 = max(0, left - room), max(0, top - room)
    size = (min(columns, left + wide + room) - x0, min(rows, top + high + room) - y0)
    part, behind = still.cut(picture, drift, light, (x0, y0), size)
    corner = np.array([x0, y0]) + still.origin
    fine = max(1, max(wide, high) // COARSE)
    if fine > 1:  # a lower resolution is enough to locate a large ball to tenths of a pixel
        smaller = (max(1, size[0] // fine), max(1, size[1] // fine))
        cutting = np.s_[: smaller[1] * fine, : smaller[0] * fine]
        part, behind = (area_mean(each[cutting], smaller) for each in (part, behind))
    # A lit side is brighter than the wall in at least two of three colors.
    brighter = upper_median(cv2.subtract(part, behind).reshape(*part.shape[:2], -1))
    plain = brighter, difference_of(part, behind)
    lit, whole = (
        np.asarray(cv2.GaussianBlur(each.astype(np.float32), (0, 0), _SEARCH.softened), np.float32)
        for each in plain
    )
    x1, y1 = left - x0, top - y0
    inner = np.s_[y1 // fine : (y1 + high) // fine, x1 // fine : (x1 + wide) // fine]
    # The larger one of the two sides would change from frame to frame.
    lit_area, area = ((each[inner] > 2 * _SEARCH.faint).sum() for each in (lit, whole))
    off = lit if lit_area > _SEARCH.lit_share * area else whole
    bright = off[inner][off[inner] > _SEARCH.faint]
    if bright.size < _SEARCH.least_area:
        return None
    place = int(_SEARCH.brightness / 100 * (bright.size - 1))
    contrast = float(np.partition(bright, place)[place])
    hull = _hull(off, 0.5 * contrast) if contrast >= 2 * _SEARCH.faint else None
    if hull is None:
        return None
    x, y, short, long = hull
    is_lit = bool(lit[round(y), round(x)] > whole[round(y), round(x)] / 2)
    ring = _disc(off.shape, x, y, 1.5 * long + 3) & ~_disc(off.shape, x, y, 1.25 * long + 1.5)
    inside = part[_disc(off.shape, x, y, 0.6 * short)].reshape(-1, 1 if part.ndim == 2 else 3)
    colour = upper_median(inside.T)
    dirty = float((whole[ring] > _SEARCH.ring_level * contrast).mean()) if ring.any() else 1.0
    near = off[_disc(off.shape, x, y, 1.25 * long + 1.5)]
    low, upper = (level * contrast for level in _SEARCH.edge_levels)
    outer, inward = (np.sqrt(float((near > each).sum()) / np.pi) for each in (low, upper))
    lower = _hull(off, low)
    if lower and lower[3] < _SEARCH.joined * long:
        x, y, *_ = lower
    at = [fine * (p + 0.5) - 0.5 + first for p, first in zip((x, y), corner, strict=True)]
    short, long, edge = (fine * p for p in (short, long, outer - inward))
    there = (matrix_of(drift, still.size) @ [*at, 1.0]).tolist()
    reach = long + 1
    cut = any(not reach <= p <= side - 1 - reach for p, side in zip(there, still.size, strict=True))
    colours = np.broadcast_to(colour, 3)
    return number, *at, short, long, edge, contrast, dirty, cut, *there, colours, is_lit, False


def _disc(shape: tuple[int, ...], x: float, y: float, radius: float) -> NDArray[np.bool_]:
    """Return a mask, (row, column), of the pixels within `radius` of a position [pixels]."""
    row = np.arange(shape[0])[:, None] - y
    column = np.arange(shape[1]) - x
    return np.asarray(row**2 + column**2 < radius**2)


def _hull(off: NDArray[np.float32], level: float) -> Hull | None:
    """Return the hull of the largest object above a level; None if it cannot be a ball."""
    fine = 1
    area = int((off > level).sum())
    if area < _SEARCH.least_area:
        return None
    if area < np.pi * _SEARCH.fine**2:
        fine = 3 if area < np.pi * (_SEARCH.fine / 2) ** 2 else 2
        larger = cv2.resize(off, None, fx=fine, fy=fine, interpolation=cv2.INTER_CUBIC)
        off = np.asarray(larger, np.float32)
    mask = cv2.threshold(off, level, 1, cv2.THRESH_BINARY)[1]
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=cv2.contourArea, default=None)
    if outline is None or len(outline) < 8:
        return None
    hull = cv2.convexHull(outline)
    moments = cv2.moments(hull)
    whole = moments["m00"]
    if whole <= 4:
        return None
    xx, yy, xy = (moments[key] / whole for key in ("mu20", "mu02", "mu11"))
    apart = np.hypot((xx - yy) / 2, xy)
    long, short = (2 * np.sqrt(max((xx + yy) / 2 + sign * apart, 0)) for sign in (1, -1))
    x, y = moments["m10"] / whole, moments["m01"] / whole
    solid = cv2.contourArea(outline) / whole
    if solid < _SEARCH.solid or short + 0.5 < _SEARCH.thinnest * (long + 0.5):
        return None
    # OpenCV's outline passes through the middle of pixels, half a pixel inside the edge.
    x, y, short, long = (float((each + 0.5) / fine) for each in (x, y, short, long))
    return x - 0.5, y - 0.5, short, long
