"""The edge fit of one region after another, by Gauss-Newton.

A ball's brightness near its rim is smooth shading and a pattern: a random field on the sphere's
surface that is alike over some degrees. How strong it is at each sector the picture tells: where
the rim is plain it sharpens the place, where a seam runs it hardly counts.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.video.locate.plain_ball.disc import FINE
from virtual_lab.video.locate.plain_ball.normal import put
from virtual_lab.video.locate.plain_ball.sums import BLACK, variance
from virtual_lab.video.locate.stitched_ball import sums as at
from virtual_lab.video.locate.stitched_ball.cover import covered
from virtual_lab.video.locate.stitched_ball.profiles import LIKE
from virtual_lab.video.locate.stitched_ball.solve import eliminate, substitute
from virtual_lab.video.locate.stitched_ball.sums import COUNT, gather

__all__ = ["STATE", "refine"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

STATE = 12  # the tally's figures, then: whether the fit settled, its steps,
SETTLED, STEPS, SWAY, COVERED = 8, 9, 10, 11  # what the rim may hide, the share of it not seen
FAINTEST, STRONGEST = 0.004, 0.5  # of the ball's brightness, a pattern's standard deviation
NOISY = 0.6  # of a pixel's noise: a fainter pattern would not be seen
# of the ball's brightness, a pattern until the outline stands still, and when it first does: with
# more, at first, it would explain an outline in a wrong place
STIFF, ROUGH = 0.01, 0.06
STILL, SETTLING = 0.2, 7  # pixels; repetitions at most
COARSE = 3  # rows from one to the next, until then
ROUNDS, CLOSE = 4, 1.0  # repetitions after that at most; a step of so much of u ends them
TURNS, SMALL = 12, 0.1  # solutions of each for the pattern's strength; likewise
SHADE = 2.0  # of the ball's brightness: what shading may be
HELD = 1e12
GEOMETRY = 5  # the first parameters


@njit(**FINE)
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


@njit(**FINE)
def _believe(
    amplitude: Floats,
    pattern: Floats,
    stiffness: Floats,
    bright: float,
    blocks: Floats,
    links: Floats,
    border: Floats,
) -> None:
    """Add what is believed of the pattern: alike over LIKE along the rim, too."""
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


@njit(**FINE)
def _shown(pattern: Floats, bright: float, faintest: float, amplitude: Floats) -> None:
    """Set how strong the pattern is at each sector: as it shows there or beside it."""
    sectors, knots = pattern.shape
    power = np.empty(sectors)
    for k in range(sectors):
        power[k] = 0.0
        for i in range(knots):
            power[k] += (pattern[k, i] / bright) ** 2 / knots
    for k in range(sectors):
        most = max(power[k], power[k - 1], power[(k + 1) % sectors])
        amplitude[k] = min(sqrt(faintest**2 + most), STRONGEST)


@njit(**FINE)
def _solve(
    blocks: Floats,
    links: Floats,
    border: Floats,
    shared: Floats,
    turns: int,
    pattern: Floats,
    stiffness: Floats,
    bright: float,
    faintest: float,
    amplitude: Floats,
    step: Floats,
    ring: Floats,
) -> float:
    """Factor the pixels' sums with what is believed of the pattern; return u of x.

    Fills the `step` of the shared parameters and the `ring` of the pattern's. How strong the
    pattern is at each sector is found in so many `turns`, without a look at the pixels.
    """
    of_pixels = blocks.copy(), links.copy(), border.copy(), shared.copy()
    x, y, u = np.inf, np.inf, 0.0
    for turn in range(turns):
        if turn > 0:
            _shown(pattern + ring, bright, faintest, amplitude)
            put(of_pixels[0], blocks)
            put(of_pixels[1], links)
            put(of_pixels[2], border)
            put(of_pixels[3], shared)
        _believe(amplitude, pattern, stiffness, bright, blocks, links, border)
        step[:] = np.nan
        if not eliminate(blocks, links, border, shared):
            break
        u = sqrt(substitute(blocks, links, border, shared, 0, ring)[0])
        put(substitute(blocks, links, border, shared, -1, ring), step)
        if max(abs(step[0] - x), abs(step[1] - y)) < SMALL * u:
            break
        x, y = step[0], step[1]
    return u


@njit(**FINE)
def _shift(ring: Floats, amplitude: Floats, stiffness: Floats, bright: float) -> float:
    """Return the variance that the pattern gives a parameter, from its row of the inverse."""
    sectors, knots = ring.shape
    like = exp(-2.0 * pi / sectors / LIKE)
    own, next_to = (1.0 + like * like) / (1.0 - like * like), -like / (1.0 - like * like)
    total = 0.0
    for k in range(sectors):
        one = (k + 1) % sectors
        here, after = 1.0 / (amplitude[k] * bright), 1.0 / (amplitude[one] * bright)
        for i in range(knots):
            for j in range(knots):
                total += (
                    stiffness[i, j]
                    * here
                    * ring[k, i]
                    * (own * here * ring[k, j] + 2.0 * next_to * after * ring[one, j])
                )
    return total


@njit(**FINE)
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


@njit(**FINE)
def fit(
    region: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    prior: Floats,
    way: Floats,
    s: float,
    inside: float,
    table: Floats,
    stiffness: Floats,
    hides: Floats,
    noise: Floats,
    sectors: int,
    state: Floats,
    covariance: Floats,
    shifts: Floats,
) -> None:
    """Fit one region; p is the start and becomes the solution."""
    knots = stiffness.shape[0]
    total = knots + COUNT
    blocks, links = np.empty((sectors, knots, knots)), np.empty((sectors, knots, knots))
    border, shared = np.empty((sectors, knots, total + 1)), np.empty((total, total + 1))
    pattern, ring = np.zeros((sectors, knots)), np.empty((sectors, knots))
    amplitude = np.full(sectors, STIFF)
    bright = _brightness(region, p, noise)
    faintest = max(FAINTEST, NOISY * sqrt(variance(noise[BLACK] + bright, noise)[0]) / bright)
    p0, step, tally = p.copy(), np.empty(COUNT), np.empty(at.TALLY)
    settling, rounds = True, 0
    for turn in range(SETTLING + ROUNDS):
        first = turn == 0
        gather(
            region, use, back, p, pattern, way, s, inside, table, noise, settling,
            COARSE if settling else 1, blocks, links, border, shared, tally,
        )  # fmt: skip
        put(tally, state[: at.TALLY])
        if tally[at.PIXELS] < 4 * COUNT:
            return
        for a in range(COUNT):
            weight = HELD if first and a < GEOMETRY else prior[a]
            if a >= at.PLAIN:
                weight = 1.0 / (SHADE * bright) ** 2
            shared[knots + a, knots + a] += weight
            shared[knots + a, total] += weight * (p0[a] - p[a])
        u = _solve(
            blocks, links, border, shared, 1 if settling else TURNS,
            pattern, stiffness, bright, faintest, amplitude, step, ring,
        )  # fmt: skip
        far = max(abs(step[0]), abs(step[1]), abs(step[2]))
        if not far < 0.5 * p0[at.RADIUS]:
            return
        less = min(1.0, 1.0 / max(far, 1e-9))
        for a in range(COUNT):
            p[a] += (less if a < GEOMETRY else 1.0) * step[a]
        pattern += ring
        state[STEPS] = turn
        rounds += 0 if settling else 1
        if rounds == ROUNDS or (rounds > 1 and far < CLOSE * u):
            break
        if settling and ((far <= STILL and not first) or turn + 1 == SETTLING):
            settling = False
            amplitude[:] = ROUGH
    for a in range(3):
        put(substitute(blocks, links, border, shared, a, ring)[:3], covariance[a])
        shifts[a] = _shift(ring, amplitude, stiffness, bright)
    behind = noise[BLACK] + bright - p[at.LEVEL] * back.mean()
    state[SWAY] = _sway(pattern, hides, max(abs(behind), 1.0))
    state[COVERED] = covered(
        region, use, back, p[at.X], p[at.Y], p[at.RADIUS], p[at.LEVEL], way, noise
    )
    state[SETTLED] = 1.0


@njit(**FINE)
def refine(
    regions: Floats,
    use: Bytes,
    back: Floats,
    p: Floats,
    prior: Floats,
    ways: Floats,
    s: float,
    inside: float,
    table: Floats,
    stiffness: Floats,
    hides: Floats,
    noise: Floats,
    sectors: int,
    state: Floats,
    covariance: Floats,
    shifts: Floats,
) -> None:
    """Fit a batch of regions (region, row, col); p (region, COUNT) becomes the solutions."""
    for i in range(regions.shape[0]):
        if not (np.isfinite(p[i]).all() and np.isfinite(ways[i]).all()):
            continue
        fit(
            regions[i], use[i % use.shape[0]], back[i % back.shape[0]], p[i], prior, ways[i], s,
            inside, table, stiffness, hides, noise, sectors, state[i], covariance[i], shifts[i],
        )  # fmt: skip
