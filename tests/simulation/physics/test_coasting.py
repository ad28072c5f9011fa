"""The rotation of a released bat, against scipy's integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.simulation.physics.coasting import coasting, ringing

TICKS = np.linspace(0.0, 0.15, 31)
RELEASE = np.array([0.012, 0.015])


@pytest.mark.parametrize(
    ("constant", "linear", "quadratic"), [(0.8, 0.0, 0.0), (0.0, 0.5, 0.0), (0.3, 0.2, 0.03)]
)
def test_a_bat_coasts_as_its_bearing_and_the_air_slow_it(
    constant: float, linear: float, quadratic: float
) -> None:
    """ω' = -(c + l ω + q ω²) after the release: two frictions alone, then all three together."""
    rates = np.array([21.0, 14.0])
    shots, at_ticks = coasting(
        rates, TICKS, RELEASE, constant=constant, linear=linear, quadratic=quadratic
    )
    angles = shots @ at_ticks
    for curve, rate, release in zip(angles, rates, RELEASE, strict=True):
        after = release <= TICKS
        solution = solve_ivp(
            lambda _, y: [y[1], -(constant + linear * y[1] + quadratic * y[1] ** 2)],
            (release, TICKS[-1]),
            [0.0, rate],
            t_eval=TICKS[after],
            rtol=1e-11,
            atol=1e-12,
        )
        assert curve[after] == pytest.approx(solution.y[0], abs=1e-9)


def test_a_bat_rings_out_as_a_damped_oscillator() -> None:
    """Q'' + 2 ζ ω q' + ω² q = 0 for two modes, each with its own rotation of the section."""
    turn = np.array([[0.7, -1.3], [0.4, 0.9]])
    start = np.array([[2e-4, -1e-4], [0.0, 3e-4]])
    velocity = np.array([[0.1, 0.3], [-0.2, 0.0]])
    frequency, ratio = np.array([700.0, 2600.0]), 0.08
    shots, at_ticks = ringing(turn, start, velocity, frequency, ratio, TICKS, RELEASE)
    for shot, curve in enumerate(shots @ at_ticks):
        after = RELEASE[shot] <= TICKS
        expected = np.zeros(after.sum())
        for mode, omega in enumerate(frequency):
            solution = solve_ivp(
                lambda _, y, w=omega: [y[1], -2 * ratio * w * y[1] - w**2 * y[0]],
                (RELEASE[shot], TICKS[-1]),
                [start[shot, mode], velocity[shot, mode]],
                t_eval=TICKS[after],
                rtol=1e-10,
                atol=1e-14,
            )
            expected += turn[shot, mode] * solution.y[0]
        assert curve[after] == pytest.approx(expected, abs=1e-10)
