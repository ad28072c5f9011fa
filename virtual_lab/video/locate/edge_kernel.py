"""The edge fit of a region, by Gauss-Newton.

A ball's brightness near its rim is smooth shading and a pattern: a random field on the sphere's
surface that is alike over some degrees. How strong it is at each sector comes from the picture:
where the rim is plain it sharpens the place, where a seam runs it hardly counts.
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate import edge_sums as at
from virtual_lab.video.locate.edge_sums import (
    BLACK,
    COUNT,
    GAIN,
    OPTIONS,
    PRNU,
    READ,
    Equations,
    Rim,
    View,
    gather,
    variance,
)
from virtual_lab.video.locate.rim_profiles import LIKE

__all__ = ["STATE", "Solution", "copy_into", "covered", "eliminate", "fit_region", "substitute"]


Floats = NDArray[np.float64]

STATE = 11  # the tally's figures, then: whether the fit settled, its steps,
SETTLED, STEPS, SWAY, COVERED = 7, 8, 9, 10  # what the rim may hide, the share of it not seen
FAINTEST, STRONGEST = 0.004, 0.5  # of the ball's brightness, a pattern's standard deviation
NOISY = 0.6  # of a pixel's noise: a fainter pattern would not be seen
# of the ball's brightness, a pattern until the outline stands still, and when it first does: with
# more, at first, it would explain an outline in a wrong place
STIFF, ROUGH = 0.01, 0.06
STILL, SETTLING = 0.2, 7  # pixels; repetitions at most
ROUNDS, CLOSE = 4, 1.0  # repetitions after that at most; a step of so much of u ends them
TURNS, SMALL = 12, 0.1  # solutions of each for the pattern's strength; likewise
SHADE = 2.0  # of the ball's brightness: what shading may be
HELD = 1e12
GEOMETRY = 5  # the first parameters
# how much of the rim is hidden: where the picture shows the background in its place
RIM = 1.5, 4.5  # pixels inside the outline that are looked at, wherever the ball is
ALIKE = 3.0  # standard deviations of noise: the background and nothing else
CLEAR = 12.0  # of them that ball and background are apart: with less they are alike


@njit(**OPTIONS)
def copy_into(values: Floats, out: Floats) -> None:
    """Copy an array into one of the same shape: numba compiles `out[:] = values` for seconds."""
    for k in range(out.size):
        out.flat[k] = values.flat[k]


@njit(**OPTIONS)
def _factor(a: Floats) -> bool:
    """Replace a symmetric matrix by its lower Cholesky factor."""
    n = a.shape[0]
    for i in range(n):
        for j in range(i + 1):
            value = a[i, j]
            for k in range(j):
                value -= a[i, k] * a[j, k]
            if j < i:
                a[i, j] = value / a[j, j]
            elif value > 0.0:
                a[i, i] = sqrt(value)
            else:
                return False
    return True


@njit(**OPTIONS)
def _down(low: Floats, b: Floats, first: int) -> None:
    """Solve low x = b in place; b is (n, columns), those from the first on.

    No slices are passed: numba would compile everything once more for them.
    """
    n, columns = b.shape
    for i in range(n):
        for k in range(i):
            part = low[i, k]
            for c in range(first, columns):
                b[i, c] -= part * b[k, c]
        whole = 1.0 / low[i, i]
        for c in range(first, columns):
            b[i, c] *= whole


@njit(**OPTIONS)
def _up(low: Floats, b: Floats) -> None:
    """Solve low^T x = b in place; b is (n,)."""
    n = b.size
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= low[k, i] * b[k]
        b[i] /= low[i, i]


@njit(**OPTIONS)
def _take(a: Floats, b: Floats, out: Floats) -> None:
    """Subtract a^T b from out, of a as many columns as out has rows."""
    for k in range(a.shape[0]):
        for i in range(out.shape[0]):
            part = a[k, i]
            for j in range(b.shape[1]):
                out[i, j] -= part * b[k, j]


@njit(**OPTIONS)
def eliminate(blocks: Floats, links: Floats, border: Floats, shared: Floats) -> bool:
    """Factor the normal equations in place, their right side with them.

    A ring of small blocks, one a sector, of which only neighbours meet, is solved block after
    block; the last block and what all share are the border that every block meets.

    `blocks` (block, n, n) on the diagonal; `links` (block, n, n) from each to the next, the
    last's to the first; `border` (block, n, n + m + 1): room for the last block, what each block
    has with the shared parameters, and its right side; `shared` (n + m, n + m + 1) likewise.
    """
    count, n = blocks.shape[0], blocks.shape[1]
    last = count - 1
    m = shared.shape[0] - n
    for i in range(n):
        for j in range(n):
            border[0, i, j] += links[last, j, i]
            border[last - 1, i, j] += links[last - 1, i, j]
            shared[i, j] += blocks[last, i, j]
        for j in range(m + 1):
            shared[i, n + j] += border[last, i, n + j]
        for j in range(m):
            shared[n + j, i] += border[last, i, n + j]
    for k in range(last):
        if not _factor(blocks[k]):
            return False
        _down(blocks[k], border[k], 0)
        if k < last - 1:
            _down(blocks[k], links[k], 0)
            _take(links[k], links[k], blocks[k + 1])
            _take(links[k], border[k], border[k + 1])
        _take(border[k], border[k], shared)
    if not _factor(shared):
        return False
    _down(shared, shared, n + m)
    return True


@njit(**OPTIONS)
def substitute(
    blocks: Floats, links: Floats, border: Floats, shared: Floats, right: int, ring: Floats
) -> Floats:
    """Return the shared parameters of a factored system, and fill `ring` (block, n).

    `right`: -1 for the right side that was factored along, else the unit vector of a shared
    parameter.
    """
    count, n = blocks.shape[0], blocks.shape[1]
    total = shared.shape[0]
    whole = np.zeros((total, 1))
    if right < 0:
        for i in range(total):
            whole[i, 0] = shared[i, total]
    else:
        whole[n + right, 0] = 1.0
        _down(shared, whole, 0)
    end = whole.copy().reshape(total)
    _up(shared, end)
    for i in range(n):
        ring[count - 1, i] = end[i]
    for k in range(count - 2, -1, -1):
        for i in range(n):
            value = border[k, i, total] if right < 0 else 0.0
            for j in range(total):
                value -= border[k, i, j] * end[j]
            if k < count - 2:
                for j in range(n):
                    value -= links[k, i, j] * ring[k + 1, j]
            ring[k, i] = value
        _up(blocks[k], ring[k])
    return end[n:]


class Solution(NamedTuple):
    """What a fit ends with."""

    p: Floats  # (COUNT,) the start, and then the solution
    state: Floats  # (STATE,)
    covariance: Floats  # (3, 3) of x, y and radius
    shifts: Floats  # (3,) variances that the pattern gives x, y and radius


class Pattern(NamedTuple):
    """A pattern at the rim: a random field on the sphere, alike over LIKE along the rim."""

    values: Floats  # (sector, knot) [DN]
    step: Floats  # (sector, knot) that a solution adds
    amplitude: Floats  # (sector,) standard deviation, of the ball's brightness
    stiffness: Floats  # (knot, knot) inverse covariance along the depth, variance 1
    bright: float  # of the ball [DN]
    faintest: float  # amplitude


def _brightness(region: Floats, p: Floats, noise: Floats) -> float:
    """Return the root mean square of the ball's grey values over the black."""
    row, col = np.ogrid[: region.shape[0], : region.shape[1]]
    ball = (row - p[at.Y]) ** 2 + (col - p[at.X]) ** 2 < (0.9 * p[at.RADIUS]) ** 2
    return max(1.0, sqrt(float(np.mean((region[ball] - noise[BLACK]) ** 2)))) if ball.any() else 1.0


