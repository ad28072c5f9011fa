"""Piecewise cubics through points: a monotone cubic, which never overshoots, and a cubic spline.

scipy has both, but its interpolation package loads four other packages, which a certificate does
not need.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab.units import Array


@dataclass(frozen=True, slots=True)
class PiecewiseCubic:
    """One cubic per interval between two knots; the first and the last extend beyond the ends."""

    knots: Array  # (n,), increasing
    # (4, n - 1, …), from the third power of the distance from the left knot to the constant
    coefficients: Array

    def __call__(self, x: Array) -> Array:
        """Return the values at `x`, shape (*x.shape, *shape of the value at a knot)."""
        piece = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, self.knots.size - 2)
        third, second, first, constant = self.coefficients[:, piece]
        step = np.asarray(x - self.knots[piece])
        step = step.reshape(step.shape + (1,) * (third.ndim - step.ndim))
        square = step * step
        return np.asarray(constant + first * step + second * square + third * (square * step))


def monotone_cubic(knots: Array, values: Array) -> PiecewiseCubic:
    """Return a piecewise cubic through `values` that does not overshoot between the knots.

    It is monotone wherever the values are monotone. `knots` and `values` are (n,), with increasing
    knots and n of at least 2. At an inner knot, the slope of the cubic is the weighted harmonic
    mean of the slopes of the two adjacent intervals, and zero at an extreme value (Fritsch and
    Butland 1984). At the ends it is the slope of the parabola through three knots, limited to
    preserve the shape (Moler, Numerical Computing with MATLAB, 3.6).
    """
    width = np.diff(knots)
    slope = np.diff(values) / width
    if slope.size == 1:
        return _hermite(knots, values, np.repeat(slope, 2))
    left, right = slope[:-1], slope[1:]
    extreme = left * right <= 0
    near, far = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):  # extreme values are replaced
        mean = 1.0 / ((near / left + far / right) / (near + far))
    rates = np.concatenate(
        (
            [_end_slope(*width[:2], *slope[:2])],
            np.where(extreme, 0.0, mean),
            [_end_slope(*width[:-3:-1], *slope[:-3:-1])],
        )
    )
    return _hermite(knots, values, rates)


def _end_slope(width: float, next_width: float, slope: float, next_slope: float) -> float:
    rate = ((2 * width + next_width) * slope - width * next_slope) / (width + next_width)
    if np.sign(rate) != np.sign(slope):
        return 0.0
    if np.sign(slope) != np.sign(next_slope) and abs(rate) > 3 * abs(slope):
        return 3 * slope
    return rate


def smooth_cubic(knots: Array, values: Array) -> PiecewiseCubic:
    """Return the cubic spline through `values`, (n,) or (n, columns), with n of at least 4.

    `knots`, (n,), must increase. The second derivative is continuous. The third derivative is
    continuous at the second knot from each end ("not a knot").
    """
    from scipy.linalg import solve_banded

    n = knots.size
    width = np.diff(knots)
    step = width.reshape(-1, *(1,) * (values.ndim - 1))
    slope = np.diff(values, axis=0) / step
    bands, right = np.zeros((3, n)), np.empty(values.shape)
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = (
        width[:-1],
        2 * (width[:-1] + width[1:]),
        width[1:],
    )
    right[1:-1] = 3 * (step[1:] * slope[:-1] + step[:-1] * slope[1:])
    first, last = knots[2] - knots[0], knots[-1] - knots[-3]
    bands[1, 0], bands[0, 1] = width[1], first
    right[0] = ((step[0] + 2 * first) * step[1] * slope[0] + step[0] ** 2 * slope[1]) / first
    bands[1, -1], bands[2, -2] = width[-2], last
    right[-1] = (step[-1] ** 2 * slope[-2] + (2 * last + step[-1]) * step[-2] * slope[-1]) / last
    rates = solve_banded((1, 1), bands, right, overwrite_b=True, check_finite=False)
    return _hermite(knots, values, rates)


def _hermite(knots: Array, values: Array, rates: Array) -> PiecewiseCubic:
    """Return the cubic with the values and first derivatives `rates` at the knots."""
    width = np.diff(knots).reshape(-1, *(1,) * (values.ndim - 1))
    slope = np.diff(values, axis=0) / width
    bend = (rates[:-1] + rates[1:] - 2 * slope) / width
    return PiecewiseCubic(
        knots,
        np.stack((bend / width, (slope - rates[:-1]) / width - bend, rates[:-1], values[:-1])),
    )
