"""Worked numbers of the paper."""

import pytest

from virtual_lab.relations.swing import EnergySwing, PowerLawSwing, bat_speed
from virtual_lab.units import INCH, MPH, OZ_IN2


def test_forty_five_radians_a_second_is_about_seventy_miles_an_hour_at_six_inches() -> None:
    assert bat_speed(45.0, 34 * INCH, 6 * INCH) / MPH == pytest.approx(69.03, abs=0.005)


@pytest.mark.parametrize(
    ("exponent", "ratio"), [(0.0, 1.0), (0.5, 2**-0.5), (1 / 3, 2 ** (-1 / 3))]
)
def test_swing_speed_follows_the_power_law(exponent: float, ratio: float) -> None:
    swing = PowerLawSwing(angular_speed_0=45, inertia_0=1.7e4 * OZ_IN2, exponent=exponent)
    assert swing.angular_speed(1.7e4 * OZ_IN2) == 45
    assert swing.angular_speed(3.4e4 * OZ_IN2) == pytest.approx(45 * ratio)


def test_energy_law_lies_between_the_ends_of_the_power_law() -> None:
    heavy = EnergySwing(angular_speed_0=45, inertia_0=1.0, inertia_batter=1e9, axis_beyond_knob=0.5)
    alone = EnergySwing(angular_speed_0=45, inertia_0=1.0, inertia_batter=0.0, axis_beyond_knob=0.5)
    assert heavy.angular_speed(2.0) == pytest.approx(45)
    assert alone.angular_speed(2.0) == pytest.approx(45 * 2**-0.5)
