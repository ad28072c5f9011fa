"""Coasting and flight in closed form against scipy's integrators and known limits."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.relations.flight import distance_after, speed_after, time_after
from virtual_lab.simulation.physics.coasting import (
    coasting,
    slowed,
    time_to_rest,
    time_to_turn,
    turned,
)

FRICTIONS = [  # the sign of linear² - 4 constant quadratic: plus, minus, none, and each alone
    {"constant": 0.1, "linear": 0.5, "quadratic": 0.01},
    {"constant": 3.0, "linear": 0.1, "quadratic": 0.02},
    {"constant": 1.0, "linear": 0.2, "quadratic": 0.01},
    {"constant": 2.0, "linear": 0.0, "quadratic": 0.0},
    {"constant": 0.0, "linear": 1.5, "quadratic": 0.0},
    {"constant": 0.0, "linear": 0.0, "quadratic": 0.05},
    {"constant": 0.0, "linear": 0.0, "quadratic": 0.0},
]


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize("rate", [25.0, -25.0])
def test_coasting_solves_its_equation(friction: dict[str, float], rate: float) -> None:
    c, k, q = friction.values()

    def slope(_: float, y: list[float]) -> list[float]:
        return [y[1], -np.sign(y[1]) * (c + k * abs(y[1]) + q * y[1] ** 2)]

    times = np.linspace(0.0, 0.5, 6)
    true = solve_ivp(slope, (0, 0.5), [0.0, rate], "DOP853", times, rtol=1e-13, atol=1e-13)
    rates = np.full(6, rate)
    assert slowed(rates, times, **friction) == pytest.approx(true.y[1], rel=1e-11)
    assert turned(rates, times, **friction) == pytest.approx(true.y[0], rel=1e-11)


def test_a_bat_that_rests_stays_at_rest() -> None:
    friction = FRICTIONS[1]
    rate = np.array([0.0, 4.0, -4.0])
    rest = time_to_rest(rate, **friction)
    assert rest[0] == 0
    assert rest[1] == rest[2] > 0
    slow = slowed(rate, rest * (1 - 1e-6), **friction)
    assert slow[1:] == pytest.approx([3e-6 * rest[1], -3e-6 * rest[1]], rel=1e-3)
    assert slowed(rate, rest + 10, **friction).tolist() == [0, 0, 0]
    ends = turned(rate, rest, **friction)
    assert turned(rate, rest + 10, **friction) == pytest.approx(ends, rel=1e-15)
    assert time_to_rest(rate, **FRICTIONS[4]).tolist() == [0, np.inf, np.inf]
    assert time_to_rest(rate, **FRICTIONS[3]) == pytest.approx([0, 2, 2])


@pytest.mark.parametrize("friction", FRICTIONS)
def test_the_time_of_an_angle_turns_it(friction: dict[str, float]) -> None:
    rate = np.array([25.0, -25.0, 0.0])
    way = np.array([0.8, -0.8, 0.8])
    time = time_to_turn(rate, way, **friction)
    assert time[2] == np.inf
    assert turned(rate[:2], time[:2], **friction) == pytest.approx(way[:2], rel=1e-13)


def test_an_angle_beyond_rest_is_never_turned() -> None:
    rate = np.array([4.0, -4.0])
    whole = turned(rate, np.full(2, 10.0), **FRICTIONS[1])
    assert np.isfinite(time_to_turn(rate, 0.99 * whole, **FRICTIONS[1])).all()
    assert time_to_turn(rate, 1.01 * whole, **FRICTIONS[1]).tolist() == [np.inf, np.inf]


def test_both_ways_to_coast_agree() -> None:
    friction = {"constant": 0.1, "linear": 0.01, "quadratic": 0.0105}
    times = np.linspace(0, 0.3, 7)
    shots, ticks = coasting(np.array([20.0]), times, np.zeros(1), **friction)
    series = (shots @ ticks)[0]
    assert turned(np.full(7, 20.0), times, **friction) == pytest.approx(series, rel=1e-12)


def test_flight_is_turned_round() -> None:
    """The way flown in the time a way takes is that way; without air it is speed times time."""
    for drag in (0.0, 1e-12, 0.006, 0.5):
        time = time_after(2.0, 30.0, drag)
        assert distance_after(time, 30.0, drag) == pytest.approx(2.0, rel=1e-13)
        assert speed_after(time, 30.0, drag) == pytest.approx(30 * np.exp(-2 * drag), rel=1e-13)
    assert distance_after(0.1, 30.0, 0.0) == 3.0
    assert distance_after(0.0, 30.0, 0.006) == 0.0
