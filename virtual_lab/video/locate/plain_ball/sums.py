"""Sums over the pixels of a region that the occlusion model's fit asks for.

Only near the outline does a pixel tell of more than a level, so a row is taken in parts:
background, outline, ball, outline, background.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.plain_ball.disc import FINE, REACH, share

__all__ = ["COUNT", "STATE", "TALLY", "gather"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Frame = tuple[float, float, float, float, float, float]
Parts = NDArray[np.int64]

# parameters of a fit: centre, radius, way during the exposure, edge's width, the ball's level,
# background (a factor of the picture given, or a level) and its slope
COUNT = 10
X, Y, RADIUS, WAY_X, WAY_Y, WIDTH, BALL, LEVEL, SLOPE_X, SLOPE_Y = range(COUNT)
PADDED = 12  # sums of this length go by whole vectors
# what else is said of a fit: chi^2 of all pixels and of the outline's; shares of the outline seen,
# at full scale, masked; share of pixels that fit nothing; steps; whether the fit settled
STATE = 8
CHI, NEAR, SEEN, FULL, HIDDEN, STRAY, STEPS, SETTLED = range(STATE)
TALLY, FAR = 9, 8  # sums on the way to those: pixels for STEPS, the outline's for SETTLED

GAIN, READ, BLACK, PRNU, TOP = range(5)  # of the noise
SECTORS = 16
CUT = 25.0  # squares of a residual's sigma beyond which a pixel is no part of the picture


@njit(inline="always", **FINE)
def variance(mu: float, noise: Floats) -> tuple[float, float]:
    """Return a pixel's variance and the variance's derivative."""
    light = max(mu - noise[BLACK], 0.0)
    odd = noise[PRNU] * noise[PRNU] * light
    return noise[READ] + light * (noise[GAIN] + odd), noise[GAIN] + 2.0 * odd


@njit(inline="always", **FINE)
def untold(value: float, mu: float, v: float, top: float) -> bool:
    """Return whether full scale hides what a pixel would have said."""
    room = top - mu
    return room * room < 9.0 * v or (room < 0.0 and value >= top)


@njit(**FINE)
def _frame(p: Floats, wide: float) -> Frame:
    """Return way, its direction, width, and where the outline's pixels begin and end."""
    along, cos, sin = sqrt(p[WAY_X] * p[WAY_X] + p[WAY_Y] * p[WAY_Y]), 1.0, 0.0
    if along > 1e-9:
        cos, sin = p[WAY_X] / along, p[WAY_Y] / along
    s = p[WIDTH] + wide
    inside = max(p[RADIUS] - 0.5 * along - REACH * s, 0.0)
    return along, cos, sin, s, inside, p[RADIUS] + 0.5 * along + REACH * s


@njit(inline="always", **FINE)
def _pixel(
    x: float,
    y: float,
    behind: float,
    slope_x: float,
    slope_y: float,
    p: Floats,
    frame: Frame,
    j: Floats,
) -> tuple[float, float]:
    """Return mean and share of the outline of a pixel (x, y) from the centre; fill derivatives."""
    along, cos, sin, s, _, _ = frame
    b = p[LEVEL] * behind + p[SLOPE_X] * slope_x + p[SLOPE_Y] * slope_y
    rise = p[BALL] - b
    m, jx, jy, outline, jwx, jwy, jw = share(x, y, p[RADIUS], along, cos, sin, s)
    j[X], j[Y], j[RADIUS] = rise * jx, rise * jy, rise * outline
    j[WAY_X], j[WAY_Y], j[WIDTH] = rise * jwx, rise * jwy, rise * jw
    j[BALL], j[LEVEL] = m, (1.0 - m) * behind
    j[SLOPE_X], j[SLOPE_Y] = (1.0 - m) * slope_x, (1.0 - m) * slope_y
    return b + rise * m, outline


@njit(inline="always", **FINE)
def _add(h: Floats, j: Floats, weight: float) -> None:
    for a in range(COUNT):
        scaled = weight * j[a]
        for k in range(PADDED):
            h[a, k] += scaled * j[k]


@njit(inline="always", **FINE)
def _parts(p: Floats, y: float, frame: Frame, margin: float, cols: int) -> Parts:
    """Return where a row's pixels begin that are used, are outline, are ball, and are no more."""
    ends = np.empty(6, np.int64)
    reaches = (frame[5] + margin, frame[5], frame[4])
    for k in range(3):
        rest = reaches[k] * reaches[k] - y * y
        middle = min(max(int(p[X]), 0), cols)
        ends[k] = ends[5 - k] = middle
        if rest > 0.0:
            rest = sqrt(rest)
            ends[k] = min(max(int(p[X] - rest) + 1, 0), cols)
            ends[5 - k] = min(max(int(p[X] + rest) + 1, ends[k]), cols)
    return ends


