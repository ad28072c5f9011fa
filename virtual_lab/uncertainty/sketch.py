"""Quantiles of any number of draws in constant memory, from counts in bins.

The bins have equal widths in asinh((x - middle) / width). They are narrow near the ends of an
interval and wide far outside; the two outermost bins are unlimited. If `width` is half the
interval, the width of a bin at its end is 1.3e-4 of the interval. Quantiles are interpolated within
bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array

BINS = 2**18  # number of bins (2 MB), limited by the size of the cache
REACH = 12.0  # range in asinh, 80 000 widths on each side


@dataclass(frozen=True, slots=True)
class Sketch:
    """Counts of numbers in bins. Sketches with equal bins can be added."""

    middle: float
    width: float
    counts: NDArray[np.int64]

    @classmethod
    def empty_like(cls, values: Array, probability: float) -> Self:
        """Return an empty sketch for numbers similar to `values`, and their coverage interval."""
        tail = (1 - probability) / 2
        low, middle, high = np.quantile(values, [tail, 0.5, 1 - tail])
        size = float(high - low) / 2 or float(np.ptp(values)) or 1e-6 * abs(float(middle)) or 1.0
        return cls(float(middle), size, np.zeros(BINS, np.int64))

    def add(self, values: Array) -> None:
        """Count the numbers."""
        at = np.arcsinh((values - self.middle) / self.width)
        at *= BINS / (2 * REACH)
        at += BINS / 2
        np.clip(at, 0, BINS - 1, out=at)
        np.add.at(self.counts, at.astype(np.int64), 1)

    def __add__(self, other: Sketch) -> Sketch:
        if (self.middle, self.width) != (other.middle, other.width):
            raise ValueError("sketches of one place add up")
        return Sketch(self.middle, self.width, self.counts + other.counts)

    def distribution(self) -> tuple[Array, Array]:
        """Return the distribution function at both edges of the occupied bins, and these edges.

        A quantile is ``np.interp(q, below, edges)``, linear within a bin.
        """
        held = np.flatnonzero(self.counts)
        above = np.cumsum(self.counts[held]) / self.counts.sum()
        below = np.stack([np.concatenate([[0.0], above[:-1]]), above], axis=1).ravel()
        first = np.stack([held, held + 1], axis=1).ravel()
        return below, self.middle + self.width * np.sinh(REACH * (2 * first / BINS - 1))


def shortest_interval(below: Array, edges: Array, probability: float) -> tuple[float, float]:
    """Return the lower and upper end of the shortest interval with the probability `probability`.

    The distribution function has the values `below` at the numbers `edges`, both (n,) and
    ascending, as returned by `Sketch.distribution`. The ends are in the unit of `edges` (JCGM 101,
    7.7.4).
    """
    starts = below <= 1 - probability
    lengths = np.interp(below[starts] + probability, below, edges) - edges[starts]
    best = int(np.argmin(lengths))
    return float(edges[best]), float(edges[best] + lengths[best])
