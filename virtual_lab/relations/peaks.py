"""The maximum of a curve known at discrete positions, with a spline between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from virtual_lab.units import Array


class Peak(NamedTuple):
    """A maximum and its position."""

    value: float
    place: float


def peak(places: Array, values: Array) -> Peak:
    """Return the maximum (`value`, `place`) of the cubic spline through a curve.

    `value` is the largest value of the spline, in the unit of `values`. `place` is its position, in
    the unit of `places`. The maximum can be at an end of the curve.

    The error depends on the distance h between positions. It is of order h⁴ in `value`, and of
    order h³ in `place`.

    Parameters
    ----------
    places
        Positions in increasing order, (n,) with n ≥ 4.
    values
        Values of the curve at these positions, (n,).

    Raises
    ------
    ValueError
        The positions do not increase, or a position or value is not finite.
    """
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(places, values)
    turns = np.asarray(spline.derivative().roots(discontinuity=False, extrapolate=False))
    candidates = np.concatenate((places[[0, -1]], turns[np.isfinite(turns)]))
    heights = spline(candidates)
    best = int(np.argmax(heights))
    return Peak(float(heights[best]), float(candidates[best]))
