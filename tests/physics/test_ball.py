"""The closed forms of the wall against the law integrated step by step."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.physics.ball import unloading_exponent, wall_contact

MASS, SPEED = 0.145, 40.0


@pytest.mark.parametrize(("a", "e0", "k"), [(1.0, 0.5, 3.5e6), (1.5, 0.45, 3e7), (2.0, 1.0, 3e8)])
def test_wall_contact_is_what_the_law_integrates_to(a: float, e0: float, k: float) -> None:
    b = (a + 1) / e0**2 - 1  # from the two areas

    def load(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -k * max(y[0], 0.0) ** a / MASS]

    def turn(_: float, y: np.ndarray) -> float:
        return float(y[1])

    turn.terminal, turn.direction = True, -1  # type: ignore[attr-defined]
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(load, (0, 0.01), [0.0, SPEED], events=turn, **tight)
    peak, top = first.y[0, -1], first.t[-1]

    def unload(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -k * peak**a * (max(y[0], 0.0) / peak) ** b / MASS]

    def leave(_: float, y: np.ndarray) -> float:
        return float(y[0])

    leave.terminal, leave.direction = True, -1  # type: ignore[attr-defined]
    second = solve_ivp(unload, (0, 0.01), [peak, 0.0], events=leave, **tight)

    wall = wall_contact(*(np.array(x) for x in (MASS, SPEED, k, a, e0)))
    assert wall.compression == pytest.approx(peak, rel=1e-9)
    assert wall.force == pytest.approx(k * peak**a, rel=1e-9)
    assert wall.compression_time == pytest.approx(top, rel=1e-8)
    assert wall.expansion_time == pytest.approx(second.t[-1], rel=1e-8)
    assert -second.y[1, -1] / SPEED == pytest.approx(e0, rel=1e-9)


def test_linear_lossless_ball_is_half_a_period_of_a_spring() -> None:
    wall = wall_contact(*(np.array(x) for x in (MASS, SPEED, 3.5e6, 1.0, 1.0)))
    assert wall.time == pytest.approx(np.pi * np.sqrt(MASS / 3.5e6), rel=1e-12)


def test_restitution_fixes_the_unloading_exponent() -> None:
    assert unloading_exponent(np.array(1.0), np.array(0.5)) == 7
    assert unloading_exponent(np.array(1.7), np.array(1.0)) == pytest.approx(1.7)
