"""Exact constants, and conversions of units in files and printed output to SI.

Every constant is exact by definition. A laboratory uses its local acceleration of gravity, not the
standard value. A Python name for a number that is not in SI ends in its unit (``speed_mph``).
Numbers in files have units that `to_si` and `from_si` convert. Every package may import this
module, so it also has the types of arrays and the options of compiled functions.
"""

from __future__ import annotations

from math import pi
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]  # in SI; docstrings give shapes
Mask = NDArray[np.bool_]
Value = TypeVar("Value", float, Array)

# options of kernels called from Python: no wrapper for C, which takes time to compile
KERNEL: dict[str, Any] = {"cache": True, "no_cfunc_wrapper": True}
# Options of functions that only kernels call: no wrapper at all, and no cache. The compiled code of
# such a function is in the cache of its callers. If it had a cache of its own, a caller compiled in
# a later process could not inline it, and the last bits of its sums would differ.
INNER: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

INCH = 0.0254  # m
POUND = 0.45359237  # kg
OUNCE = POUND / 16  # kg
MPH = 0.44704  # m/s
STANDARD_GRAVITY = 9.80665  # m/s^2
OZ_IN2 = OUNCE * INCH**2  # kg m^2
DEGREE = pi / 180  # rad
MILLISECOND = 1e-3  # s
ZERO_CELSIUS = 273.15  # K
CELSIUS = ("degC", "°C")  # units whose zero is not that of the SI unit

DIMENSIONS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": INCH, "um": 1e-6},
    "mass": {"kg": 1.0, "g": 1e-3, "oz": OUNCE, "lb": POUND},
    "inertia": {"kg m^2": 1.0, "oz in^2": OZ_IN2},
    "moment": {"kg m": 1.0, "oz in": OUNCE * INCH},
    "speed": {"m/s": 1.0, "mph": MPH},
    "slope of speed": {"s/m": 1.0, "1/mph": 1 / MPH},
    "slope of length": {"1/m": 1.0, "1/in": 1 / INCH},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE},
    "angular speed": {"rad/s": 1.0},
    "angular acceleration": {"rad/s^2": 1.0},
    "rate": {"1/s": 1.0},
    "density": {"kg/m^3": 1.0},
    "temperature": {"K": 1.0, "mK": 1e-3, "degC": 1.0, "°C": 1.0},  # 0 °C is `ZERO_CELSIUS`
    "temperature difference": {"K": 1.0, "mK": 1e-3},
    "pressure": {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3},
    "modulus": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
    "acceleration": {"m/s^2": 1.0, "in/s^2": INCH},
    "stiffness": {"N/m^a": 1.0},
    "torque": {"N m": 1.0},
    "viscous torque": {"N m s": 1.0},
    "quadratic torque": {"N m s^2": 1.0},
    "number": {"1": 1.0, "%": 1e-2, "ppm": 1e-6},
}


def to_si(value: Value, unit: str, dimension: str) -> Value:
    """Return `value` converted from `unit` to the SI unit of `dimension`.

    `dimension` is a key of `DIMENSIONS`, such as "speed", and `unit` is one of its units, such as
    "mph". Raises `KeyError` for another dimension or unit.
    """
    number = value * DIMENSIONS[dimension][unit]
    return number + ZERO_CELSIUS if unit in CELSIUS else number


def from_si(value: float, unit: str, dimension: str) -> float:
    """Return `value` converted from the SI unit of `dimension` to `unit`.

    `dimension` is a key of `DIMENSIONS`, such as "speed", and `unit` is one of its units, such as
    "mph". Raises `KeyError` for another dimension or unit.
    """
    number = value - ZERO_CELSIUS if unit in CELSIUS else value
    return number / DIMENSIONS[dimension][unit]


def suffix(unit: str) -> str:
    """Return `unit` as the ending of a name: ``m_per_s`` for m/s, ``kg_m2`` for kg m^2."""
    return unit.replace("/", "_per_").replace(" ", "_").replace("^", "")


def name_with_unit(name: str, unit: str) -> str:
    """Return the name of a column with its unit as the ending, such as ``speed_m_per_s``.

    If `unit` is "" or "1", the name is returned unchanged.
    """
    return f"{name}_{suffix(unit)}" if unit not in ("", "1") else name


def convert(value: float, unit: str, target: str) -> float:
    """Return `value` converted from `unit` to `target`, a unit of the same dimension.

    The allowed units are those in `DIMENSIONS`. If `unit` and `target` are equal, `value` is
    returned without a check. Raises `ValueError` for units of different dimensions, and for an
    unknown unit.
    """
    if unit == target:
        return value
    for dimension, units in DIMENSIONS.items():
        if unit in units and target in units:
            return from_si(to_si(value, unit, dimension), target, dimension)
    raise ValueError(f"{unit} and {target} are units of different dimensions")


def miles_per_hour(speed: float) -> float:
    """Return a speed in mph, converted from `speed` in m/s."""
    return speed / MPH
