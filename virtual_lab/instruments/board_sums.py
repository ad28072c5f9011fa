"""How well a board's own sums know the ball: what they make of each edge's uncertainty.

The passage is taken on a line through the middles of the chords, the height at the top of a
parabola through their squares, each weighed by its own uncertainty. How many beams a ball
breaks, and where along its radius, is a matter of where its centre passes between two beams,
and of how many it would break beyond the board's last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["SumGains", "gains_of_sums"]

Array = NDArray[np.float64]
LEAST_BEAMS = 4  # broken, for a sum
FAINTEST = 1e-2  # of the longest chord's square: shorter ones weigh no more than this one
PHASES = 64  # of a centre between two beams


@dataclass(frozen=True, slots=True)
class SumGains:
    """Standard uncertainties that come of one of 1 at each edge; NaN: too few beams broken."""

    edge: Array  # of the passage, from that of an edge's time
    way: Array  # of the height, from that of the way flown at an edge
    trip: Array  # of the height, from that of a beam's threshold


def gains_of_sums(centre: Array, beams: int, radius: float) -> SumGains:
    """Return the gains for balls that pass a board at heights `centre`.

    Parameters
    ----------
    centre
        Height of the ball's centre above the lowest beam, in beam pitches, any shape.
    beams
        On the board.
    radius
        Of the ball, in pitches.
    """
    inside = (centre > radius) & (centre < beams - 1 - radius)
    whole = np.where(inside, centre, 0.0)
    at = np.rint((whole - np.floor(whole)) * PHASES).astype(np.intp)
    found = np.take(_gains(radius, 0), at, axis=1)
    if not inside.all():  # few balls pass where beams are missing
        found[:, ~inside] = _cut_short(centre[~inside], beams, radius)
    return SumGains(*found)


def _cut_short(centre: Array, beams: int, radius: float) -> Array:
    """Return the gains of balls that break less than they would on a higher board, (3, ball)."""
    lowest, highest = np.ceil(centre - radius), np.floor(centre + radius)
    below, above = np.maximum(-lowest, 0), np.maximum(highest - (beams - 1), 0)
    most = int(2 * radius) + 1
    cut = np.minimum(np.nan_to_num(np.maximum(below, above), nan=most), most).astype(int)
    # beams missing above are beams missing below, upside down
    phase = np.nan_to_num(np.where(above > below, -centre, centre) % 1)
    at = np.rint(phase * PHASES).astype(int)
    tables = [_gains(radius, missing) for missing in range(int(cut.max(initial=0)) + 1)]
    found = np.stack(tables, axis=1)[:, cut, at]
    return np.asarray(np.where(np.isfinite(centre), found, np.nan))


@cache
def _gains(radius: float, missing: int) -> Array:
    """Return the three gains at each phase, the lowest `missing` beams not there."""
    reach = int(radius) + 1
    phase = np.arange(PHASES + 1) / PHASES
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