@njit(**OPTIONS)
def _believe(field: Pattern, sums: Equations) -> None:
    """Add what is believed of the pattern."""
    blocks, links, border, _ = sums
    pattern, _, amplitude, stiffness, bright, _ = field
    sectors, knots = pattern.shape
    like = exp(-2.0 * pi / sectors / LIKE)
    own, next_to = (1.0 + like * like) / (1.0 - like * like), -like / (1.0 - like * like)
    right = border.shape[2] - 1
    for k in range(sectors):
        one, other = (k + 1) % sectors, (k - 1) % sectors
        here = 1.0 / (amplitude[k] * bright)
        after, before = 1.0 / (amplitude[one] * bright), 1.0 / (amplitude[other] * bright)
        for i in range(knots):
            for j in range(knots):
                stiff = stiffness[i, j] * here
                blocks[k, i, j] += own * stiff * here
                links[k, i, j] += next_to * stiff * after
                pull = own * here * pattern[k, j] + next_to * after * pattern[one, j]
                pull += next_to * before * pattern[other, j]
                border[k, i, right] -= stiff * pull


@njit(**OPTIONS)
def _shown(field: Pattern) -> None:
    """Set how strong the pattern is at each sector: as it shows there or beside it."""
    values, step, amplitude = field.values, field.step, field.amplitude
    sectors, knots = values.shape
    power = np.empty(sectors)
    for k in range(sectors):
        power[k] = 0.0
        for i in range(knots):
            power[k] += ((values[k, i] + step[k, i]) / field.bright) ** 2 / knots
    for k in range(sectors):
        most = max(power[k], power[k - 1], power[(k + 1) % sectors])
        amplitude[k] = min(sqrt(field.faintest**2 + most), STRONGEST)


