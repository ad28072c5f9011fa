"""Sums over the pixels about a ball's outline that the edge fit asks for."""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.plain_ball.disc import FINE, MOST, NODES, REACH
from virtual_lab.video.locate.plain_ball.sums import TOP, untold, variance
from virtual_lab.video.locate.stitched_ball.profiles import FIRST, PER, SHADES

__all__ = ["COUNT", "OUTSIDE", "TALLY", "gather"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

# parameters that all sectors share: centre, radius, the outline's oval (cos 2a, sin 2a),
# background as in the occlusion model, and the ball's shading: a level and how brightness rises
# with the surface's normal along x, along y and toward the camera
COUNT = 12
X, Y, RADIUS, OVAL_C, OVAL_S, LEVEL, SLOPE_X, SLOPE_Y, PLAIN, SIDE_X, SIDE_Y, FACE = range(COUNT)
TALLY = 8
CHI, PIXELS, NEAR, AROUND, SEEN, HIDDEN, FULL, STRAY = range(TALLY)
OUTSIDE = 4.0  # pixels of background beyond the edge
LOOSE = 5.0  # sigmas beyond which a residual weighs less
ODD = 36.0  # squares of sigmas: such a pixel fits nothing


@njit(**FINE)
def _profile(
    x: float,
    y: float,
    p: Floats,
    way: Floats,
    s: float,
    table: Floats,
    local: Floats,
    behind: float,
    values: Floats,
    slopes: Floats,
) -> float:
    """Fill a pixel's columns and its mean's derivatives by the outline; return its outline.

    `values`: the table's columns over the way, the second's twice: by the normal's x and y at
    the end. (x, y) is from the centre at mid exposure.
    """
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


@njit(inline="always", **FINE)
def _add(
    weight: float,
    left: float,
    j: Floats,
    hats: Floats,
    k: int,
    share: float,
    blocks: Floats,
    links: Floats,
    border: Floats,
    shared: Floats,
) -> None:
    """Add a pixel's part to the normal equations, a `share` of its pattern to the next sector."""
    knots = hats.size
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


@njit(inline="always", **FINE)
def _ball(
    x: float,
    y: float,
    behind: float,
    p: Floats,
    pattern: Floats,
    way: Floats,
    s: float,
    table: Floats,
    values: Floats,
    local: Floats,
    j: Floats,
) -> tuple[float, float, int, float]:
    """Return mean, share of the outline, sector and place in it of a pixel; fill derivatives."""
    sectors, knots = pattern.shape
    columns = table.shape[1] // 2
    turn = (atan2(y, x) / (2.0 * pi) + 1.0) * sectors
    k = int(turn)
    share = turn - k
    k %= sectors
    for i in range(knots):
        local[i] = (1.0 - share) * pattern[k, i] + share * pattern[(k + 1) % sectors, i]
    outline = _profile(x, y, p, way, s, table, local, behind, values, j)
    j[PLAIN], j[FACE] = values[0], values[2]
    j[SIDE_X], j[SIDE_Y] = values[columns], values[columns + 1]
    mu = behind * (1.0 - values[0])
    for a in range(PLAIN, COUNT):
        mu += p[a] * j[a]
    for i in range(knots):
        mu += local[i] * values[SHADES + i]
    return mu, outline, k, share


@njit(inline="always", **FINE)
def _weigh(
    value: float, mu: float, outline: float, first: bool, noise: Floats, tally: Floats
) -> float:
    """Return a pixel's weight, 0 where full scale hides what it would have said; tally it."""
    mean = value if first else mu
    v = variance(mean, noise)[0]
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
    loose = 1.0 if first else min(1.0, LOOSE / sqrt(misfit + 1e-30))
    return float(loose / v)


@njit(**FINE)
def gather(
    region: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    pattern: Floats,
    way: Floats,
    s: float,
    inside: float,
    table: Floats,
    noise: Floats,
    first: bool,
    stride: int,
    blocks: Floats,
    links: Floats,
    border: Floats,
    shared: Floats,
    tally: Floats,
) -> None:
    """Add up the normal equations; see `solve.eliminate` for their parts.

    `inside`: pixels of the ball that are looked at; `first`: there is no model yet whose means
    could tell the pixels' noise; `stride`: from one row that is taken to the next.
    """
    blocks[:], links[:], border[:], shared[:], tally[:] = 0.0, 0.0, 0.0, 0.0, 0.0
    rows, cols = region.shape
    knots, columns = pattern.shape[1], table.shape[1] // 2
    values, local, j = np.zeros(columns + 2), np.empty(knots), np.zeros(COUNT + 1)
    hats = values[SHADES:columns]
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    oval = p[RADIUS] * (abs(p[OVAL_C]) + abs(p[OVAL_S]))
    least = max(p[RADIUS] - 0.5 * along - inside - oval, 1.0)
    most = p[RADIUS] + 0.5 * along + REACH * s + OUTSIDE + oval
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
                mu, outline, k, share = _ball(
                    x, y, behind, p, pattern, way, s, table, values, local, j
                )
            if use[row, col] == 0:
                tally[HIDDEN] += outline
                continue
            clear = 1.0 - values[0]
            j[LEVEL] = clear * back[row, col]
            j[SLOPE_X], j[SLOPE_Y] = clear * slope_x, clear * slope_y
            weight = _weigh(region[row, col], mu, outline, first, noise, tally)
            left = region[row, col] - mu
            _add(weight, left, j, hats, k, share, blocks, links, border, shared)
