"""Sums over the pixels about a ball's outline that the edge fit asks for."""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.rim_profiles import (
    AROUND,
    COUNT,
    FACE,
    FIRST,
    FULL,
    LEVEL,
    NEAR,
    OVAL_C,
    OVAL_S,
    PER,
    PIXELS,
    PLAIN,
    RADIUS,
    SEEN,
    SHADES,
    SIDE_X,
    SIDE_Y,
    SLOPE_X,
    SLOPE_Y,
    STRAY,
    TALLY,
    X,
    Y,
)

__all__ = ["Rim", "View", "sector_sums"]

OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "cache": True,
    "nogil": True,
    "fastmath": True,
}
GAIN, READ, BLACK, PRNU, TOP = range(5)  # of `Noise.figures`

Floats = NDArray[np.float64]

COARSE = 3  # rows from one to the next until the fit settles
REACH = 4.6  # widths from the edge beyond which a pixel is all ball or all background
MOST = 32  # Gauss-Legendre nodes of the way
OUTSIDE = 4.0  # pixels of background beyond the edge
LOOSE = 5.0  # sigmas beyond which a residual weighs less
ODD = 36.0  # squares of sigmas: such a pixel fits nothing
NODES = np.zeros((MOST + 1, MOST, 2))
for _n in range(1, MOST + 1):
    NODES[_n, :_n] = np.stack(np.polynomial.legendre.leggauss(_n), axis=1)


class View(NamedTuple):
    """A region, (row, column)."""

    pixels: Floats  # [DN]
    background: Floats  # [DN]


class Rim(NamedTuple):
    """How a ball's rim looks: what `rim_profiles` knows of it, and how it is blurred."""

    table: Floats  # (entry, 2 column)
    stiffness: Floats  # (knot, knot)
    hides: Floats  # (knot,) [pixel]
    width: float  # standard deviation of lens and pixel [pixel]
    inside: float  # pixels of the ball that are looked at
    way: Floats  # (2,) the ball's shift during the exposure [pixel]


@njit(**OPTIONS)
def _fill(
    x: float, y: float, behind: float, p: Floats, rim: Rim, light: Floats, row: Floats
) -> tuple[float, float]:
    """Fill a pixel's derivatives by outline, shading and pattern; return its mean and outline.

    (x, y) is from the centre at mid exposure; `light` is the brightness over the table's columns.
    """
    table, way, s = rim.table, rim.way, rim.width
    columns = light.size
    r = sqrt(x * x + y * y)
    change = abs(way[0] * x + way[1] * y) / r
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    change = max(change, along * along / (4.0 * p[RADIUS]))
    count = min(MOST, int(0.9 * change / s) + 2) if along > 0.0 else 1
    mean, outline, bend = behind, 0.0, 0.5 * s / p[RADIUS]
    for n in range(count):
        place, weight = 0.5 * NODES[count, n, 0], 0.5 * NODES[count, n, 1]
        u, v = x - place * way[0], y - place * way[1]
        r = sqrt(u * u + v * v)
        u, v = u / r, v / r
        cos2, sin2 = u * u - v * v, 2.0 * u * v
        edge = p[RADIUS] * (1.0 + p[OVAL_C] * cos2 + p[OVAL_S] * sin2)
        entry = ((edge - r) / s - bend - FIRST) * PER
        if entry <= 0.0:
            continue
        i = min(int(entry), table.shape[0] - 2)
        part = min(entry - i, 1.0)
        low, high = weight * (1.0 - part), weight * part
        light[1] = p[SIDE_X] * u + p[SIDE_Y] * v
        rise = 0.0
        for c in range(columns):
            value = low * table[i, c] + high * table[i + 1, c]
            mean += light[c] * value
            rise += light[c] * (low * table[i, columns + c] + high * table[i + 1, columns + c])
            if c == 1:
                row[SIDE_X] += u * value
                row[SIDE_Y] += v * value
            else:
                row[PLAIN if c == 0 else FACE if c == 2 else COUNT + c - SHADES] += value
        outline += low * table[i, columns] + high * table[i + 1, columns]
        rise /= s
        row[X] += rise * u
        row[Y] += rise * v
        row[RADIUS] += rise
        row[OVAL_C] += rise * p[RADIUS] * cos2
        row[OVAL_S] += rise * p[RADIUS] * sin2
    return mean, outline / s


