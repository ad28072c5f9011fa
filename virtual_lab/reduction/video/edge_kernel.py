"""The edge fit of one region after another, by Gauss-Newton.

A ball's brightness near its rim is smooth shading and a pattern: a random field on the sphere's
surface that is alike over some degrees. How strong it is at each sector the picture tells: where
the rim is plain it sharpens the place, where a seam runs it hardly counts.
"""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.reduction.video import edge_sums as at
from virtual_lab.reduction.video.disc import FINE
from virtual_lab.reduction.video.edge_profiles import LIKE
from virtual_lab.reduction.video.edge_solve import eliminate, substitute
from virtual_lab.reduction.video.edge_sums import COUNT, gather

__all__ = ["STATE", "refine"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

STATE = 10  # the tally's figures, then whether the fit settled, and steps
SETTLED, STEPS = 8, 9
FAINTEST, STRONGEST = 0.01, 0.5  # of the ball's brightness, a pattern's standard deviation
ROUGH = 0.02  # the same until the outline stands still
STILL, SETTLING = 0.02, 7  # pixels; repetitions at most
COARSE = 2  # rows from one to the next, at first
LEAST, TURNS = 3, 8  # repetitions after that
SMALL = 0.1  # of u: such a step ends them
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
                total += (region[row, col] - noise[2]) ** 2
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
def _shown(pattern: Floats, bright: float, amplitude: Floats) -> None:
    """Set how strong the pattern is at each sector: as it shows there or beside it."""
    sectors, knots = pattern.shape
    power = np.empty(sectors)
    for k in range(sectors):
        power[k] = 0.0
        for i in range(knots):
            power[k] += (pattern[k, i] / bright) ** 2 / knots
    for k in range(sectors):
        most = max(power[k], power[k - 1], power[(k + 1) % sectors])
        amplitude[k] = min(sqrt(FAINTEST**2 + most), STRONGEST)


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
def _u(blocks: Floats, links: Floats, border: Floats, shared: Floats, spare: Floats) -> float:
    """Return the standard uncertainty of x."""
    return sqrt(substitute(blocks, links, border, shared, 0, spare)[0])


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
    amplitude = np.full(sectors, ROUGH)
    bright = _brightness(region, p, noise)
    p0, tally = p.copy(), np.empty(at.TALLY)
    rough, later = True, 0
    for turn in range(SETTLING + TURNS + 1):
        first = turn == 0
        gather(
            region, use, back, p, pattern, way, s, inside, table, noise, first, 2 if rough else 1,
            blocks, links, border, shared, tally,
        )  # fmt: skip
        state[: at.TALLY] = tally
        if tally[at.PIXELS] < 4 * COUNT:
            return
        _believe(amplitude, pattern, stiffness, bright, blocks, links, border)
        for a in range(COUNT):
            weight = HELD if first and a < GEOMETRY else prior[a]
            if a >= at.PLAIN:
                weight = 1.0 / (SHADE * bright) ** 2
            shared[knots + a, knots + a] += weight
            shared[knots + a, total] += weight * (p0[a] - p[a])
        if not eliminate(blocks, links, border, shared):
            return
        step = substitute(blocks, links, border, shared, -1, ring)
        far = max(abs(step[0]), abs(step[1]), abs(step[2]))
        if not far < 0.5 * p0[at.RADIUS]:
            return
        less = min(1.0, 1.0 / max(far, 1e-9))
        for a in range(COUNT):
            p[a] += (less if a < GEOMETRY else 1.0) * step[a]
        pattern += ring
        state[STEPS] = turn
        rough = rough and (first or far > STILL) and turn < SETTLING
        later = 0 if rough else later + 1
        u = _u(blocks, links, border, shared, ring) if later >= LEAST else 0.0
        if later == TURNS or far < SMALL * u:
            break
        if not rough:
            _shown(pattern, bright, amplitude)
    for a in range(3):
        row = substitute(blocks, links, border, shared, a, ring)
        covariance[a] = row[:3]
        shifts[a] = _shift(ring, amplitude, stiffness, bright)
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
            inside, table, stiffness, noise, sectors, state[i], covariance[i], shifts[i],
        )  # fmt: skip
