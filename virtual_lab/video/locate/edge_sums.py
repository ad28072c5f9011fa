"""Sums over the pixels about a ball's outline that the edge fit asks for."""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.rim_profiles import FIRST, PER, SHADES

__all__ = [
    "BLACK",
    "COUNT",
    "OPTIONS",
    "OUTSIDE",
    "TALLY",
    "TOP",
    "Equations",
    "Rim",
    "View",
    "gather",
    "untold",
    "variance",
]

OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "cache": True,
    "nogil": True,
    "fastmath": True,
}
GAIN, READ, BLACK, PRNU, TOP = range(5)  # of `Noise.figures`


Floats = NDArray[np.float64]

# parameters that all sectors share: centre, radius, the outline's oval (cos 2a, sin 2a),
# background as in the occlusion model, and the ball's shading: a level and how brightness rises
# with the surface's normal along x, along y and toward the camera
COUNT = 12
X, Y, RADIUS, OVAL_C, OVAL_S, LEVEL, SLOPE_X, SLOPE_Y, PLAIN, SIDE_X, SIDE_Y, FACE = range(COUNT)
TALLY = 7
CHI, PIXELS, NEAR, AROUND, SEEN, FULL, STRAY = range(TALLY)
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


@njit(inline="always", **OPTIONS)
def variance(mean: float, noise: Floats) -> float:
    """Return a pixel's variance [DN²]."""
    light = max(mean - noise[BLACK], 0.0)
    odd = noise[PRNU] * noise[PRNU] * light
    return float(noise[READ] + light * (noise[GAIN] + odd))


@njit(inline="always", **OPTIONS)
def untold(value: float, mean: float, spread: float, top: float) -> bool:
    """Return whether full scale hides what a pixel of variance `spread` would have said."""
    room = top - mean
    return room * room < 9.0 * spread or (room < 0.0 and value >= top)


class Rim(NamedTuple):
    """How a ball's rim looks: what `rim_profiles` knows of it, and how it is blurred."""

    table: Floats  # (entry, 2 column)
    stiffness: Floats  # (knot, knot)
    hides: Floats  # (knot,) [pixel]
    width: float  # standard deviation of lens and pixel [pixel]
    inside: float  # pixels of the ball that are looked at
    way: Floats  # (2,) the ball's shift during the exposure [pixel]


class Equations(NamedTuple):
    """Normal equations as `edge_kernel.eliminate` has them."""

    blocks: Floats
    links: Floats
    border: Floats
    shared: Floats


class Columns(NamedTuple):
    """Room for what one pixel adds."""

    values: Floats  # the table's columns over the way, then the shading's by x and y
    local: Floats  # (knot,) the pattern at the pixel
    slopes: Floats  # (COUNT + 1,) derivatives of the pixel's mean, and what is left of it


@njit(**OPTIONS)
def _profile(x: float, y: float, behind: float, p: Floats, rim: Rim, own: Columns) -> float:
    """Fill a pixel's columns and its mean's derivatives by the outline; return its outline.

    `values`: the table's columns over the way, the second's twice: by the normal's x and y at
    the end. (x, y) is from the centre at mid exposure.
    """
    table, way, s = rim.table, rim.way, rim.width
    values, local, slopes = own.values, own.local, own.slopes
    columns = table.shape[1] // 2
    values[:], slopes[:] = 0.0, 0.0
    r = sqrt(x * x + y * y)
    change = abs(way[0] * x + way[1] * y) / r
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    change = max(change, along * along / (4.0 * p[RADIUS]))
    count = min(MOST, int(0.9 * change / s) + 2) if along > 0.0 else 1
    outline, bend = 0.0, 0.5 * s / p[RADIUS]
    for k in range(count):
        place, weight = 0.5 * NODES[count, k, 0], 0.5 * NODES[count, k, 1]
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
        for c in range(columns):
            values[c] += low * table[i, c] + high * table[i + 1, c]
        sideways = low * table[i, 1] + high * table[i + 1, 1]
        values[columns] += u * sideways
        values[columns + 1] += v * sideways
        step = low * table[i, columns] + high * table[i + 1, columns]
        outline += step
        rise = (p[PLAIN] - behind) * step
        sideways = low * table[i, columns + 1] + high * table[i + 1, columns + 1]
        rise += (p[SIDE_X] * u + p[SIDE_Y] * v) * sideways
        rise += p[FACE] * (low * table[i, columns + 2] + high * table[i + 1, columns + 2])
        for j in range(local.size):
            c = columns + SHADES + j
            rise += local[j] * (low * table[i, c] + high * table[i + 1, c])
        rise /= s
        slopes[X] += rise * u
        slopes[Y] += rise * v
        slopes[RADIUS] += rise
        slopes[OVAL_C] += rise * p[RADIUS] * cos2
        slopes[OVAL_S] += rise * p[RADIUS] * sin2
    return outline / s


