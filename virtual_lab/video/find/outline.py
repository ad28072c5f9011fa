"""The outline of a blob by rays: each ray's edge lies half way between its own ball and background.

Where the background changes along the rim a contour at one level lies off: by a tenth of the radius
in a real clip.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask
from virtual_lab.video.find.drift import upper_median


class BlobOutline(NamedTuple):
    """A ball's outline in a region [pixels]."""

    x: float
    y: float
    short: float  # half its shorter axis
    long: float
    short_u: float
    shade_u: float = 0.0  # of the radius, by the shade on the ball


@dataclass(frozen=True, kw_only=True)
class _Rays:
    """Rays from a blob's middle, lengths in radii. Found on the balls of tests/video/scenery."""

    count: int = 48
    steps: int = 64
    reach: float = 1.6
    ball: tuple[float, float] = (0.5, 0.8)
    background: tuple[float, float] = (1.3, 1.55)
    inner: tuple[float, float] = (0.35, 0.55)  # from here to `outer` the ball's level changes
    outer: tuple[float, float] = (0.6, 0.8)
    shading: float = 0.7  # of that change goes on to the rim: no bias of the radius
    sharp_edge: float = (
        0.15  # width: the shading counts whole; at twice that, of a blur, not at all
    )
    least_contrast: float = 0.3  # of the blob's: a ray with less shows no edge
    least_share: float = 0.4  # of the rays must show one
    edge_levels: tuple[float, float] = (0.3, 0.7)  # of a ray's contrast: its edge's width
    edge_u: float = 0.15  # of that width: as far off may a rounded edge's place be
    # of the radius, over the cube of the share by which the brightness swings around the ball: up
    # to 0.35 the rim is right to 1 %, at 0.46 to 5 or 20 %, at 0.65 to 40 %, and soft light looks
    # there as hard light does from the side, whose dark half is taken for background
    shade_u: float = 2.0

    @cached_property
    def share(self) -> Array:
        return np.linspace(0.3, self.reach, self.steps)

    @cached_property
    def turns(self) -> Array:
        return np.asarray(2 * np.pi / self.count * np.arange(self.count))

    @cached_property
    def design(self) -> Array:
        """Shift, size, and drawn out along one direction, (ray, 5)."""
        cos, sin = np.cos(self.turns), np.sin(self.turns)
        twice = 2 * self.turns
        return np.stack([cos, sin, np.ones(self.count), np.cos(twice), np.sin(twice)], axis=1)

    @cached_property
    def parts(self) -> tuple[Mask, Mask, Mask, Mask]:
        """Which steps are ball, background, inner and outer part of the ball."""
        bounds = (self.ball, self.background, self.inner, self.outer)
        ball, background, inner, outer = (
            (low < self.share) & (high > self.share) for low, high in bounds
        )
        return ball, background, inner, outer

    @cached_property
    def to_rim(self) -> float:
        """From the ball's mean level to its rim, over the way from inner to outer part."""
        ball, _, inner, outer = (float(self.share[part].mean()) for part in self.parts)
        return (1 - ball) / (outer - inner)


def fit_outline(
    off: NDArray[np.float32], x: float, y: float, radius: float, contrast: float, rounds: int = 2
) -> BlobOutline | None:
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
    rays = _RAYS
    ball, background, inner, outer = rays.parts
    enough = rays.least_share * rays.count
    to_x, to_y = (turn[:, None] * rays.share for turn in rays.design.T[:2])
    width, fitted = 0.0, np.zeros(5)
    for _ in range(rounds):
        along = rays.share * radius
        at = ((x + radius * to_x).astype(np.float32), (y + radius * to_y).astype(np.float32))
        mode = cv2.BORDER_REPLICATE
        seen = np.asarray(cv2.remap(off, *at, cv2.INTER_LINEAR, borderMode=mode), float)
        behind = upper_median(seen[:, background])
        height = seen[:, ball].mean(axis=1) - behind
        good = height > rays.least_contrast * contrast
        if good.sum() < enough:
            return None
        level = (seen - behind[:, None]) / np.where(good, height, 1.0)[:, None]
        (far, far_found), (near, near_found) = (
            _crossing(level, along, e) for e in rays.edge_levels
        )
        both = good & far_found & near_found
        blurred = 2 * rays.sharp_edge
        wide = np.where(both, (far - near) / radius, blurred)
        shaded = rays.shading * np.clip((blurred - wide) / rays.sharp_edge, 0, 1)
        slope = np.clip(level[:, outer].mean(axis=1) - level[:, inner].mean(axis=1), -0.5, 0.5)
        half = 0.5 * np.maximum(1 + shaded * rays.to_rim * slope, 0.5)
        edge, found = _crossing(level, along, half)
        good &= found
        if good.sum() < enough:
            return None
        fitted = _robust(edge, good)
        both &= good
        width = float(upper_median(far[both] - near[both])) if both.any() else radius
        x, y, radius = x + fitted[0], y + fitted[1], float(fitted[2])
        if not 1.0 < radius < max(off.shape):
            return None
    drawn = float(np.hypot(fitted[3], fitted[4]))
    if drawn > 0.6 * radius:
        return None
    axes, short_u = (radius - drawn, radius + drawn), rays.edge_u * abs(width)
    swing = 2 * float(np.hypot(*(height @ rays.design[:, :2]))) / max(float(height.sum()), 1e-6)
    shade_u = rays.shade_u * min(swing, 1.0) ** 3 * radius
    return BlobOutline(float(x), float(y), *axes, short_u, shade_u)


_RAYS = _Rays()


def _crossing(level: Array, along: Array, share: Array | float) -> tuple[Array, Mask]:
    """Return where rays first fall below a share on the way out, and whether they do."""
    share = np.broadcast_to(share, len(level))
    start = int(np.searchsorted(along, 0.6 * along[-1] / _RAYS.reach))
    below = level[:, start:] < share[:, None]
    k = np.argmax(below, axis=1) + start
    found = below.any(axis=1) & (k > start)
    k = np.maximum(k, 1)
    row = np.arange(len(level))
    high, low = level[row, k - 1], level[row, k]
    part = np.clip((high - share) / np.maximum(high - low, 1e-6), 0, 1)
    return along[k - 1] + part * (along[k] - along[k - 1]), found


def _robust(edge: Array, good: Mask) -> Array:
    """Return the outline's five numbers by the rays' edges, those far off the others left out."""
    trust, design = good.astype(float), _RAYS.design
    fitted = np.zeros(5)
    for _ in range(3):
        weighted = design * trust[:, None]
        fitted = np.linalg.solve(weighted.T @ design + 1e-6 * np.eye(5), weighted.T @ edge)
        off = np.abs(edge - design @ fitted)
        spread = max(0.05, 1.4826 * float(upper_median(off[good])))
        trust = good / np.maximum(1.0, off / (1.5 * spread)) ** 2
    return fitted
