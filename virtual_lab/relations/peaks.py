"""The greatest value of a curve known at places: between them a spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from virtual_lab.units import Array


class Peak(NamedTuple):
    """A greatest value and its place."""

    value: float
    place: float


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
