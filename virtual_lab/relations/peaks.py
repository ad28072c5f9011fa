"""The greatest value of a curve known at places, and how wide it is: between them a spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from virtual_lab.units import Array


class Peak(NamedTuple):
    """A greatest value and its place."""

    value: float
    place: float


class Span(NamedTuple):
    """A stretch about a top, and which of its ends are only those of what is known."""

    low: float
    high: float
    low_cut_off: bool
    high_cut_off: bool

    @property
    def width(self) -> float:
        """From end to end; where one is cut off, at least that."""
        return self.high - self.low

    @property
    def whole(self) -> bool:
        """Whether both ends were found."""
        return not (self.low_cut_off or self.high_cut_off)

    def scaled(self, middle: float, unit: float) -> Span:
        """Return the stretch of ``middle + unit * place``."""
        return self._replace(low=middle + unit * self.low, high=middle + unit * self.high)


def level_span(crossings: Array, top: float, low: float, high: float) -> Span:
    """Return the stretch about `top` between the nearest crossings of a level.

    Where there is none between `low` and `high`, that end is cut off there.
    """
    below = crossings[(crossings >= low) & (crossings < top)]
    above = crossings[(crossings > top) & (crossings <= high)]
    return Span(
        low=float(below.max()) if below.size else low,
        high=float(above.min()) if above.size else high,
        low_cut_off=not below.size,
        high_cut_off=not above.size,
    )


def peak(places: Array, values: Array) -> Peak:
    """Return the greatest value of the cubic spline through a curve, ends included.

    Parameters
    ----------
    places, values
        Shape (n,), places increasing, n at least 4. A place step h errs by order h⁴ in the
        value and h³ in the place.
    """
    spline = CubicSpline(places, values)
    turns = np.asarray(spline.derivative().roots(discontinuity=False, extrapolate=False))
    candidates = np.concatenate((places[[0, -1]], turns[np.isfinite(turns)]))
    heights = spline(candidates)
    best = int(np.argmax(heights))
    return Peak(float(heights[best]), float(candidates[best]))


def width_below(places: Array, values: Array, drop: float) -> Span:
    """Return where the spline of `peak` lies at most `drop` below its greatest value."""
    top = peak(places, values)
    crossings = np.asarray(
        CubicSpline(places, values).solve(top.value - drop, discontinuity=False, extrapolate=False)
    )
    return level_span(crossings, top.place, float(places[0]), float(places[-1]))
