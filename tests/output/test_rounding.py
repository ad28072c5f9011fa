"""Rounding by hand: an uncertainty has two digits, and its value the same decimals."""

import re

import pytest

from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import (
    decimals,
    digits,
    limit_message,
    with_axis_unit,
    with_uncertainty,
    with_unit,
)
from virtual_lab.units import MPH


@pytest.mark.parametrize(
    ("value", "u", "printed"),
    [
        (0.94702, 0.00481, "0.9470 (u 0.0048)"),
        (0.5, 0.00996, "0.500 (u 0.010)"),  # carries: 0.0100 would have three digits
        (0.5, 0.00994, "0.5000 (u 0.0099)"),
        (97.3, 0.996, "97.3 (u 1.0)"),
        (97.3, 0.0996, "97.30 (u 0.10)"),
        (31169.6, 12.4, "31170 (u 12)"),
        (31169.6, 99.6, "31170 (u 100)"),  # no decimal is left to take away
        (0.52, 2.4e-8, "0.520000000 (u 0.000000024)"),
        (-0.0021, 0.0007, "-0.00210 (u 0.00070)"),
    ],
)
def test_an_uncertainty_has_two_digits_and_its_value_the_same_place(
    value: float, u: float, printed: str
) -> None:
    assert with_uncertainty(value, u) == printed
    assert digits(u) == printed.rsplit(" ", maxsplit=1)[-1].rstrip(")")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (12.1, "12.1 of 3.0 to 12.0"),
        (12.0499, "12.05 of 3.00 to 12.00"),
        (12.00004, "12.00004 of 3.00000 to 12.00000"),
        (2.96, "2.96 of 3.00 to 12.00"),
        (12.0, "12.0 of 3.0 to 12.0"),  # within the limits
        (3.0, "3.0 of 3.0 to 12.0"),
        (float("nan"), "nan of 3.0 to 12.0"),
    ],
)
def test_a_value_beyond_its_limit_looks_so(value: float, shown: str) -> None:
    assert limit_message("{0:.{d}f} of {1:.{d}f} to {2:.{d}f}", value, 3.0, 12.0, 1) == shown


@pytest.mark.parametrize("u", [0.0, 9.6e-17, 5.0e-14])
def test_an_uncertainty_of_the_computers_own_arithmetic_is_none(u: float) -> None:
    """Numbers near 1 have a last bit of 2e-16; they get six decimals, not eighteen."""
    assert with_uncertainty(0.946841641506381726, u) == "0.946842 (u 0)"
    assert decimals(u) == 6


@pytest.mark.parametrize("u", [float("inf"), float("nan")])
def test_an_uncertainty_that_is_not_finite_is_printed_as_such(u: float) -> None:
    assert with_uncertainty(0.5, u) == f"0.500000 (u {u})"


@pytest.mark.parametrize("power", range(-6, 3))
def test_any_uncertainty_is_printed_within_half_its_second_digit(power: int) -> None:
    for mantissa in range(100, 1000):
        u = mantissa * 10.0**power / 100
        said = digits(u)
        assert abs(float(said) - u) <= max(0.05 * 10.0**power, 0.5) * 1.000001, u
        if power < 1:
            assert len(re.sub(r"^0\.0*", "", said).replace(".", "")) == 2, (u, said)


def test_a_limit_is_printed_in_the_unit_of_its_metric() -> None:
    """98.6 mph are 44.078 m/s."""
    assert METRICS["batted_speed"].limit(98.6 * MPH) == "98.6 mph (44.1 m/s)"
    assert METRICS["restitution"].limit(0.5) == "0.500"
    assert METRICS["restitution"].limit(0.50117, more=1) == "0.5012"


def test_a_speed_is_printed_in_both_units() -> None:
    """60 mph are 88 ft/s = 26.8224 m/s."""
    assert with_unit(60.0, "mph", ".2f") == "60.00 mph (26.82 m/s)"
    assert with_unit(26.8224, "m/s", ".2f") == "26.82 m/s (60.00 mph)"
    assert (with_unit(0.5, "", ".2f"), with_unit(0.5, "m", ".1f")) == ("0.50", "0.5 m")
    assert limit_message("{0:.{d}f} mph ({3:.{d}f} m/s)", 60.0, 0, 50, 1) == "60.0 mph (26.8 m/s)"
    assert with_axis_unit("v_f", "mph") == "v_f, mph (1 mph = 0.447 m/s)"
    assert with_axis_unit("e", "") == "e"
