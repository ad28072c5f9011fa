"""Where a ball is of which a lamp from the side lights a part alone: by its lit limb.

The outline of the light is the limb on one side and the line between light and shade on the other.
Of all circles of the ball's size, that on which most of the outline lies is the ball's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.locate.located import Located
from virtual_lab.video.locate.regions import Regions

__all__ = ["on_the_limb"]

Array = NDArray[np.float64]

HALF = 0.5  # of the light's contrast: its outline
POINTS = 64  # of the outline
APART = 6  # points between two that span a circle, at least
SPAN = 0.3, 1.0  # radii, half the chord between them
NEAR = 0.03  # radii from the circle, and at least a pixel: on it
STEPS = 4


def on_the_limb(seen: Regions, start: Located) -> Located:
    """Return places from the lit limb, to a pixel or so; those of the start where there is none.

    Parameters
    ----------
    seen
        Regions that show one ball, whose motion in an exposure is short against its radius.
    start
        Where it is, roughly; its radius is that of the ball, to 3 %.
    """
    x, y = start.x.copy(), start.y.copy()
    for k, (left, top) in enumerate(seen.corners):
        off = np.abs(seen.pixels[k].astype(np.float32) - seen.background[k])
        outline = _outline(off)
        found = None if outline is None else _circle(outline, float(start.radius[k]))
        if found is not None:
            x[k], y[k] = left + found[0], top + found[1]
    return replace(start, x=x, y=y)


def _outline(off: NDArray[np.float32]) -> Array | None:
    """Return points along the convex hull of what is bright, (point, 2)."""
    import cv2

    smooth = cv2.GaussianBlur(off, (0, 0), 1.0)
    bright = (smooth > HALF * np.percentile(smooth, 90)).astype(np.uint8)
    contours, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    largest = max(contours, key=cv2.contourArea, default=None)
    if largest is None or len(largest) < POINTS // 4:
        return None
    hull = cv2.convexHull(largest)[:, 0].astype(float)
    hull = np.concatenate([hull, hull[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(hull, axis=0).T))])
    even = np.arange(POINTS) * way[-1] / POINTS
    return np.stack([np.interp(even, way, axis) for axis in hull.T], axis=1)


def _circle(points: Array, radius: float) -> Array | None:
    """Return the centre of the circle of a radius that most points of a convex outline lie on."""
    one, other = (points[each] for each in np.triu_indices(POINTS, APART))
    half = np.hypot(*(other - one).T) / 2
    good = (half > SPAN[0] * radius) & (half < SPAN[1] * radius)
    if not good.any():
        return None
    one, other, half = one[good], other[good], half[good, None]
    middle, across = (one + other) / 2, (other - one)[:, ::-1] * [-1, 1] / (2 * half)
    inward = np.sign(((points.mean(axis=0) - middle) * across).sum(axis=1))[:, None]
    centres = middle + inward * across * np.sqrt(radius**2 - half**2)
    near = max(1.0, NEAR * radius)
    off = np.abs(np.hypot(*(centres[:, None] - points).transpose(2, 0, 1)) - radius)
    best = centres[np.argmin(np.minimum(off, near).sum(axis=1))]
    for _ in range(STEPS):
        away = points - best
        far = np.hypot(*away.T)
        on = np.abs(far - radius) < near
        best = best + np.linalg.lstsq(away[on] / far[on, None], (far - radius)[on])[0]
    return np.asarray(best)
