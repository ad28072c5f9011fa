"""The closed forms of a wall contact against step-by-step integration of the force law."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.simulation.physics.ball import (
    Event,
    HuntCrossley,
    PowerLaw,
    unloading_exponent,
    wall_contact,
)

MASS, SPEED = 0.145, 40.0


@pytest.mark.parametrize(("a", "e0", "k"), [(1.0, 0.5, 3.5e6), (1.5, 0.45, 3e7), (2.0, 1.0, 3e8)])
def test_wall_contact_is_the_integral_of_the_force_law(a: float, e0: float, k: float) -> None:
    b = (a + 1) / e0**2 - 1  # exponent from the ratio of the two areas

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


def test_a_linear_lossless_ball_stays_on_the_wall_for_half_a_spring_period() -> None:
    wall = wall_contact(*(np.array(x) for x in (MASS, SPEED, 3.5e6, 1.0, 1.0)))
    assert wall.time == pytest.approx(np.pi * np.sqrt(MASS / 3.5e6), rel=1e-12)


def test_restitution_fixes_the_unloading_exponent() -> None:
    assert unloading_exponent(np.array(1.0), np.array(0.5)) == 7
    assert unloading_exponent(np.array(1.7), np.array(1.0)) == pytest.approx(1.7)


@pytest.mark.parametrize("e0", [0.05, 0.3, 0.5, 0.9, 0.999, 1.0])
@pytest.mark.parametrize("a", [1.0, 1.5, 2.0])
def test_hunt_crossley_on_a_wall_is_the_integral_of_its_force(a: float, e0: float) -> None:
    """The quadrature of the law against step-by-step integration."""
    law = HuntCrossley.of(stiffness=3e6 * 0.01 ** (1 - a), exponent=a, restitution=e0, speed=SPEED)
    branch = law.branch(Event.TOUCH, 0.0, None)

    def motion(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -branch.force(y[0], y[1]) / MASS if y[0] > 0 else 0.0]

    def turn(_: float, y: np.ndarray) -> float:
        return float(y[1])

    def leave(_: float, y: np.ndarray) -> float:
        return float(y[0])

    turn.terminal, turn.direction = True, -1  # type: ignore[attr-defined]
    leave.terminal, leave.direction = True, -1  # type: ignore[attr-defined]
    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    first = solve_ivp(motion, (0, 0.1), [0.0, SPEED], events=turn, **tight)
    second = solve_ivp(motion, (0, 0.1), first.y[:, -1], events=leave, **tight)
    wall = law.wall_contact(MASS, SPEED)
    assert wall.compression == pytest.approx(first.y[0, -1], rel=1e-8)
    assert wall.compression_time == pytest.approx(first.t[-1], rel=1e-8)
    assert wall.expansion_time == pytest.approx(second.t[-1], rel=1e-7)
    assert -second.y[1, -1] / SPEED == pytest.approx(e0, rel=1e-8)
    forces = [branch.force(u, w) for u, w in first.y.T]
    assert wall.force >= max(forces) * (1 - 1e-9)
    assert wall.force == pytest.approx(max(forces), rel=0.02)  # coarse steps at the peak


def test_hunt_crossley_without_loss_is_the_power_law() -> None:
    wall = HuntCrossley.of(stiffness=3e7, exponent=1.5, restitution=1.0, speed=SPEED)
    closed = wall_contact(*(np.array(x) for x in (MASS, SPEED, 3e7, 1.5, 1.0)))
    for one, other in zip(wall.wall_contact(MASS, SPEED), closed, strict=True):
        assert one == pytest.approx(other, rel=1e-8)


def test_hunt_crossley_damping_follows_from_e0_and_the_force_never_pulls() -> None:
    """Its c belongs to one speed; to first order e = 1 - 2/3 c v (Hunt and Crossley)."""
    law = HuntCrossley(stiffness=3e6, exponent=1.0, damping=1e-4)
    slow = HuntCrossley.of(stiffness=3e6, exponent=1.0, restitution=1 - 2 / 3 * 1e-3, speed=10.0)
    assert slow.damping == pytest.approx(law.damping, rel=1e-3)
    assert law.branch(Event.TURN, 0.01, None).force(0.01, -2e4) == 0


def test_power_law_reloads_along_the_unloading_branch_up_to_the_peak() -> None:
    law = PowerLaw.of(stiffness=3e6, exponent=1.0, restitution=0.5, speed=SPEED)
    up = law.branch(Event.TOUCH, 0.0, None)
    down = law.branch(Event.TURN, 0.01, up)
    again = law.branch(Event.BACK, 0.008, down)
    turned = law.branch(Event.TURN, 0.009, again)
    full = law.branch(Event.FULL, 0.01, again)
    assert {again.peak, turned.peak} == {0.01}
    assert down.force(0.009, 0.0) == again.force(0.009, 0.0) == turned.force(0.009, 0.0)
    assert down.force(0.01, 0.0) == pytest.approx(up.force(0.01, 0.0))
    assert full.force(0.012, 0.0) == up.force(0.012, 0.0)
    assert law.branch(Event.TURN, 0.012, full).peak == 0.012
