"""Worked numbers of the paper, and identities between its equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.studies.paper.equations import batted_speed_gain, energy_fractions
from virtual_lab.measurement.reduction import kinematics as k
from virtual_lab.units import INCH, OUNCE, OZ_IN2

M, Z_CM, I_CM = 31 * OUNCE, 11.3 * INCH, 2539 * OZ_IN2
fractions = st.floats(0.05, 0.95)


def test_the_worked_example_of_the_paper_is_reproduced() -> None:
    e_A = k.efficiency_from_restitution(0.5, 0.25)
    assert e_A == pytest.approx(0.2)
    assert k.besr(e_A) == pytest.approx(0.7)
    assert k.batted_speed(e_A, 1.0, 0.0) == pytest.approx(0.2)
    assert k.batted_speed(e_A, 0.0, 1.0) == pytest.approx(1.2)


def test_a_change_of_e_by_0_05_is_worth_6_4_mph() -> None:
    assert batted_speed_gain(160.0, 0.05, 0.25) == pytest.approx(6.4)
    assert batted_speed_gain(80.0, 0.05, 0.25) == pytest.approx(3.2)


def test_restitution_at_the_wrong_speed_is_worth_12_8_mph() -> None:
    slow, fast = (k.efficiency_from_restitution(e, 0.25) for e in (0.55, 0.45))
    assert (slow, fast) == (pytest.approx(0.24), pytest.approx(0.16))
    gap = k.batted_speed(slow, 90.0, 70.0) - k.batted_speed(fast, 90.0, 70.0)
    assert gap == pytest.approx(12.8)


def test_the_besr_limit_is_97_mph() -> None:
    e_A = 0.728 - 0.5
    assert k.batted_speed(e_A, 70.0, 66.0) == pytest.approx(97, abs=0.05)


@given(fractions, fractions, st.floats(10, 60), st.floats(0, 40))
def test_speeds_and_restitution_convert_both_ways(
    e: float, r: float, v_ball: float, v_bat: float
) -> None:
    e_A = k.efficiency_from_restitution(e, r)
    v_f = k.batted_speed(e_A, v_ball, v_bat)
    assert k.collision_efficiency(v_ball, v_bat, v_f) == pytest.approx(e_A, abs=1e-12)
    assert k.restitution_from_efficiency(e_A, r) == pytest.approx(e, rel=1e-12)


@given(fractions, fractions)
def test_energy_fractions_add_to_one_and_the_ball_keeps_the_square_of_its_speed(
    e: float, r: float
) -> None:
    shares = energy_fractions(e, r)
    assert sum(shares) == pytest.approx(1, rel=1e-12)
    assert shares.ball == pytest.approx(k.efficiency_from_restitution(e, r) ** 2, abs=1e-12)


@given(st.floats(0.1, 0.3), fractions, st.floats(10, 60), st.floats(0.2, 0.7), st.floats(0.1, 1))
def test_the_rebound_follows_from_the_recoil(
    m: float, e: float, v_ball: float, b: float, I_p: float
) -> None:
    r = k.recoil_factor_pivoted(m, I_p, b)
    v_f = k.efficiency_from_restitution(e, r) * v_ball
    omega = m * b * (v_ball + v_f) / I_p  # rate from the angular momentum about the pivot
    assert k.rebound_speed_from_recoil(I_p, omega, m, b, v_ball) == pytest.approx(v_f, abs=1e-10)


def test_free_and_pivoted_recoil_agree_at_the_centre_of_percussion_only() -> None:
    z_p = 28 * INCH
    I_p = k.parallel_axis(I_CM, M, z_p - Z_CM)
    place = k.centre_of_percussion(Z_CM, I_CM, M, z_p)
    assert (z_p - Z_CM) * (Z_CM - place) == pytest.approx(I_CM / M)
    for z, same in ((place, True), (place - INCH, False)):
        free = k.recoil_factor_free(0.145, M, I_CM, z - Z_CM)
        pivoted = k.recoil_factor_pivoted(0.145, I_p, z_p - z)
        assert (free == pytest.approx(pivoted, rel=1e-12)) == same


def test_the_inertia_about_the_knob_agrees_with_table_one() -> None:
    about = k.parallel_axis(2539.0, 31.0, 33 - 11.3)
    assert about == pytest.approx(17137, abs=0.5)


def test_the_equations_broadcast() -> None:
    assert np.shape(k.batted_speed(np.zeros((3, 1)), np.ones(4), 2.0)) == (3, 4)


def test_a_missing_rebound_gives_nan() -> None:
    assert np.isnan(k.collision_efficiency(30.0, 0.0, float("nan")))


def test_performance_factor_is_relative_to_the_wall() -> None:
    assert k.bat_performance_factor(0.55, 0.5) == pytest.approx(1.1)
