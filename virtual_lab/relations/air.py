"""Density of moist air by CIPM-2007.

A. Picard, R. S. Davis, M. Gläser, K. Fujii, Metrologia 45 (2008) 149, with 400 µmol/mol of carbon
dioxide. Valid from 600 to 1100 hPa and from 15 to 27 °C, with a relative standard uncertainty of
22e-6.
"""

from __future__ import annotations

import numpy as np

from virtual_lab.units import ZERO_CELSIUS, Array

FORMULA_U = 22e-6  # relative u of the formula, without the u of the readings
MASS_OVER_R = 3.483740e-3  # ratio of the molar mass of dry air to the gas constant [kg K/J]
WATER_LIGHTER = 0.3780  # 1 minus the ratio of the molar masses of water and dry air


def air_density(
    temperature: Array | float, humidity: Array | float, pressure: Array | float
) -> Array:
    """Return the density of moist air [kg/m³] by CIPM-2007, in the common shape of the arguments.

    `temperature` is in K, `pressure` in Pa, and `humidity` is the relative humidity from 0 to 1.
    Conditions outside the valid range of the formula are not rejected. NaN gives NaN.
    """
    kelvin, p = np.asarray(temperature, dtype=float), np.asarray(pressure, dtype=float)
    t = kelvin - ZERO_CELSIUS
    saturated = np.exp(
        (1.2378847e-5 * kelvin - 1.9121316e-2) * kelvin + 33.93711047 - 6.3431645e3 / kelvin
    )
    enhanced = 1.00062 + 3.14e-8 * p + 5.6e-7 * t**2
    vapour = humidity * enhanced * saturated / p  # mole fraction of water vapor
    per_kelvin = p / kelvin
    compressibility = (
        1
        - per_kelvin
        * (
            1.58123e-6
            + (-2.9331e-8 + 1.1043e-10 * t) * t
            + (5.707e-6 - 2.051e-8 * t) * vapour
            + (1.9898e-4 - 2.376e-6 * t) * vapour**2
        )
        + per_kelvin**2 * (1.83e-11 - 0.765e-8 * vapour**2)
    )
    return np.asarray(MASS_OVER_R * per_kelvin / compressibility * (1 - WATER_LIGHTER * vapour))


def air_pressure(
    temperature: Array | float, humidity: Array | float, density: Array | float
) -> Array:
    """Return the pressure [Pa] of moist air with a `density` [kg/m³], the inverse of `air_density`.

    `temperature` is in K, and `humidity` is the relative humidity from 0 to 1. The arguments
    broadcast.
    """
    over = np.asarray(temperature) / MASS_OVER_R
    pressure = density * over
    for _ in range(6):  # each step reduces the error to a hundredth
        pressure = pressure + (density - air_density(temperature, humidity, pressure)) * over
    return np.asarray(pressure)
