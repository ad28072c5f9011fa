"""The density of the air from readings of thermometer, hygrometer and barometer."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.records import ClimateReadings
from virtual_lab.records.block import SessionBlock
from virtual_lab.relations.air import FORMULA_U, air_density
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.units import Array

DENSITY = "hall.air.density"
LOGGER = "bench.climate."  # prefix of the constants used for the density
ALLOWED = {  # ranges of the readings in which the formula is accurate enough [SI]
    "temperature": (263.15, 323.15),
    "humidity": (0.0, 1.0),
    "pressure": (5e4, 1.1e5),
}


def climate_readings(block: SessionBlock, channel: str = "climate") -> ClimateReadings | None:
    """Return the climate readings in the hall, or with `channel` "store" in the ball store.

    The readings of all laboratories follow one another, (reading,). Return None if there is no such
    record. Raises `InputError` for another kind of record, and for a reading outside the ranges
    `ALLOWED`. In these ranges the formula of the air density is valid.
    """
    record = block.records.get("bench", {}).get(channel)
    if record is None:
        return None
    if not isinstance(record, ClimateReadings):
        kind = type(record).__name__
        raise InputError(f"bench/{channel}", "record", kind, "expected climate readings")
    for name, (low, high) in ALLOWED.items():
        values = getattr(record, name)
        if (wrong := values[(values < low) | (values > high)]).size:
            column = record.columns[name].name
            raise InputError(f"bench/{channel}", column, wrong[0], f"allowed: {low:g} to {high:g}")
    return record


def climate(block: SessionBlock, record: ClimateReadings) -> dict[str, tuple[Array, Array]]:
    """Return the corrected climate readings with their standard uncertainties, keyed by name.

    The keys are ``temperature`` [K], ``humidity`` (relative, 0 to 1) and ``pressure`` [Pa]. Each
    value is a pair: the readings, (laboratory, reading), and their u, (laboratory, 1). All readings
    of a laboratory have the same u. Raises `KeyError` if a calibration constant of the climate
    logger is missing.
    """
    values = {}
    for name in ALLOWED:
        calibration = block.calibration[f"{LOGGER}{name}"]
        step = block.calibration[f"{LOGGER}{name}_resolution"].value
        readings = getattr(record, name).reshape(block.laboratories, -1)
        values[name] = (
            readings - calibration.value[:, None],
            np.hypot(calibration.u, step / sqrt(12))[:, None],
        )
    return values


def measured_density(block: SessionBlock) -> Estimates | None:
    """Return the mean density of the air during each test [kg/m³], with u, (laboratory,).

    Return None if there are no climate readings. u includes the u of the instruments and of the
    formula. The range of the densities during the test adds a component to u, with a uniform
    distribution (GUM 4.3.7). Raises the errors of `climate_readings` and `climate`.
    """
    record = climate_readings(block)
    if record is None:
        return None
    of_each = climate(block, record)
    best = {name: values for name, (values, _) in of_each.items()}
    density = air_density(**best)
    parts = [
        (air_density(**best | {name: values + u}) - density).mean(axis=1)
        for name, (values, u) in of_each.items()
    ]
    mean = density.mean(axis=1)
    parts += [FORMULA_U * mean, np.ptp(density, axis=1) / sqrt(12)]
    return Estimates(
        value=mean,
        u=np.sqrt(np.sum(np.square(parts), axis=0)),
        dof=np.full(mean.shape, inf),
        source="CIPM-2007, from bench/climate",
    )