@njit(**OPTIONS)
def _solve(sums: Equations, turns: int, field: Pattern, step: Floats) -> float:
    """Factor the pixels' sums with what is believed of the pattern; return u of x.

    Fills the `step` of the shared parameters and that of the pattern. How strong the pattern is
    at each sector is found in so many `turns`, without a look at the pixels.
    """
    blocks, links, border, shared = sums
    of_pixels = blocks.copy(), links.copy(), border.copy(), shared.copy()
    x, y, u = np.inf, np.inf, 0.0
    for turn in range(turns):
        if turn > 0:
            _shown(field)
            copy_into(of_pixels[0], blocks)
            copy_into(of_pixels[1], links)
            copy_into(of_pixels[2], border)
            copy_into(of_pixels[3], shared)
        _believe(field, sums)
        step[:] = np.nan
        if not eliminate(blocks, links, border, shared):
            break
        for right in range(0, -2, -1):  # u of x, then the step
            copy_into(substitute(blocks, links, border, shared, right, field.step), step)
            if right == 0:
                u = sqrt(step[0])
        if max(abs(step[0] - x), abs(step[1] - y)) < SMALL * u:
            break
        x, y = step[0], step[1]
    return u


def _shift(field: Pattern) -> float:
    """Return the variance that the pattern gives a parameter, from its row of the inverse."""
    like = exp(-2.0 * pi / len(field.step) / LIKE)
    row = field.step / (field.amplitude * field.bright)[:, None]
    along = (1.0 + like * like) * row - 2.0 * like * np.roll(row, -1, axis=0)
    return float(np.sum((row @ field.stiffness) * along) / (1.0 - like * like))


def _sway(pattern: Floats, hides: Floats, contrast: float) -> float:
    """Return how far the place would be off were the pattern taken for the outline [pixel]."""
    turn = np.exp(2j * pi * np.arange(len(pattern)) / len(pattern))
    return float(2.0 * abs(turn @ (pattern @ hides)) / (len(pattern) * contrast))


