"""How well a board's own sums know the ball: what they make of each edge's uncertainty.

The passage is taken on a line through the middles of the chords, the height at the top of a
parabola through their squares, each weighed by its own uncertainty. How many beams a ball
breaks, and where along its radius, is a matter of where its centre passes between two beams,
and of how many it would break beyond the board's last one.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from virtual_lab.simulation.arrays import Array

__all__ = ["CENTRE_PHASES", "gain_table"]

LEAST_BEAMS = 4  # broken, for a sum
FAINTEST = 1e-2  # of the longest chord's square: shorter ones weigh no more than this one
CENTRE_PHASES = 64  # of a centre between two beams


@cache
def gain_table(radius: float) -> Array:
    """Return what an uncertainty of 1 at each edge comes to, (3, row); NaN: too few beams broken.

    The first is that of the passage, from that of an edge's time; then that of the height, from
    that of the way flown at an edge; then that of the height, from that of a beam's threshold.
    Rows go by how many beams are missing, below, that the ball would break on a longer board,
    and by where its centre passes between two beams, in `CENTRE_PHASES` steps.

    Parameters
    ----------
    radius
        Of the ball, in pitches.
    """
    most = int(2 * radius) + 1
    return np.concatenate([_gains(radius, missing) for missing in range(most + 1)], axis=1)


def _gains(radius: float, missing: int) -> Array:
    """Return the three gains at each phase, the lowest `missing` beams not there."""
    reach = int(radius) + 1
    phase = np.arange(CENTRE_PHASES + 1) / CENTRE_PHASES
    place = (np.arange(-reach, reach + 2) - phase[:, None]) / radius
    square = 1 - place**2
    broken = square > 0
    broken &= np.cumsum(broken, axis=1) > missing
    square = np.where(broken, square, 0.0)
    many = broken.sum(axis=1)
    known = many >= LEAST_BEAMS
    weight = broken / np.maximum(square, FAINTEST * square.max(axis=1, initial=1.0)[:, None])
    powers = np.stack([place**k for k in range(3)], axis=-1)
    weighed = (weight[..., None] * powers).transpose(0, 2, 1)
    matrix = np.where(known[:, None, None], weighed @ powers, np.eye(3))
    slope = np.linalg.solve(matrix, weighed)[:, 1]  # of the parabola, at the centre
    many = many.clip(1)
    middle = (broken * place).sum(axis=1) / many
    spread = np.where(known, (broken * (place - middle[:, None]) ** 2).sum(axis=1), 1.0)
    gains = [
        np.sqrt((1 / many + middle**2 / spread) / 2),
        np.sqrt((slope**2 * square).sum(axis=1) / 2),
        np.sqrt((slope**2).sum(axis=1)),
    ]
    return np.where(known, gains, np.nan)