@njit(**OPTIONS)
def _add(
    weight: float,
    left: float,
    own: Columns,
    k: int,
    share: float,
    sums: Equations,
) -> None:
    """Add a pixel's part to the normal equations, a `share` of its pattern to the next sector."""
    blocks, links, border, shared = sums
    j, knots = own.slopes, own.local.size
    hats = own.values[SHADES : SHADES + knots]
    j[COUNT] = left
    first, last = (0, COUNT) if k >= 0 else (LEVEL, PLAIN)
    for a in range(first, last):
        part = weight * j[a]
        row = shared[knots + a]
        for b in range(COUNT + 1):
            row[knots + b] += part * j[b]
    if k < 0:
        return
    other = (k + 1) % blocks.shape[0]
    for i in range(knots):
        one = weight * hats[i]
        here, there = one * (1.0 - share), one * share
        row, next_row = border[k, i], border[other, i]
        for a in range(COUNT + 1):
            row[knots + a] += here * j[a]
        for a in range(COUNT + 1):
            next_row[knots + a] += there * j[a]
        own, next_own, link = here * (1.0 - share), there * share, here * share
        block, next_block, bond = blocks[k, i], blocks[other, i], links[k, i]
        for b in range(knots):
            block[b] += own * hats[b]
            next_block[b] += next_own * hats[b]
            bond[b] += link * hats[b]


@njit(**OPTIONS)
def _ball(
    x: float, y: float, behind: float, p: Floats, pattern: Floats, rim: Rim, own: Columns
) -> tuple[float, float, int, float]:
    """Return mean, share of the outline, sector and place in it of a pixel; fill derivatives."""
    values, local, j = own
    sectors, knots = pattern.shape
    columns = rim.table.shape[1] // 2
    turn = (atan2(y, x) / (2.0 * pi) + 1.0) * sectors
    k = int(turn)
    share = turn - k
    k %= sectors
    for i in range(knots):
        local[i] = (1.0 - share) * pattern[k, i] + share * pattern[(k + 1) % sectors, i]
    outline = _profile(x, y, behind, p, rim, own)
    j[PLAIN], j[FACE] = values[0], values[2]
    j[SIDE_X], j[SIDE_Y] = values[columns], values[columns + 1]
    mu = behind * (1.0 - values[0])
    for a in range(PLAIN, COUNT):
        mu += p[a] * j[a]
    for i in range(knots):
        mu += local[i] * values[SHADES + i]
    return mu, outline, k, share


@njit(**OPTIONS)
def _weigh(
    value: float,
    mu: float,
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
    mean = value if first else mu
    v = variance(mean, noise)
    tally[SEEN] += outline
    if untold(value, mean, v, noise[TOP]):
        tally[FULL] += outline
        return 0.0
    misfit = (value - mu) * (value - mu) / v
    known = min(misfit, ODD)
    tally[CHI] += known
    tally[PIXELS] += 1.0
    tally[STRAY] += misfit > ODD
    if outline > 0.02:
        tally[NEAR] += known
        tally[AROUND] += 1.0
    elif misfit > ODD and ball < 0.02:
        return 0.0
    loose = 1.0 if first else min(1.0, LOOSE / sqrt(misfit + 1e-30))
    return float(loose / v)


@njit(**OPTIONS)
def gather(
    view: View,
    rim: Rim,
    noise: Floats,
    p: Floats,
    pattern: Floats,
    settling: bool,
    sums: Equations,
    tally: Floats,
) -> None:
    """Add up the normal equations of one region.

    `settling`: the model is not yet one whose means could show the pixels' noise, and some of the
    rows do.
    """
    blocks, links, border, shared = sums
    blocks[:], links[:], border[:], shared[:], tally[:] = 0.0, 0.0, 0.0, 0.0, 0.0
    region, back, way, s, inside = view.pixels, view.background, rim.way, rim.width, rim.inside
    rows, cols = region.shape
    knots, columns = pattern.shape[1], rim.table.shape[1] // 2
    own = Columns(np.zeros(columns + 2), np.empty(knots), np.zeros(COUNT + 1))
    values, _, j = own
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    oval = p[RADIUS] * (abs(p[OVAL_C]) + abs(p[OVAL_S]))
    least = max(p[RADIUS] - 0.5 * along - inside - oval, 1.0)
    most = p[RADIUS] + 0.5 * along + REACH * s + OUTSIDE + oval
    stride = COARSE if settling else 1
    for row in range(max(0, int(p[Y] - most)), min(rows, int(p[Y] + most) + 2), stride):
        y, slope_y = row - p[Y], (row - 0.5 * rows) * 2.0 / cols
        rest = sqrt(max(most * most - y * y, 0.0))
        for col in range(max(0, int(p[X] - rest) + 1), min(cols, int(p[X] + rest) + 1)):
            x, slope_x = col - p[X], (col - 0.5 * cols) * 2.0 / cols
            r = x * x + y * y
            if r < least * least:
                continue
            r = sqrt(r)
            half = 0.5 * abs(way[0] * x + way[1] * y) / r
            out = r - p[RADIUS] - half
            if out < -(2.0 * half + inside + oval) or out > REACH * s + OUTSIDE + oval:
                continue
            behind = p[LEVEL] * back[row, col] + p[SLOPE_X] * slope_x + p[SLOPE_Y] * slope_y
            mu, outline, k, share = behind, 0.0, -1, 0.0
            j[:], values[0] = 0.0, 0.0
            if out < REACH * s + oval:
                mu, outline, k, share = _ball(x, y, behind, p, pattern, rim, own)
            clear = 1.0 - values[0]
            j[LEVEL] = clear * back[row, col]
            j[SLOPE_X], j[SLOPE_Y] = clear * slope_x, clear * slope_y
            weight = _weigh(region[row, col], mu, values[0], outline, settling, noise, tally)
            _add(weight, region[row, col] - mu, own, k, share, sums)
