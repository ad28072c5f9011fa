"""Sums over the pixels near a ball's outline, for the edge fit."""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from virtual_lab.units import INNER, Array
from virtual_lab.video.locate.rim_profiles import AT, SHADES, TABLE, TALLY, Profiles

Noises = tuple[float, float, float, float, float]  # `Noise.figures`
FAST: dict[str, Any] = {"error_model": "numpy", "fastmath": True}
NODES = np.zeros((33, 32, 2))  # nodes and weights of Gauss-Legendre rules, by number of nodes
for _n in range(1, len(NODES)):
    NODES[_n, :_n] = np.stack(np.polynomial.legendre.leggauss(_n), axis=1)


class Summing(NamedTuple):
    """Settings of the sums over pixels near an outline, and of their weights."""

    coarse_rows: int = 3  # spacing of the rows used until the fit has converged
    outside_px: float = 4.0  # width of the background used beyond the edge
    # residual beyond which a pixel has less weight and is counted as an outlier
    loose_sigmas: float = 5.0


SUM = Summing()


class View(NamedTuple):
    """A region, (row, column), and the motion of its ball."""

    pixels: Array  # [DN]
    background: Array  # [DN]
    way: Array  # (2,), shift of the ball during the exposure [pixel]


@njit(**INNER, **FAST)
def _fill(
    x: float, y: float, behind: float, p: Array, way: Array, rim: Profiles, light: Array, row: Array
) -> tuple[float, float]:
    """Fill `row` with the derivatives of a pixel by outline, shading and pattern.

    Return the expected gray value, and the share of the outline in the pixel. (x, y) is measured
    from the center at mid exposure, and `light` is the brightness for each column of the table.
    """
    table, s = rim.table, rim.width
    columns = light.size
    r = sqrt(x * x + y * y)
    change = abs(way[0] * x + way[1] * y) / r
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    change = max(change, along * along / (4.0 * p[AT.radius]))
    count = min(NODES.shape[1], int(0.9 * change / s) + 2) if along > 0.0 else 1
    mean, outline, bend = behind, 0.0, 0.5 * s / p[AT.radius]
    for n in range(count):
        place, weight = 0.5 * NODES[count, n, 0], 0.5 * NODES[count, n, 1]
        u, v = x - place * way[0], y - place * way[1]
        r = sqrt(u * u + v * v)
        u, v = u / r, v / r
        cos2, sin2 = u * u - v * v, 2.0 * u * v
        edge = p[AT.radius] * (1.0 + p[AT.oval_c] * cos2 + p[AT.oval_s] * sin2)
        entry = ((edge - r) / s - bend + TABLE.widths) * TABLE.per_width
        if entry <= 0.0:
            continue
        i = min(int(entry), table.shape[0] - 2)
        part = min(entry - i, 1.0)
        low, high = weight * (1.0 - part), weight * part
        light[1] = p[AT.side_x] * u + p[AT.side_y] * v
        rise = 0.0
        for c in range(columns):
            value = low * table[i, c] + high * table[i + 1, c]
            mean += light[c] * value
            rise += light[c] * (low * table[i, columns + c] + high * table[i + 1, columns + c])
            if c == 1:
                row[AT.side_x] += u * value
                row[AT.side_y] += v * value
            else:
                row[AT.plain if c == 0 else len(AT) + c - SHADES] += value
        outline += low * table[i, columns] + high * table[i + 1, columns]
        rise /= s
        row[AT.x] += rise * u
        row[AT.y] += rise * v
        row[AT.radius] += rise
        row[AT.oval_c] += rise * p[AT.radius] * cos2
        row[AT.oval_s] += rise * p[AT.radius] * sin2
    return mean, outline / s


@njit(**INNER, **FAST)
def _weigh(
    value: float, mean: float, ball: float, edge: float, first: bool, noise: Noises, tally: Array
) -> float:
    """Return the weight of a pixel, and add the pixel to the tally.

    The weight is 0 if the pixel is at full scale, and if the background has moved, such as a bat
    that recoils. `ball` and `edge` are the shares of ball and outline in the pixel.
    """
    gain, read, black, prnu, top = noise
    light = max((value if first else mean) - black, 0.0)
    v = read + light * (gain + prnu * prnu * light)
    tally[TALLY.seen] += edge
    room = top - (value if first else mean)
    if room * room < 9.0 * v or (room < 0.0 and value >= top):
        tally[TALLY.full] += edge
        return 0.0
    misfit = (value - mean) * (value - mean) / v
    tally[TALLY.pixels] += 1.0
    tally[TALLY.stray] += misfit > SUM.loose_sigmas * SUM.loose_sigmas
    if edge > 0.02:
        tally[TALLY.near] += min(misfit, SUM.loose_sigmas * SUM.loose_sigmas)
        tally[TALLY.around] += 1.0
    elif misfit > SUM.loose_sigmas * SUM.loose_sigmas and ball < 0.02:
        return 0.0
    return float((1.0 if first else min(1.0, SUM.loose_sigmas / sqrt(misfit + 1e-30))) / v)