def covered(view: View, p: Floats, way: Floats, noise: Floats) -> float:
    """Return the share of the rim's pixels that are as bright as their background, alone.

    What stands before the ball stood there before it came: a bat, a cable, the sabot's catcher.
    """
    row, col = np.ogrid[: view.pixels.shape[0], : view.pixels.shape[1]]
    u, v = col - p[at.X], row - p[at.Y]
    ends = [np.hypot(u + side * way[0], v + side * way[1]) for side in (-0.5, 0.5)]
    far = np.maximum(*ends)
    rim = (far > p[at.RADIUS] - RIM[1]) & (far < p[at.RADIUS] - RIM[0])
    if not rim.any():
        return 0.0
    seen, expected = view.pixels[rim], p[at.LEVEL] * view.background[rim]

    def spread(mean: Floats) -> Floats:
        light = np.maximum(mean - noise[BLACK], 0.0)
        return np.asarray(noise[READ] + light * (noise[GAIN] + noise[PRNU] ** 2 * light))

    if (seen - expected).mean() ** 2 < CLEAR**2 * spread(expected.mean()):
        return 0.0
    return float(((seen - expected) ** 2 < ALIKE**2 * spread(expected)).mean())


def fit_region(
    view: View, rim: Rim, noise: Floats, prior: Floats, sectors: int, found: Solution
) -> None:
    """Fit one region.

    No loop over turns or regions is compiled: each level of calls costs seconds to compile.
    """
    p, state = found.p, found.state
    knots = rim.stiffness.shape[0]
    total = knots + COUNT
    sums = Equations(
        np.empty((sectors, knots, knots)),
        np.empty((sectors, knots, knots)),
        np.empty((sectors, knots, total + 1)),
        np.empty((total, total + 1)),
    )
    bright = _brightness(view.pixels, p, noise)
    faintest = NOISY * sqrt(variance(noise[BLACK] + bright, noise)) / bright
    field = Pattern(
        np.zeros((sectors, knots)),
        np.empty((sectors, knots)),
        np.full(sectors, STIFF),
        rim.stiffness,
        bright,
        max(FAINTEST, faintest),
    )
    p0, step, tally = p.copy(), np.empty(COUNT), np.empty(at.TALLY)
    settling, rounds = True, 0
    for turn in range(SETTLING + ROUNDS):
        first = turn == 0
        gather(view, rim, noise, p, field.values, settling, sums, tally)
        state[: at.TALLY] = tally
        if tally[at.PIXELS] < 4 * COUNT:
            return
        weight = prior.copy()
        weight[:GEOMETRY] = HELD if first else prior[:GEOMETRY]
        weight[at.PLAIN :] = 1.0 / (SHADE * bright) ** 2
        own = np.arange(knots, total)
        sums.shared[own, own] += weight
        sums.shared[own, total] += weight * (p0 - p)
        u = _solve(sums, 1 if settling else TURNS, field, step)
        far = float(np.abs(step[:3]).max())
        if not far < 0.5 * p0[at.RADIUS]:
            return
        p[:GEOMETRY] += min(1.0, 1.0 / max(far, 1e-9)) * step[:GEOMETRY]
        p[GEOMETRY:] += step[GEOMETRY:]
        field.values[:] += field.step
        state[STEPS] = turn
        rounds += 0 if settling else 1
        if rounds == ROUNDS or (rounds > 1 and far < CLOSE * u):
            break
        if settling and ((far <= STILL and not first) or turn + 1 == SETTLING):
            settling = False
            field.amplitude[:] = ROUGH
    for a in range(3):
        found.covariance[a] = substitute(*sums, a, field.step)[:3]
        found.shifts[a] = _shift(field)
    behind = noise[BLACK] + bright - p[at.LEVEL] * view.background.mean()
    state[SWAY] = _sway(field.values, rim.hides, max(abs(behind), 1.0))
    state[COVERED] = covered(view, p, rim.way, noise)
    state[SETTLED] = 1.0
