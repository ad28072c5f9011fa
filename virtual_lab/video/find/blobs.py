"""Blobs that may be a ball: thresholds, half of the blob's own contrast, convex hull, clean ring.

A shadow or a mirror image joins the ball at a low threshold and falls off at half of the ball's own
contrast; a hand that holds the ball lies on the ring about it, which must be background.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.find.drift import matrix_of
from virtual_lab.video.find.outline import BlobOutline, fit_outline
from virtual_lab.video.find.still import Image, Still, difference_of, difference_of_light

Blobs = NDArray[np.void]
BlobRow = tuple[Any, ...]  # as of `BLOB`

BLOB = np.dtype(
    [
        ("frame", np.int32),
        ("x", float),  # still frame [pixels]
        ("y", float),
        ("radius", float),  # across the shorter axis of the outline
        ("length", float),  # half the longer axis
        ("radius_u", float),  # of its edge, where light ends and the ball begins; inf: unmeasured
        ("contrast", float),  # DN
        ("dirty", float),  # share of the ring that is no background
        ("cut", bool),  # touches the picture's edge
        ("picture_x", float),  # in the frame itself
        ("picture_y", float),
        ("colour", float, (3,)),
        ("shade_u", float),  # of the radius, by the shade on the ball
    ]
)


@dataclass(frozen=True, kw_only=True)
class _Search:
    """What may be a ball; differences from the background in DN of 8 bits."""

    thresholds: tuple[int, ...] = (10, 20, 40, 80)  # each once more: no single one decides
    faint: float = 5.0
    softened: float = 0.7  # pixels: codecs leave blocks
    least_area: float = 12.0  # pixels of the picture searched: a ball of two pixels' radius
    largest: float = 0.12  # of the picture
    regions: int = 24  # looked at in a frame
    solid: float = 0.8  # of its hull's area that a blob fills
    filled: tuple[float, float] = (0.85, 1.12)  # of an ellipse's area, for a hull's moments
    thinnest: float = 0.22  # ratio of a blob's axes: blur of five times the ball
    # percentiles of a blob that are its contrast; the second where the background has a pattern
    brightness: tuple[float, float] = (85, 40)
    whole: float = 0.6  # of what differs: less may be a patch of a ball that has several
    # ratio of axes, by the second one: a hand or a head is longer, a ball with its shadow too
    round: tuple[float, float] = (1.3, 1.2)  # where the first shows nothing, and where it does
    outline_level: float = 0.5  # of a blob's own contrast
    ring_level: float = 0.35  # of the contrast: what is brighter in the ring is not background
    centre_room: float = 0.35  # radii between a hull's middle and an outline's
    hull_u: float = 0.2  # of its radius, where no outline is fitted
    sure_u: float = 0.15  # of the radius: such an outline needs no other threshold
    coarse: int = 48  # pixels of a blob: one twice as large is made smaller first
    fine: float = 16.0  # pixels of radius at which an outline is not drawn larger


_SEARCH = _Search()


def blobs(number: int, picture: Image, small: Image, drift: Array, still: Still) -> Blobs:
    """Return what in a picture may be a ball, an array of `BLOB`.

    Parameters
    ----------
    number
        Of the frame.
    picture, small
        Full size and as searched.
    drift
        Of the picture from the still frame, (4,) as in `find.drift`.
    """
    light = still.light(small, drift)
    off = still.difference(small, drift, light)
    found: list[BlobRow] = []
    for box in _boxes(off, still.shrink):
        if any(_inside(box, each, still.origin) for each in found):
            continue
        outlined = _outline(number, picture, drift, light, still, box)
        if outlined is None:
            continue
        rivals = [each for each in found if _same(outlined, each)]
        if all(_surer(outlined, each) for each in rivals):
            found = [each for each in found if not any(each is other for other in rivals)]
            found.append(outlined)
    return np.array(found, BLOB)


def _inside(box: tuple[int, int, int, int], blob: BlobRow, origin: tuple[int, int]) -> bool:
    """Return whether a box lies in a blob that is sure already."""
    _, x, y, short, long, spread, _, dirty, *_ = blob
    left, top, wide, high = box[0] + origin[0], box[1] + origin[1], *box[2:]
    sure = dirty < 0.1 and spread < _SEARCH.sure_u * short
    away = float(np.hypot(left + wide / 2 - x, top + high / 2 - y))
    return bool(sure and away + max(wide, high) / 2 < 1.4 * long)


def _same(one: BlobRow, other: BlobRow) -> bool:
    away = np.hypot(one[1] - other[1], one[2] - other[2])
    return bool(away < 0.6 * max(one[3], other[3]) and 0.5 < one[3] / other[3] < 2.0)


def _surer(one: BlobRow, other: BlobRow) -> bool:
    return bool(
        (one[7] > _SEARCH.ring_level, one[5] / one[3])
        < (other[7] > _SEARCH.ring_level, other[5] / other[3])
    )


def _boxes(off: Image, shrink: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield left, top, width and height [full pixels] of what differs, threshold by threshold."""
    seen: set[tuple[int, int, int, int]] = set()
    kernel = np.ones((3, 3), np.uint8)
    largest = _SEARCH.largest * off.size
    for threshold in _SEARCH.thresholds:
        mask = cv2.threshold(off, threshold, 1, cv2.THRESH_BINARY)[1]
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, kernel)
        count, _, stats, _ = cv2.connectedComponentsWithStats(mask, ltype=cv2.CV_16U)
        areas = stats[1:count, cv2.CC_STAT_AREA]
        for k in np.argsort(-areas, kind="stable")[: _SEARCH.regions].tolist():
            if not _SEARCH.least_area <= areas[k] <= largest:
                continue
            left, top, wide, high = map(int, stats[1 + k, :4])
            coarse = (left // 2, top // 2, wide // 2, high // 2)
            if coarse not in seen:
                seen.add(coarse)
                yield shrink * left, shrink * top, shrink * wide, shrink * high


def _outline(
    number: int,
    picture: Image,
    drift: Array,
    light: Array,
    still: Still,
    box: tuple[int, int, int, int],
) -> BlobRow | None:
    """Return the outline at half of the contrast in a box as a row of `BLOB`, None: no ball's."""
    left, top, wide, high = box
    rows, columns = still.background.shape[:2]
    room = max(6, round(0.6 * max(wide, high)))
    x0, y0 = max(0, left - room), max(0, top - room)
    size = (min(columns, left + wide + room) - x0, min(rows, top + high + room) - y0)
    part, behind = still.cut(picture, drift, light, (x0, y0), size)
    fine = max(1, max(wide, high) // _SEARCH.coarse)
    if fine > 1:  # tenths of a pixel of a large ball take no more than that
        smaller = (max(1, size[0] // fine), max(1, size[1] // fine))
        cutting = np.s_[: smaller[1] * fine, : smaller[0] * fine]
        part, behind = (
            np.asarray(cv2.resize(each[cutting], smaller, interpolation=cv2.INTER_AREA), np.uint8)
            for each in (part, behind)
        )
    off = _softened(difference_of(part, behind))
    inner = off[
        (top - y0) // fine : (top - y0 + high) // fine,
        (left - x0) // fine : (left - x0 + wide) // fine,
    ]
    bright = inner[inner > _SEARCH.faint]
    if bright.size < _SEARCH.least_area:
        return None
    chosen = _contrasted(off, bright)
    if chosen is None:
        return None
    drawn, fitted, contrast, even = chosen
    outline = fitted or BlobOutline(*drawn, _SEARCH.hull_u * drawn[2])
    if fitted:
        x, y, short, long, spread, shade_u = fitted
        # a rim in shade takes the edge inward in light, a gamma does in grey values
        luminous = _softened(difference_of_light(part, behind))
        level = float(np.median(luminous[disc(luminous.shape, x, y, 0.6 * short)]))
        luminous = luminous if even else np.minimum(luminous, np.float32(level))
        other = fit_outline(luminous, x, y, (short + long) / 2, level, rounds=1)
        if other is not None and abs(other.short - short) < _SEARCH.centre_room * short:
            # the edge lies between the two, nobody knows where
            spread = float(np.hypot(spread, (other.short - short) / np.sqrt(12)))
            axes = (short + other.short) / 2, (long + other.long) / 2
            outline = BlobOutline(x, y, *axes, spread, shade_u)
    corner = (x0 + still.origin[0], y0 + still.origin[1])
    return blob_of(number, outline, off, part, contrast, corner, fine, drift, still)


def blob_of(
    number: int,
    outline: BlobOutline,
    off: NDArray[np.float32],
    part: Image,
    contrast: float,
    corner: tuple[int, int],
    shrink: int,
    drift: Array,
    still: Still,
) -> BlobRow:
    """Return a row of `BLOB`.

    Parameters
    ----------
    number
        Of the frame.
    outline
        In a part of the picture, in its pixels.
    off, part
        How far that part is from the background [DN], and the part.
    contrast
        Of the ball [DN].
    corner
        x and y of the part's first pixel in the still frame.
    shrink
        Pixels of the still frame that one of the part is, each way.
    drift
        Of the picture from the still frame, (4,).
    """
    x, y, short, long, spread, shade_u = outline
    ring = disc(off.shape, x, y, 1.5 * long + 3) & ~disc(off.shape, x, y, 1.25 * long + 1.5)
    core = disc(off.shape, x, y, 0.6 * short)
    colour = np.median(part[core].reshape(-1, 1 if part.ndim == 2 else 3), axis=0)
    dirty = float((off[ring] > _SEARCH.ring_level * contrast).mean()) if ring.any() else 1.0
    at = [shrink * (p + 0.5) - 0.5 + first for p, first in zip((x, y), corner, strict=True)]
    short, long, spread, shade_u = (shrink * p for p in (short, long, spread, shade_u))
    there = (matrix_of(drift, still.size) @ [*at, 1.0]).tolist()
    reach = long + 1
    cut = any(not reach <= p <= side - 1 - reach for p, side in zip(there, still.size, strict=True))
    colours = np.broadcast_to(colour, 3)
    return number, *at, short, long, spread, contrast, dirty, cut, *there, colours, shade_u


class _Contrasted(NamedTuple):
    drawn: tuple[float, float, float, float]  # centre and half axes of the hull [pixels]
    fitted: BlobOutline | None
    contrast: float  # DN
    even: bool  # else patches of it differ more, and count no more than the rest


def _contrasted(off: NDArray[np.float32], bright: NDArray[np.float32]) -> _Contrasted | None:
    """Return the outline at half of a contrast that fits, of what differs and its bright pixels."""
    chosen, least = None, 0.0
    for percentile, even in zip(_SEARCH.brightness, (True, False), strict=True):
        contrast = float(np.percentile(bright, percentile))
        if contrast < (2 if even else 4) * _SEARCH.faint:
            break
        drawn = _shape(off, _SEARCH.outline_level * contrast)
        if drawn is None:
            continue
        x, y, short, long = drawn
        level = off if even else np.minimum(off, np.float32(contrast))
        fitted = fit_outline(level, x, y, np.sqrt(short * long), contrast)
        if fitted and np.hypot(fitted.x - x, fitted.y - y) >= _SEARCH.centre_room * short:
            fitted = None
        area = np.pi * short * long
        ratio = max(long / short, fitted.long / fitted.short) if fitted else np.inf
        if even or (ratio < _SEARCH.round[chosen is not None] and area > least):
            chosen, least = _Contrasted(drawn, fitted, contrast, even), area / _SEARCH.whole
        if area > _SEARCH.whole * bright.size:
            break
    return chosen


def _softened(off: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(off, (0, 0), _SEARCH.softened), np.float32)


def disc(shape: tuple[int, ...], x: float, y: float, radius: float) -> NDArray[np.bool_]:
    """Return which pixels (row, column) lie nearer to a place than a radius [pixels]."""
    row = np.arange(shape[0])[:, None] - y
    column = np.arange(shape[1]) - x
    return np.asarray(row**2 + column**2 < radius**2)


def _shape(off: NDArray[np.float32], level: float) -> tuple[float, float, float, float] | None:
    """Return centre and half axes of the largest thing above a level, None: it is no ball."""
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
    filled = whole / (np.pi * long * short) if short > 0 else 0.0
    x, y = moments["m10"] / whole, moments["m01"] / whole
    solid = cv2.contourArea(outline) / whole
    if (
        solid < _SEARCH.solid
        or not _SEARCH.filled[0] < filled < _SEARCH.filled[1]
        or short + 0.5 < _SEARCH.thinnest * (long + 0.5)
    ):
        return None
    # an outline runs through the middle of its pixels, half a pixel inside the edge
    return (
        float((x + 0.5) / fine - 0.5),
        float((y + 0.5) / fine - 0.5),
        float((short + 0.5) / fine),
        float((long + 0.5) / fine),
    )
