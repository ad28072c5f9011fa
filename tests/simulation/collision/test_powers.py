"""log2 and exp2 as polynomials against the functions of numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from virtual_lab.simulation.collision.powers import exp2, log2


@njit
def each(x: np.ndarray, logarithm: bool) -> np.ndarray:
    result = np.empty_like(x)
    for i in range(x.size):
        result[i] = log2(x[i]) if logarithm else exp2(x[i])
    return result


def test_log2_agrees_with_numpy() -> None:
    x = np.exp2(np.random.default_rng(1).uniform(-1000, 1000, 200_000))
    assert np.abs(each(x, True) - np.log2(x)).max() < 6e-11
    # points near 1, where the logarithm is 0, and at the seams of the polynomial
    near = 1 + np.array([-1e-3, -1e-9, 0.0, 1e-9, 1e-3])
    assert each(near, True) == pytest.approx(np.log2(near), rel=1e-10)
    seams = np.nextafter(np.repeat(np.sqrt([0.5, 2.0]), 2), [0, 9, 0, 9])
    assert np.abs(each(seams, True) - np.log2(seams)).max() < 6e-11
    assert np.array_equal(each(np.exp2(np.arange(-1000.0, 1000)), True), np.arange(-1000.0, 1000))


def test_exp2_agrees_with_numpy() -> None:
    y = np.random.default_rng(2).uniform(-1000, 1000, 200_000)
    seams = np.nextafter(np.repeat(np.arange(-4.5, 5), 2), np.tile([-9, 9], 10))
    for values in (y, seams, np.arange(-999.0, 1000)):
        assert np.abs(each(values, False) / np.exp2(values) - 1).max() < 6e-11


def test_powers_agree_with_numpy() -> None:
    """The error of the logarithm is multiplied by the exponent."""
    rng = np.random.default_rng(3)
    u, power = np.exp2(rng.uniform(-40, 3, 200_000)), rng.uniform(1, 20, 200_000)
    result = each(power * each(u, True), False)
    assert (np.abs(result / u**power - 1) / (power + 2)).max() < 6e-11