@njit(**FAST, cache=True, nogil=True)
def sector_sums(
    view: View, rim: Profiles, noise: Noises, p: Array, pattern: Array, first: bool, sums: Array
) -> Array:
    """Fill `sums` with the normal equations of a region, and return counts of its pixels.

    The returned array has the counts and a few sums over the pixels, in the order of `TALLY`.

    Parameters
    ----------
    p
        Parameters shared by all sectors, in the order of `AT`.
    pattern
        Brightness of the pattern at the beginning of each sector of the rim, (sector, knot).
    first
        Whether this is the first evaluation, with an inaccurate model. The noise is then computed
        from the gray values of the pixels instead of the model, and only every
        `SUM.coarse_rows`-th row of pixels is used.
    sums
        Overwritten with one set of equations per sector, (sector + 1, n, n). The last set is for
        pixels off the rim.

        A set is a weighted sum over the pixels of the sector. For each pixel, the products of all
        pairs of these n numbers are added:

        * the derivatives of its gray value with respect to the shared parameters
        * the derivatives with respect to the knots of the pattern at the beginning of the sector
        * the derivatives with respect to the knots at the end of the sector
        * the residual of the gray value
    """
    region, back, way = view
    rows, cols = region.shape
    sectors, knots = pattern.shape
    n = len(AT) + 2 * knots + 1
    sums[:] = 0.0
    tally, row, light = np.zeros(len(TALLY)), np.empty(n), np.empty(SHADES + knots)
    along = sqrt(way[0] * way[0] + way[1] * way[1])
    oval = p[AT.radius] * (abs(p[AT.oval_c]) + abs(p[AT.oval_s]))
    blurred = TABLE.widths * rim.width + oval
    most = p[AT.radius] + 0.5 * along + blurred + SUM.outside_px
    top, low = max(0, int(p[AT.y] - most)), min(rows, int(p[AT.y] + most) + 2)
    for i in range(top, low, SUM.coarse_rows if first else 1):
        y, slope_y = i - p[AT.y], (i - 0.5 * rows) * 2.0 / cols
        rest = sqrt(max(most * most - y * y, 0.0))
        for j in range(max(0, int(p[AT.x] - rest) + 1), min(cols, int(p[AT.x] + rest) + 1)):
            x, slope_x = j - p[AT.x], (j - 0.5 * cols) * 2.0 / cols
            r = sqrt(x * x + y * y)
            half = 0.5 * abs(way[0] * x + way[1] * y) / max(r, 1e-9)
            out = r - p[AT.radius] - half
            if r < 1.0 or out < -(2.0 * half + rim.inside + oval) or out > blurred + SUM.outside_px:
                continue
            behind = p[AT.level] * back[i, j] + p[AT.slope_x] * slope_x + p[AT.slope_y] * slope_y
            row[:] = 0.0
            mean, outline, k = behind, 0.0, sectors
            if out < blurred:
                turn = (atan2(y, x) / (2.0 * pi) + 1.0) * sectors
                share = turn - int(turn)
                k = int(turn) % sectors
                light[0], light[2] = p[AT.plain] - behind, p[AT.face]
                for c in range(knots):
                    end = pattern[(k + 1) % sectors, c]
                    light[SHADES + c] = (1.0 - share) * pattern[k, c] + share * end
                mean, outline = _fill(x, y, behind, p, way, rim, light, row)
                for c in range(len(AT), len(AT) + knots):
                    row[c + knots] = share * row[c]
                    row[c] *= 1.0 - share
            clear = 1.0 - row[AT.plain]
            row[AT.level] = clear * back[i, j]
            row[AT.slope_x], row[AT.slope_y] = clear * slope_x, clear * slope_y
            row[n - 1] = region[i, j] - mean
            weight = _weigh(region[i, j], mean, row[AT.plain], outline, first, noise, tally)
            own = sums[k]
            for a in range(n):
                part = weight * row[a]
                if part != 0.0:
                    for b in range(n):
                        own[a, b] += part * row[b]
    return tally
