"""Density of air against published values and formulas."""

import numpy as np
import pytest

from virtual_lab.relations.air import air_density, air_pressure


@pytest.mark.parametrize(
    ("celsius", "percent", "hectopascal"),
    [(20, 50, 1013.25), (15, 30, 950), (27, 70, 1050), (23, 10, 900)],
)
def test_the_density_agrees_with_the_simplified_formula_of_oiml(
    celsius: float, percent: float, hectopascal: float
) -> None:
    """OIML R 111-1:2004, E.3-1: within 2e-4 from 900 to 1100 hPa, 10 to 30 °C, below 80 %."""
    simplified = (0.34848 * hectopascal - 0.009 * percent * np.exp(0.061 * celsius)) / (
        273.15 + celsius
    )
    found = air_density(273.15 + celsius, percent / 100, 100 * hectopascal)
    assert found == pytest.approx(simplified, rel=2e-4)


def test_the_density_of_dry_air_agrees_with_iso_2533() -> None:
    """1.2250 kg/m³ at 15 °C and 1013.25 hPa (ISO 2533), of an ideal gas: 4e-4 less."""
    assert air_density(288.15, 0.0, 101325.0) == pytest.approx(1.2250, rel=5e-4)


def test_sensitivities_are_the_published_ones() -> None:
    """Of Picard et al. at 20 °C, 50 %, 1013.25 hPa: 1e-5 /Pa, -4e-3 /K, -9e-3, to their digit."""
    at = {"temperature": 293.15, "humidity": 0.5, "pressure": 101325.0}
    for name, step, published in (
        ("temperature", 0.01, -4e-3),
        ("humidity", 1e-3, -9e-3),
        ("pressure", 1.0, 1e-5),
    ):
        slope = (air_density(**at | {name: at[name] + step}) / air_density(**at) - 1) / step
        assert float(f"{slope:.0e}") == published


@pytest.mark.parametrize("density", [0.9, 1.17, 1.3])
def test_pressure_gives_the_density_back(density: float) -> None:
    temperature, humidity = np.array([288.0, 294.15, 303.0]), np.array([0.0, 0.45, 1.0])
    pressure = air_pressure(temperature, humidity, density)
    assert air_density(temperature, humidity, pressure) == pytest.approx(density, rel=1e-14)
