"""The rim of a ball, blurred by lens and pixel: tables over the depth, and parameters of the fit.

The surface of a sphere is inclined near its rim: a point at the angle a from the rim is R (1 - cos
a) inside the outline. Brightness near the rim is therefore a function of sin a, called the facing
of the surface. Shading is linear in it, and a pattern has the same scale around the whole rim.
"""

from __future__ import annotations

from collections import namedtuple
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from virtual_lab.units import Array

# parameters common to all sectors: center, radius, oval of the outline (cos 2a, sin 2a), level and
# slopes of the background, and shading of the ball: a level, and the slopes of brightness with the
# x, y and camera components of the surface normal
Shared = namedtuple(
    "Shared", "x y radius oval_c oval_s level slope_x slope_y plain side_x side_y face"
)
AT = Shared._make(range(len(Shared._fields)))
# sums over the pixels
Tally = namedtuple("Tally", "pixels near around seen full stray")
TALLY = Tally._make(range(len(Tally._fields)))


# columns of the table before those of the pattern
SHADES = len(("level", "way to the side", "facing"))


class Table(NamedTuple):
    """Layout of the tables, and assumptions about a pattern."""

    # distance from the edge beyond which a pixel is completely ball or background, where the tables
    # begin [`Profiles.width`]
    widths: float = 5.0
    per_width: int = 32  # number of table entries per width
    knot_spacing: float = 0.11  # spacing of a pattern's knots, in facing
    deepest_knot: float = 0.9  # facing beyond which a pattern is constant
    # distance at which a pattern is easily mistaken for the outline [motion blur]
    hiding_blur: float = 0.15
    alike: float = 0.3  # approximate correlation angle of a pattern's brightness [rad]


TABLE = Table()


class Profiles(NamedTuple):
    """Blurred brightness as a function of depth, and prior covariance of a pattern along it."""

    table: Array  # (entry, 2 column): columns, then their derivatives by the depth in widths
    stiffness: Array  # (knot, knot): inverse covariance of a pattern's knots, variance 1
    hides: Array  # (knot,), inward shift of the outline that looks similar to the knot [pixel]
    width: float  # standard deviation of lens and pixel [pixel]
    inside: float  # largest depth inside the outline at which pixels are used, without blur [pixel]


def blurred_profiles(radius: float, width: float, inside: float, blur: float) -> Profiles:
    """Return tables of the brightness near the rim of a blurred ball, for the fit of its outline.

    Parameters
    ----------
    radius
        Approximate radius of the balls [pixels].
    width
        Standard deviation of the blur by lens and pixel together [pixels].
    inside
        Width of the band inside the outline in which pixels are used [pixels]. It applies to a ball
        without motion blur.
    blur
        Distance that the ball moves during the exposure [pixels]. For the moving ball, the width of
        the band is `inside` plus `blur`, but at most the radius.
    """
    depth = min(inside + blur, radius)
    deepest = min(float(_facing(np.array(depth), radius)), TABLE.deepest_knot)
    facings = np.linspace(0.0, deepest, max(3, 1 + round(deepest / TABLE.knot_spacing)))
    reach = 6.0 * width + depth
    entries = int(np.ceil((reach / width + TABLE.widths) * TABLE.per_width)) + 1
    # twice as many depths as entries, more closely spaced near the edge
    ends = min(reach, radius) * np.linspace(0.0, 1.0, 2 * entries + 1) ** 2
    middles, steps = (ends[1:] + ends[:-1]) / 2, np.diff(ends)
    facing = _facing(middles, radius)
    hats = [np.interp(facing, facings, one) for one in np.eye(facings.size)]
    columns = np.stack([np.ones_like(middles), 1 - middles / radius, facing, *hats], axis=1)
    t = -TABLE.widths + np.arange(entries) / TABLE.per_width
    away = t[:, None] - middles / width
    weight = np.exp(-(away**2) / 2) / np.sqrt(2 * np.pi) * steps / width
    # Brightness is constant beyond the last depth.
    beyond = ndtr(t - ends[-1] / width)[:, None]
    at_last = np.exp(-((t - ends[-1] / width) ** 2) / 2)[:, None] / np.sqrt(2 * np.pi)
    values = weight @ columns + beyond * columns[-1]
    slopes = (-weight * away) @ columns + at_last * columns[-1]
    angles = np.arcsin(facings)
    like = np.exp(-np.abs(angles[:, None] - angles) / TABLE.alike)
    hidden = steps * np.exp(-middles / (width + TABLE.hiding_blur * blur))
    return Profiles(
        table=np.ascontiguousarray(np.concatenate([values, slopes], axis=1)),
        stiffness=np.linalg.inv(like),
        hides=columns[:, SHADES:].T @ hidden,
        width=width,
        inside=inside,
    )


def _facing(depth: Array, radius: float) -> Array:
    """Return sin a at a depth inside the outline, where a is the angle from the rim."""
    inside = 1 - np.minimum(depth / radius, 1.0)
    return np.asarray(np.sqrt(1 - inside**2))