@njit(**FINE)
def _run(
    values: Floats,
    use: Bytes,
    back: Floats,
    span: tuple[int, int, int],
    ball: bool,
    p: Floats,
    slope_y: float,
    noise: Floats,
    cut: float,
    fisher: bool,
    h: Floats,
    g: Floats,
    tally: Floats,
) -> None:
    """Add a row's pixels from first to last that are all ball, or all background."""
    scale = 2.0 / values.size
    square = plain = cross = once = across = weights = 0.0
    left_back = left_across = left_all = total = count = loose = stray = 0.0
    for col in range(span[0], span[1], span[2]):
        if use[col] == 0:
            continue
        slope_x, behind = (col - 0.5 * values.size) * scale, back[col]
        mu = p[LEVEL] * behind + p[SLOPE_X] * slope_x + p[SLOPE_Y] * slope_y
        mu = p[BALL] if ball else mu
        v, change = variance(mu, noise)
        if untold(values[col], mu, v, noise[TOP]):
            continue
        left, weight = values[col] - mu, 1.0 / v
        misfit = left * left * weight
        if misfit > cut:
            stray += 1.0
            continue
        total += misfit
        count += 1.0
        loose += misfit > CUT
        left *= weight
        weight += 0.5 * (change * weight) ** 2 if fisher else 0.0
        weights += weight
        left_all += left
        once += weight * behind
        across += weight * slope_x
        square += weight * behind * behind
        cross += weight * behind * slope_x
        plain += weight * slope_x * slope_x
        left_back += left * behind
        left_across += left * slope_x
    tally[CHI] += total
    tally[STEPS] += count
    tally[FAR] += loose
    tally[STRAY] += stray
    if ball:
        h[BALL, BALL] += weights
        g[BALL] += left_all
        return
    h[LEVEL, LEVEL] += square
    h[SLOPE_X, LEVEL] += cross
    h[SLOPE_X, SLOPE_X] += plain
    h[SLOPE_Y, LEVEL] += once * slope_y
    h[SLOPE_Y, SLOPE_X] += across * slope_y
    h[SLOPE_Y, SLOPE_Y] += weights * slope_y * slope_y
    g[LEVEL] += left_back
    g[SLOPE_X] += left_across
    g[SLOPE_Y] += left_all * slope_y


@njit(**FINE)
def _edge(
    values: Floats,
    use: Bytes,
    back: Floats,
    span: tuple[int, int, int],
    y: float,
    slope_y: float,
    p: Floats,
    frame: Frame,
    noise: Floats,
    cut: float,
    h: Floats,
    g: Floats,
    scores: Floats,
    tally: Floats,
) -> None:
    """Add a row's pixels from first to last that the outline may cross."""
    judging = scores.shape[0] > 1
    j, scale = np.zeros(PADDED), 2.0 / values.size
    for col in range(span[0], span[1], span[2]):
        x = col - p[X]
        slope_x = (col - 0.5 * values.size) * scale
        mu, outline = _pixel(x, y, back[col], slope_x, slope_y, p, frame, j)
        if use[col] == 0:
            tally[HIDDEN] += outline
            continue
        v, change = variance(mu, noise)
        tally[SEEN] += outline
        if untold(values[col], mu, v, noise[TOP]):
            tally[FULL] += outline
            continue
        left, weight = values[col] - mu, 1.0 / v
        misfit = left * left * weight
        if judging:
            _add(h, j, weight + 0.5 * (change * weight) ** 2)
        if misfit > cut:
            tally[STRAY] += 1.0
            continue
        tally[CHI] += misfit
        tally[STEPS] += 1.0
        tally[FAR] += misfit > CUT
        left *= weight
        sector = 0
        if judging:
            tally[NEAR] += misfit * (outline > 0.02)
            tally[SETTLED] += outline > 0.02
            turn = y / (abs(x) + abs(y) + 1e-9)
            turn = (1.0 - turn if x > 0.0 else 3.0 + turn) * 0.25 * SECTORS
            sector = int(turn) % SECTORS
        else:
            _add(h, j, weight)
        for a in range(COUNT):
            scores[sector, a] += left * j[a]


@njit(**FINE)
def gather(
    region: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    noise: Floats,
    look: tuple[float, float, int, float],
    h: Floats,
    g: Floats,
    scores: Floats,
    tally: Floats,
) -> None:
    """Add up the normal equations of all parameters, and tally the pixels.

    `look`: what widens the edge, pixels around the ball, stride, square of sigma to cut at. With
    room for more than one row of scores, those of each sector are kept apart and h is Fisher's
    information.
    """
    wide, margin, stride, cut = look
    h[:], g[:], scores[:], tally[:] = 0.0, 0.0, 0.0, 0.0
    rows, cols = region.shape
    frame, judging = _frame(p, wide), scores.shape[0] > 1
    for row in range(0, rows, stride):
        y, slope_y = row - p[Y], (row - 0.5 * rows) * 2.0 / cols
        ends = _parts(p, y, frame, margin, cols)
        for part in range(5):
            values, mine, behind = region[row], use[row], back[row]
            span = (ends[part] + -ends[part] % stride, ends[part + 1], stride)
            if part in (1, 3):
                _edge(
                    values,
                    mine,
                    behind,
                    span,
                    y,
                    slope_y,
                    p,
                    frame,
                    noise,
                    cut,
                    h,
                    g,
                    scores,
                    tally,
                )
            elif span[1] > span[0]:
                ball = part == 2
                _run(values, mine, behind, span, ball, p, slope_y, noise, cut, judging, h, g, tally)
    for sector in range(scores.shape[0]):
        for a in range(COUNT):
            g[a] += scores[sector, a]