@njit(**OPTIONS)
def _weigh(
    value: float,
    mean: float,
    ball: float,
    outline: float,
    first: bool,
    noise: Floats,
    tally: Floats,
) -> float:
    """Return a pixel's weight, and tally it.

    It is 0 where full scale hides what the pixel would have said, and where what is behind the
    ball has moved: a bat that recoils. `ball` is the ball's share of the pixel.
    """
    light = max((value if first else mean) - noise[BLACK], 0.0)
    v = noise[READ] + light * (noise[GAIN] + noise[PRNU] * noise[PRNU] * light)
    tally[SEEN] += outline
    room = noise[TOP] - (value if first else mean)
    if room * room < 9.0 * v or (room < 0.0 and value >= noise[TOP]):
        tally[FULL] += outline
        return 0.0
    misfit = (value - mean) * (value - mean) / v
    tally[PIXELS] += 1.0
    tally[STRAY] += misfit > ODD
    if outline > 0.02:
        tally[NEAR] += min(misfit, ODD)
        tally[AROUND] += 1.0
    elif misfit > ODD and ball < 0.02:
        return 0.0
    return float((1.0 if first else min(1.0, LOOSE / sqrt(misfit + 1e-30))) / v)


@njit(**OPTIONS)
def sector_sums(
    view: View, rim: Rim, noise: Floats, p: Floats, pattern: Floats, first: bool, sums: Floats
) -> Floats:
    """Add up a region's normal equations by sector of the rim, and return the tally.

    `sums` (sector + 1, n, n), the last of pixels off the rim: over the shared parameters, the
    pattern's knots (`pattern`, (sector, knot)) where a sector begins and where it ends, and what
    is left of a pixel. `first`: the model is not yet one whose means could show the pixels' noise,
    and some of the rows do.
    """
    region, back, way = view.pixels, view.background, rim.way
    rows, cols = region.shape
    sectors, knots = pattern.shape
    n = COUNT + 2 * knots + 1
    sums[:] = 0.0
    tally, row, light = np.zeros(TALLY), np.empty(n), np.empty(SHADES + knots)
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    oval = p[RADIUS] * (abs(p[OVAL_C]) + abs(p[OVAL_S]))
    blurred = REACH * rim.width + oval
    most = p[RADIUS] + 0.5 * along + blurred + OUTSIDE
    for i in range(
        max(0, int(p[Y] - most)), min(rows, int(p[Y] + most) + 2), COARSE if first else 1
    ):
        y, slope_y = i - p[Y], (i - 0.5 * rows) * 2.0 / cols
        rest = sqrt(max(most * most - y * y, 0.0))
        for j in range(max(0, int(p[X] - rest) + 1), min(cols, int(p[X] + rest) + 1)):
            x, slope_x = j - p[X], (j - 0.5 * cols) * 2.0 / cols
            r = sqrt(x * x + y * y)
            half = 0.5 * abs(way[0] * x + way[1] * y) / max(r, 1e-9)
            out = r - p[RADIUS] - half
            if r < 1.0 or out < -(2.0 * half + rim.inside + oval) or out > blurred + OUTSIDE:
                continue
            behind = p[LEVEL] * back[i, j] + p[SLOPE_X] * slope_x + p[SLOPE_Y] * slope_y
            row[:] = 0.0
            mean, outline, k = behind, 0.0, sectors
            if out < blurred:
                turn = (atan2(y, x) / (2.0 * pi) + 1.0) * sectors
                share = turn - int(turn)
                k = int(turn) % sectors
                light[0], light[2] = p[PLAIN] - behind, p[FACE]
                for c in range(knots):
                    end = pattern[(k + 1) % sectors, c]
                    light[SHADES + c] = (1.0 - share) * pattern[k, c] + share * end
                mean, outline = _fill(x, y, behind, p, rim, light, row)
                for c in range(COUNT, COUNT + knots):
                    row[c + knots] = share * row[c]
                    row[c] *= 1.0 - share
            clear = 1.0 - row[PLAIN]
            row[LEVEL] = clear * back[i, j]
            row[SLOPE_X], row[SLOPE_Y] = clear * slope_x, clear * slope_y
            row[n - 1] = region[i, j] - mean
            weight = _weigh(region[i, j], mean, row[PLAIN], outline, first, noise, tally)
            own = sums[k]
            for a in range(n):
                part = weight * row[a]
                if part != 0.0:
                    for b in range(n):
                        own[a, b] += part * row[b]
    return tally
