"""The occlusion model fitted to one region after another, by Gauss-Newton.

An opaque ball hides what lies behind it: mu = b (1 - m) + B m, with m the pixel's share of the
ball, b the background and B the ball's level. A fit starts with a wide edge on a few pixels,
which finds a ball from some pixels away, and ends on all.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.plain_ball.disc import FINE
from virtual_lab.video.locate.plain_ball.normal import put, solve, weigh_in
from virtual_lab.video.locate.plain_ball.sums import (
    BALL,
    CHI,
    COUNT,
    CUT,
    FAR,
    FULL,
    HIDDEN,
    LEVEL,
    NEAR,
    PADDED,
    RADIUS,
    SECTORS,
    SEEN,
    SETTLED,
    SLOPE_X,
    SLOPE_Y,
    STEPS,
    STRAY,
    TALLY,
    TOP,
    WAY_X,
    WAY_Y,
    WIDTH,
    X,
    Y,
    gather,
)

__all__ = ["judge", "refine"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Indices = NDArray[np.int64]

LEVELS = np.array([BALL, LEVEL, SLOPE_X, SLOPE_Y])
SHARP = np.array([X, Y, RADIUS, BALL, LEVEL, SLOPE_X, SLOPE_Y])
MOST_STEPS = 25
NARROWEST, WIDEST = 0.3, 6.0  # pixels, of an edge
ALIKE = 3.0  # times the variance noise explains: what sectors say of the centre is rarely more
COARSE = 3  # pixels, from one to the next of a first look


@njit(**FINE)
def _step(p: Floats, step: Floats, free: Indices) -> None:
    """Go a step, not so far that the ball is lost."""
    reach = 0.3 * p[RADIUS] + 0.5
    most = 1.0
    for a in range(free.size):
        if free[a] <= RADIUS:
            most = min(most, reach / max(abs(step[a]), 1e-30))
    bound = 1.0 + 0.3 * sqrt(p[WAY_X] ** 2 + p[WAY_Y] ** 2)
    for a in range(free.size):
        k = free[a]
        change = most * step[a]
        if k in (WAY_X, WAY_Y):
            change = min(max(change, -bound), bound)
        if k == WIDTH:
            change = min(max(change, -0.3 * p[k]), 0.5 * p[k])
        p[k] += change
    p[WIDTH] = min(max(p[WIDTH], NARROWEST), WIDEST)
    p[RADIUS] = max(p[RADIUS], 1.0)


@njit(**FINE)
def _levels(
    region: Floats, use: Bytes, back: Floats, p: Floats, noise: Floats, wide: float, margin: float
) -> bool:
    """Set the levels, which have no start."""
    h, g = np.empty((COUNT, PADDED)), np.empty(COUNT)
    found, inverse = np.empty(LEVELS.size), np.empty((LEVELS.size, LEVELS.size))
    gather(
        region, use, back, p, noise, (wide, margin, COARSE, np.inf), h, g, h[:1], np.empty(TALLY)
    )
    if not solve(h, g, LEVELS, found, inverse):
        return False
    for a in range(LEVELS.size):
        p[LEVELS[a]] += found[a]
    return True


@njit(**FINE)
def fit(
    region: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    prior: Floats,
    free: Indices,
    noise: Floats,
    wide: float,
    margin: float,
    state: Floats,
) -> None:
    """Fit one region; p is the start and becomes the solution."""
    h, g = np.empty((COUNT, PADDED)), np.empty(COUNT)
    inverse, step = np.empty((COUNT, COUNT)), np.empty(COUNT)
    p0, radius = p.copy(), p[RADIUS]
    scores, tally = np.empty((1, COUNT)), np.empty(TALLY)
    endless = noise.copy()  # a first look takes full scale for a grey value like any other
    endless[TOP] = np.inf
    if not _levels(region, use, back, p, endless, wide, margin):
        return
    chi, stride = np.inf, COARSE
    for turn in range(MOST_STEPS):
        cut = CUT * max(1.0, chi)
        look = (wide, margin, stride, cut)
        gather(region, use, back, p, endless if wide > 0.0 else noise, look, h, g, scores, tally)
        count, loose = tally[STEPS], tally[FAR]
        chi = tally[CHI] / max(count, 1.0)
        some = SHARP if wide > 0.0 else free  # a wide edge says nothing of blurs
        m = some.size
        weigh_in(h, g, p, p0, prior, some)
        if count < 2 * m or not solve(h, g, some, step[:m], inverse[:m, :m]):
            return
        if turn > 12:  # what goes to and fro is held
            step *= 0.5
        _step(p, step, some)
        if not 0.3 * radius < p[RADIUS] < 3.0 * radius:
            return
        state[STEPS] = turn + 1
        square = max(step[0] ** 2, step[1] ** 2, step[2] ** 2)
        if wide > 0.0:
            wide = 0.6 * wide if square > 4.0 and wide > 0.3 else 0.0
            stride = COARSE if wide > 0.0 else 2
            chi = np.inf
        elif stride > 1:
            stride = 1 if square < 0.05 or turn > 8 else stride
        else:
            # the next step would be as small as this one squared, over the edge's width
            small = square < 0.05 * sqrt(inverse[0, 0] * max(1.0, chi)) * p[WIDTH]
            gained = 0.0
            for a in range(m):
                gained += step[a] * g[some[a]]
            small = small and gained < 100.0 * max(1.0, chi)
            if small and (loose < 1.0 or cut < 1.3 * CUT * max(1.0, chi)):
                state[CHI], state[SETTLED] = chi, 1.0
                return


@njit(**FINE)
def judge(
    region: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    prior: Floats,
    free: Indices,
    noise: Floats,
    margin: float,
    state: Floats,
    covariance: Floats,
    bound: Floats,
) -> None:
    """Say what a fit is worth: covariances (the fit's own, and the least there can be), misfit.

    The fit's own allows for residuals that go together along the outline: it sums the scores of
    each of sixteen sectors before it squares them, wherever chi^2, or what the sectors say of the
    centre, tells that the model is not all.
    """
    n = free.size
    fisher, g, scores = np.zeros((COUNT, PADDED)), np.zeros(COUNT), np.zeros((SECTORS, COUNT))
    inverse, step, tally = np.empty((n, n)), np.empty(n), np.empty(TALLY)
    look = (0.0, margin, 1, CUT * max(1.0, state[CHI]))
    gather(region, use, back, p, noise, look, fisher, g, scores, tally)
    weigh_in(fisher, g, p, p, prior, free)
    count, near_count, around = tally[STEPS], tally[SETTLED], 2.0 * pi * p[RADIUS]
    state[CHI] = tally[CHI] / max(count - n, 1.0)
    state[NEAR] = tally[NEAR] / max(near_count - n, 1.0)
    state[SEEN], state[HIDDEN] = tally[SEEN] / around, tally[HIDDEN] / around
    state[FULL], state[STRAY] = tally[FULL] / around, tally[STRAY] / max(count, 1.0)
    if not solve(fisher, g, free, step, inverse):
        state[SETTLED] = 0.0
        return
    put(inverse, bound)
    put(inverse * max(1.0, state[CHI]), covariance)
    worst = max(state[CHI], state[NEAR])
    moved = np.ascontiguousarray(scores[:, free]) @ inverse  # by each sector alone
    apart = moved.T @ moved * (SECTORS / (SECTORS - 3.0))
    far = apart[0, 0] + apart[1, 1] > ALIKE * (inverse[0, 0] + inverse[1, 1])
    if far or worst > 1.0 + 5.0 * sqrt(2.0 / max(near_count, 2.0)):
        put(inverse * max(1.0, worst) + apart, covariance)


@njit(**FINE)
def refine(
    regions: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    prior: Floats,
    free: Indices,
    noise: Floats,
    wide: float,
    margin: float,
    state: Floats,
    covariance: Floats,
    bound: Floats,
) -> None:
    """Fit a batch of regions (region, row, col); p (region, COUNT) becomes the solutions."""
    for i in range(regions.shape[0]):
        mask, behind = use[i % use.shape[0]], back[i % back.shape[0]]
        if not np.isfinite(p[i]).all():
            continue
        fit(regions[i], mask, behind, p[i], prior[i], free, noise, wide, margin, state[i])
        if state[i, SETTLED] > 0.0:
            judge(
                regions[i],
                mask,
                behind,
                p[i],
                prior[i],
                free,
                noise,
                margin,
                state[i],
                covariance[i],
                bound[i],
            )
