"""The edge fit of a region, by Gauss-Newton.

A ball's brightness near its rim is smooth shading and a pattern: a random field on the sphere's
surface that is alike over some degrees. How strong it is at each sector the picture tells: where
the rim is plain it sharpens the place, where a seam runs it hardly counts.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate import edge_sums as at
from virtual_lab.video.locate.edge_sums import COUNT, Equations, Rim, gather
from virtual_lab.video.locate.pixels import BLACK, OPTIONS, View, variance
from virtual_lab.video.locate.rim_cover import covered
from virtual_lab.video.locate.rim_profiles import LIKE
from virtual_lab.video.locate.ring_solver import copy_into, eliminate, substitute

__all__ = ["STATE", "Solution", "fit_region"]

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


@njit(**OPTIONS)
def _brightness(region: Floats, p: Floats, noise: Floats) -> float:
    """Return the root mean square of the ball's grey values over the black."""
    total, count = 0.0, 1e-9
    reach = 0.9 * p[at.RADIUS]
    for row in range(region.shape[0]):
        for col in range(region.shape[1]):
            if (row - p[at.Y]) ** 2 + (col - p[at.X]) ** 2 < reach * reach:
                total += (region[row, col] - noise[BLACK]) ** 2
                count += 1.0
    return max(sqrt(total / count), 1.0)


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
        u = sqrt(substitute(blocks, links, border, shared, 0, field.step)[0])
        copy_into(substitute(blocks, links, border, shared, -1, field.step), step)
        if max(abs(step[0] - x), abs(step[1] - y)) < SMALL * u:
            break
        x, y = step[0], step[1]
    return u


@njit(**OPTIONS)
def _shift(field: Pattern) -> float:
    """Return the variance that the pattern gives a parameter, from its row of the inverse."""
    row, amplitude = field.step, field.amplitude
    sectors, knots = row.shape
    like = exp(-2.0 * pi / sectors / LIKE)
    own, next_to = (1.0 + like * like) / (1.0 - like * like), -like / (1.0 - like * like)
    total = 0.0
    for k in range(sectors):
        one = (k + 1) % sectors
        here, after = 1.0 / (amplitude[k] * field.bright), 1.0 / (amplitude[one] * field.bright)
        for i in range(knots):
            for j in range(knots):
                along = own * here * row[k, j] + 2.0 * next_to * after * row[one, j]
                total += field.stiffness[i, j] * here * row[k, i] * along
    return total


@njit(**OPTIONS)
def _sway(pattern: Floats, hides: Floats, contrast: float) -> float:
    """Return how far the place would be off were the pattern taken for the outline [pixel]."""
    sectors, knots = pattern.shape
    x, y = 0.0, 0.0
    for k in range(sectors):
        inward = 0.0
        for i in range(knots):
            inward += hides[i] * pattern[k, i]
        x += cos(2.0 * pi * k / sectors) * inward
        y += sin(2.0 * pi * k / sectors) * inward
    return float(2.0 * sqrt(x * x + y * y) / (sectors * contrast))


@njit(**OPTIONS)
def fit_region(
    view: View, rim: Rim, noise: Floats, prior: Floats, sectors: int, found: Solution
) -> None:
    """Fit one region.

    A batch of them is no loop in here: each level of calls costs seconds to compile.
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
        copy_into(tally, state[: at.TALLY])
        if tally[at.PIXELS] < 4 * COUNT:
            return
        for a in range(COUNT):
            weight = HELD if first and a < GEOMETRY else prior[a]
            if a >= at.PLAIN:
                weight = 1.0 / (SHADE * bright) ** 2
            sums.shared[knots + a, knots + a] += weight
            sums.shared[knots + a, total] += weight * (p0[a] - p[a])
        u = _solve(sums, 1 if settling else TURNS, field, step)
        far = max(abs(step[0]), abs(step[1]), abs(step[2]))
        if not far < 0.5 * p0[at.RADIUS]:
            return
        less = min(1.0, 1.0 / max(far, 1e-9))
        for a in range(COUNT):
            p[a] += (less if a < GEOMETRY else 1.0) * step[a]
        for k in range(sectors):
            for i in range(knots):
                field.values[k, i] += field.step[k, i]
        state[STEPS] = turn
        rounds += 0 if settling else 1
        if rounds == ROUNDS or (rounds > 1 and far < CLOSE * u):
            break
        if settling and ((far <= STILL and not first) or turn + 1 == SETTLING):
            settling = False
            field.amplitude[:] = ROUGH
    for a in range(3):
        row = substitute(sums.blocks, sums.links, sums.border, sums.shared, a, field.step)
        copy_into(row[:3], found.covariance[a])
        found.shifts[a] = _shift(field)
    behind = noise[BLACK] + bright - p[at.LEVEL] * view.background.mean()
    state[SWAY] = _sway(field.values, rim.hides, max(abs(behind), 1.0))
    state[COVERED] = covered(view, p, rim.way, noise)
    state[SETTLED] = 1.0
