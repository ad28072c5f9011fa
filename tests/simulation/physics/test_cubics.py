"""Piecewise cubics against those of scipy."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator

from virtual_lab.simulation.physics.cubics import monotone_cubic, smooth_cubic
from virtual_lab.units import Array

RANDOM = np.random.default_rng(5)
KNOTS = np.cumsum(RANDOM.uniform(0.1, 1.0, 12))
BEYOND = np.linspace(KNOTS[0] - 0.3, KNOTS[-1] + 0.3, 1001)
CURVES = {
    "rough": RANDOM.normal(size=12),
    "increasing": np.cumsum(RANDOM.uniform(0, 1, 12)),
    "with level parts": np.repeat([1.0, 3.0, 3.0, 2.0], 3),
    "steep at the ends": np.array([0, 9, 1, 1.1, 1.2, 1.3, 1.2, 1.1, 1.0, 0.9, 8, -9.0]),
}


@pytest.mark.parametrize("values", CURVES.values(), ids=CURVES.keys())
@pytest.mark.parametrize(
    ("ours", "theirs"), [(monotone_cubic, PchipInterpolator), (smooth_cubic, CubicSpline)]
)
def test_a_cubic_is_that_of_scipy_at_knots_between_and_beyond(
    ours: Callable[..., Callable[[Array], Array]],
    theirs: Callable[..., Callable[[Array], Array]],
    values: Array,
) -> None:
    """The end rules of both cubics are the places where an own version is easily wrong."""
    for points in (BEYOND, KNOTS):
        expected = theirs(KNOTS, values)(points)
        np.testing.assert_allclose(ours(KNOTS, values)(points), expected, rtol=1e-12, atol=1e-12)


def test_a_monotone_cubic_of_two_knots_is_a_line() -> None:
    np.testing.assert_allclose(
        monotone_cubic(KNOTS[:2], np.array([1.0, 2.0]))(KNOTS[:2].mean()), 1.5
    )


def test_a_smooth_cubic_of_many_columns_is_that_of_each() -> None:
    columns = np.stack(list(CURVES.values()), axis=1)
    together = smooth_cubic(KNOTS, columns)(BEYOND)
    alone = np.stack([smooth_cubic(KNOTS, each)(BEYOND) for each in columns.T], axis=1)
    np.testing.assert_allclose(together, alone, rtol=1e-13)
