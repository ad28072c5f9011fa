"""Units against their legal definitions, in exact rational arithmetic."""

from fractions import Fraction
from math import isclose, radians

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from virtual_lab import units

# International yard and pound agreement of 1959: 1 yd = 0.9144 m, 1 lb = 0.45359237 kg exactly;
# 1 yd = 36 in, 1 mile = 1760 yd, 1 lb = 16 oz avoirdupois. The rest are SI prefixes.
INCH = Fraction(9144, 10000) / 36
POUND = Fraction(45359237, 10**8)
OUNCE = POUND / 16
MPH = 1760 * Fraction(9144, 10000) / 3600
DEFINED: dict[str, dict[str, Fraction]] = {
    "length": {
        "m": Fraction(1),
        "mm": Fraction(1, 1000),
        "cm": Fraction(1, 100),
        "in": INCH,
        "um": Fraction(1, 10**6),
    },
    "mass": {"kg": Fraction(1), "g": Fraction(1, 1000), "oz": OUNCE, "lb": POUND},
    "inertia": {"kg m^2": Fraction(1), "oz in^2": OUNCE * INCH**2},
    "moment": {"kg m": Fraction(1), "oz in": OUNCE * INCH},
    "speed": {"m/s": Fraction(1), "mph": MPH},
    "slope of speed": {"s/m": Fraction(1), "1/mph": 1 / MPH},
    "slope of length": {"1/m": Fraction(1), "1/in": 1 / INCH},
    "time": {
        "s": Fraction(1),
        "ms": Fraction(1, 1000),
        "us": Fraction(1, 10**6),
        "min": Fraction(60),
    },
    "frequency": {"Hz": Fraction(1), "kHz": Fraction(1000)},
    "angle": {
        "rad": Fraction(1),
        "mrad": Fraction(1, 1000),
        "deg": Fraction(radians(180)) / 180,
    },
    "angular speed": {"rad/s": Fraction(1)},
    "angular acceleration": {"rad/s^2": Fraction(1)},
    "rate": {"1/s": Fraction(1)},
    "density": {"kg/m^3": Fraction(1)},
    "modulus": {"Pa": Fraction(1), "MPa": Fraction(10**6), "GPa": Fraction(10**9)},
    "temperature": {"K": Fraction(1), "mK": Fraction(1, 1000)},
    "temperature difference": {"K": Fraction(1), "mK": Fraction(1, 1000)},
    "pressure": {"Pa": Fraction(1), "hPa": Fraction(100), "kPa": Fraction(1000)},
    "acceleration": {"m/s^2": Fraction(1), "in/s^2": INCH},
    "stiffness": {"N/m^a": Fraction(1)},
    "torque": {"N m": Fraction(1)},
    "viscous torque": {"N m s": Fraction(1)},
    "quadratic torque": {"N m s^2": Fraction(1)},
    "number": {"1": Fraction(1), "%": Fraction(1, 100), "ppm": Fraction(1, 10**6)},
}
EVERY = [
    (dimension, unit)
    for dimension, known in units.DIMENSIONS.items()
    for unit in known
    if unit not in units.CELSIUS
]
ROUNDING = 4e-16  # relative size of two roundings of a double


def test_constants_are_the_legal_ones() -> None:
    """Agreement of 1959 (NIST SP 811, B.8); standard gravity: 3rd CGPM 1901."""
    assert Fraction(units.INCH).limit_denominator(10**9) == INCH == Fraction(254, 10000)
    assert units.POUND == 0.45359237
    assert units.OUNCE == 0.028349523125
    assert units.MPH == 0.44704
    assert units.STANDARD_GRAVITY == 9.80665
    assert isclose(16 * units.OZ_IN2, 2.926397e-4, rel_tol=2e-7)  # NIST SP 811: 1 lb in^2


@pytest.mark.parametrize(("dimension", "unit"), EVERY)
def test_the_factor_of_every_unit_is_its_definition(dimension: str, unit: str) -> None:
    """The oracle is a fraction from the definitions above; a unit without one fails here."""
    defined = DEFINED[dimension][unit]
    assert isclose(units.to_si(1.0, unit, dimension), defined, rel_tol=ROUNDING)


@pytest.mark.parametrize(("dimension", "unit"), EVERY)
@given(value=st.floats(1e-250, 1e250) | st.floats(-1e250, -1e-250) | st.just(0.0))
@settings(max_examples=20)
def test_conversion_there_and_back_returns_the_value(
    dimension: str, unit: str, value: float
) -> None:
    """A product and its quotient differ from the start by at most two roundings (IEEE 754)."""
    back = units.from_si(units.to_si(value, unit, dimension), unit, dimension)
    assert isclose(back, value, rel_tol=ROUNDING)


def test_60_mph_are_26_8224_m_per_s() -> None:
    assert isclose(units.miles_per_hour(26.8224), 60.0, rel_tol=ROUNDING)  # 60 mph = 88 ft/s


@pytest.mark.parametrize(("unit", "dimension"), [("kg", "length"), ("ft", "length"), ("", "mass")])
def test_a_unit_of_another_dimension_is_refused(unit: str, dimension: str) -> None:
    """The conversion raises the documented `KeyError`."""
    with pytest.raises(KeyError):
        units.to_si(1.0, unit, dimension)
    with pytest.raises(KeyError):
        units.from_si(1.0, unit, dimension)


@pytest.mark.parametrize("unit", units.CELSIUS)
def test_water_freezes_at_0_degrees_celsius(unit: str) -> None:
    """0 °C are 273.15 K exactly; a difference of temperature has no zero."""
    assert units.to_si(0.0, unit, "temperature") == 273.15
    assert units.from_si(294.15, unit, "temperature") == units.convert(294.15, "K", unit) == 21.0
    with pytest.raises(KeyError):
        units.to_si(1.0, unit, "temperature difference")
