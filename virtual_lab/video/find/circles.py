"""The ball looked for again where its size is known, by what of its rim shows.

A ball before a hand, or partly as bright as its background, is no whole blob, but half of its rim
is enough: each of its pixels votes for a middle one radius inward (Hough transform); least squares
on the rim then place the middle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.find.blobs import BLOB, BlobRow, Blobs, blob_of, disc
from virtual_lab.video.find.outline import BlobOutline
from virtual_lab.video.find.still import Image, Still


@dataclass(frozen=True, kw_only=True)
class _CircleSearch:
    """Which circles may be a ball's rim; pixels of the picture that is searched."""

    softened: float = 0.6
    steepest: float = 3.0  # DN a pixel: less is noise
    off: float = 0.15  # radii that votes are spread by,
    least_off: float = 1.5  # but so many pixels at least
    room: float = 1.5  # of those, that a rim may lie off its circle
    inward: float = 0.8  # cosine of a rim's slope to its circle's radius, at least
    apart: float = 0.6  # radii of two circles' middles
    rounds: int = 3
    fewest: int = 8  # pixels of a rim
    held: float = 0.3  # of what holds a middle, across: less is a rim nearly straight
    tried: int = 6  # circles in a picture,
    most: int = 3  # and of those
    seen: float = 3.0  # radii about it, each way, that show what is beside it
    faint: float = 5.0  # DN of the ball's difference


_CIRCLE = _CircleSearch()


def circles(number: int, small: Image, drift: Array, still: Still, radius: float) -> Blobs:
    """Return where in a picture the rim of a ball of a radius [full pixels] shows, as `BLOB`.

    Parameters
    ----------
    number
        Of the frame.
    small
        The picture as searched.
    drift
        Of it from the still frame, (4,) as in `find.drift`.
    """
    r = radius / still.shrink
    away = still.difference(small, drift, still.light(small, drift)).astype(np.float32)
    off = np.asarray(cv2.GaussianBlur(away, (0, 0), _CIRCLE.softened), np.float32)
    here = still.here(small, drift, still.small)
    found: list[BlobRow] = []
    for x, y in _middles(off, r):
        left, top = (max(0, round(p - _CIRCLE.seen * r)) for p in (x, y))
        part = np.s_[top : round(y + _CIRCLE.seen * r), left : round(x + _CIRCLE.seen * r)]
        contrast = float(np.median(off[part][disc(off[part].shape, x - left, y - top, 0.6 * r)]))
        if contrast > _CIRCLE.faint:
            outline = BlobOutline(x - left, y - top, r, r, np.inf)
            corner = (still.origin[0] + left * still.shrink, still.origin[1] + top * still.shrink)
            parts = off[part], here[part]
            found.append(
                blob_of(number, outline, *parts, contrast, corner, still.shrink, drift, still)
            )
        if len(found) == _CIRCLE.most:
            break
    return np.array(found, BLOB)


def _middles(off: NDArray[np.float32], r: float) -> Iterator[Array]:
    """Yield the middles (2,) of the circles of a radius that show in a difference [pixels]."""
    across, down = (cv2.Scharr(off, cv2.CV_32F, *way, scale=1 / 32) for way in ((1, 0), (0, 1)))
    slope, size = cv2.magnitude(across, down), np.array(off.shape[::-1])
    y, x = np.divmod(steep := np.flatnonzero(slope > _CIRCLE.steepest), size[0])
    away = r / slope.ravel()[steep]
    x = np.rint(x + away * across.ravel()[steep]).astype(int)
    y = np.rint(y + away * down.ravel()[steep]).astype(int)
    shown = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
    count = np.bincount(x[shown] + size[0] * y[shown], minlength=off.size)
    room = max(_CIRCLE.least_off, _CIRCLE.off * r)
    votes = np.reshape(count, off.shape).astype(np.float32)
    votes = np.asarray(cv2.GaussianBlur(votes, (0, 0), room), np.float32)
    side = 2 * int(np.ceil(_CIRCLE.apart * r)) + 1
    highest = cv2.dilate(votes, np.ones((side, side), np.uint8))
    rows, columns = np.nonzero((votes >= highest) & (votes > 0))
    reach = round(r + 2 * _CIRCLE.room * room)
    for k in np.argsort(-votes[rows, columns], kind="stable")[: _CIRCLE.tried]:
        left, top = max(0, columns[k] - reach), max(0, rows[k] - reach)
        part = np.s_[top : rows[k] + reach + 1, left : columns[k] + reach + 1]
        y, x = np.nonzero(slope[part] > _CIRCLE.steepest)
        place = np.stack([x + left, y + top], axis=1).astype(float)
        weight = slope[part][y, x].astype(float)
        inward = np.stack([across[part][y, x], down[part][y, x]], axis=1) / weight[:, None]
        middle = np.array([columns[k], rows[k]], float)
        for _ in range(_CIRCLE.rounds):
            middle = _nearer(middle, place, inward, weight, r, _CIRCLE.room * room)
        if ((middle >= 0) & (middle < size)).all():
            yield middle


def _nearer(
    middle: Array, place: Array, inward: Array, weight: Array, r: float, room: float
) -> Array:
    """Return a circle's middle (2,) by a step of least squares on the rim near it, NaN: no rim."""
    outward = place - middle
    away = np.hypot(*outward.T)
    outward = outward / np.maximum(away, 1.0)[:, None]
    rim = (np.abs(away - r) < room) & ((outward * inward).sum(axis=1) < -_CIRCLE.inward)
    if rim.sum() < _CIRCLE.fewest:
        return np.full(2, np.nan)
    design, counted = outward[rim], weight[rim]
    normal = (design.T * counted) @ design
    if np.linalg.eigvalsh(normal)[0] < _CIRCLE.held * np.trace(normal):
        return np.full(2, np.nan)
    return np.asarray(middle + np.linalg.solve(normal, design.T @ (counted * (away[rim] - r))))
