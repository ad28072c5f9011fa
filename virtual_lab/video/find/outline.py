"""A ball's outline to a tenth of a pixel: on rays from its middle, at half of each ray's contrast.

A ball is lit from one side, so that half of its greatest contrast lies inside its darker rim; each
ray therefore has a level of its own, and where its edge is sharp the level goes on to the rim as it
falls or rises inside: a lamp leaves the rim of a light ball so dark that the half lies 3 % inside.
The edges are joined by a circle that is shifted and drawn out (blur), robustly: rays that meet
something else do not count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.find.drift import middle

__all__ = ["Outline", "fit_outline"]

Array = NDArray[np.float64]

RAYS = 48
PLACES = 64  # along a ray
REACH = 1.6  # radii
INSIDE, OUTSIDE = (0.5, 0.8), (1.3, 1.55)  # of the radius: the ball, and what is behind it
INNER_PART, OUTER_PART = (0.35, 0.55), (0.6, 0.8)  # of the radius: how the ball's level goes on
GOES_ON = 0.7  # of that slope out to the rim: no bias on the balls of tests/video/scenery
WIDE, NARROW = 0.3, 0.15  # of the radius, an edge's width: blurred, none of it; sharp, all
OUTER, INNER = 0.3, 0.7  # of a ray's contrast: the edge's width lies between
FAINT = 0.3  # of the ball's contrast: such a ray shows no edge
ENOUGH = 0.4  # of the rays
ROUNDS = 2
TRUST = 3  # rounds of the robust fit
SHARE = np.linspace(0.3, REACH, PLACES)
BALL, REST, DEEP, RIM = (
    (low < SHARE) & (high > SHARE) for low, high in (INSIDE, OUTSIDE, INNER_PART, OUTER_PART)
)
TO_RIM = (1 - SHARE[BALL].mean()) / (SHARE[RIM].mean() - SHARE[DEEP].mean())
TURNS = np.arange(RAYS) * (2 * np.pi / RAYS)
COS, SIN = np.cos(TURNS), np.sin(TURNS)
TO_X, TO_Y = COS[:, None] * SHARE, SIN[:, None] * SHARE
# shift, size, and drawn out along one direction
DESIGN = np.stack([COS, SIN, np.ones(RAYS), np.cos(2 * TURNS), np.sin(2 * TURNS)], axis=1)
ROUNDED = 0.15  # of the edge's width between the outer and inner level: what its place may be off


class Outline(NamedTuple):
    """A ball's outline in a region [pixels]."""

    x: float
    y: float
    short: float  # half its shorter axis
    long: float
    short_u: float


def fit_outline(
    off: NDArray[np.float32],
    x: float,
    y: float,
    radius: float,
    contrast: float,
    rounds: int = ROUNDS,
) -> Outline | None:
    """Return the outline of a blob, None where too few rays show an edge.

    Parameters
    ----------
    off
        Difference from the background, (row, column) [DN].
    x, y, radius
        Of the blob, to a fifth of the radius.
    contrast
        Of the blob [DN].
    rounds
        Of which each begins where the one before ended.
    """
    import cv2

    width = 0.0
    fitted = np.zeros(5)
    for _ in range(rounds):
        along = SHARE * radius
        to_x, to_y = (x + radius * TO_X).astype(np.float32), (y + radius * TO_Y).astype(np.float32)
        mode = cv2.BORDER_REPLICATE
        seen = np.asarray(cv2.remap(off, to_x, to_y, cv2.INTER_LINEAR, borderMode=mode), float)
        ball, rest = seen[:, BALL].mean(axis=1), middle(seen[:, REST])
        height = ball - rest
        good = height > FAINT * contrast
        if good.sum() < ENOUGH * RAYS:
            return None
        height = np.where(good, height, 1.0)
        level = (seen - rest[:, None]) / height[:, None]
        outer, found_outer = _crossing(level, along, OUTER)
        inner, found_inner = _crossing(level, along, INNER)
        both = good & found_outer & found_inner
        wide = np.where(both, (outer - inner) / radius, WIDE)
        on = GOES_ON * np.clip((WIDE - wide) / NARROW, 0, 1)
        slope = np.clip(level[:, RIM].mean(axis=1) - level[:, DEEP].mean(axis=1), -0.5, 0.5)
        edge, found = _crossing(level, along, 0.5 * np.maximum(1 + on * TO_RIM * slope, 0.5))
        good &= found
        if good.sum() < ENOUGH * RAYS:
            return None
        fitted = _robust(edge, good)
        both &= good
        width = float(middle(outer[both] - inner[both])) if both.any() else radius
        x, y, radius = x + fitted[0], y + fitted[1], float(fitted[2])
        if not 1.0 < radius < max(off.shape):
            return None
    drawn = float(np.hypot(fitted[3], fitted[4]))
    if drawn > 0.6 * radius:
        return None
    return Outline(float(x), float(y), radius - drawn, radius + drawn, ROUNDED * abs(width))


def _crossing(level: Array, along: Array, share: Array | float) -> tuple[Array, NDArray[np.bool_]]:
    """Return where rays first fall below a share on the way out, and whether they do."""
    share = np.broadcast_to(share, len(level))
    middle = int(np.searchsorted(along, 0.6 * along[-1] / REACH))
    below = level[:, middle:] < share[:, None]
    k = np.argmax(below, axis=1) + middle
    found = below.any(axis=1) & (k > middle)
    k = np.maximum(k, 1)
    row = np.arange(len(level))
    high, low = level[row, k - 1], level[row, k]
    part = np.clip((high - share) / np.maximum(high - low, 1e-6), 0, 1)
    return along[k - 1] + part * (along[k] - along[k - 1]), found


def _robust(edge: Array, good: NDArray[np.bool_]) -> Array:
    trust = good.astype(float)
    fitted = np.zeros(5)
    for _ in range(TRUST):
        weighted = DESIGN * trust[:, None]
        normal = weighted.T @ DESIGN + 1e-6 * np.eye(5)
        fitted = np.linalg.solve(normal, weighted.T @ edge)
        off = np.abs(edge - DESIGN @ fitted)
        spread = max(0.05, 1.4826 * float(middle(off[good])))
        trust = good / np.maximum(1.0, off / (1.5 * spread)) ** 2
    return fitted
