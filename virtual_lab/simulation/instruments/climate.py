"""The climate of the hall at the start and the end of a test, and the logger that measures it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import ClimateReadings
from virtual_lab.relations.air import air_pressure
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    TrueConstant,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate

POSSIBLE = 0.05, 0.95  # range of the relative humidity
SHOWN = ("temperature", "humidity", "pressure")
Kelvin = Annotated[float, Ge(0), Dimension("temperature difference")]
Share = Annotated[float, Ge(0), Le(1), Dimension("number")]
Pascal = Annotated[float, Ge(0), Dimension("pressure")]


@dataclass(frozen=True, slots=True, kw_only=True)
class HallSpec(Spec):
    """Temperature and relative humidity: mean, spread from day to day, and change during a test.

    For a store of balls, the spread of the humidity is that from lot to lot.
    """

    temperature: Annotated[float, Gt(0), Dimension("temperature")]
    temperature_spread: Kelvin
    temperature_change: Kelvin
    humidity: Share
    humidity_spread: Share
    humidity_change: Share

    def draw_humidity(
        self, draws: Draws, name: str, slots: Slots | None = None
    ) -> NDArray[np.float64]:
        """Draw the relative humidity in which a lot is kept, 0 to 1, one per laboratory."""
        damp = self.humidity + self.humidity_spread * draws.normal(name, (), slots)
        return np.clip(damp, *POSSIBLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClimateLoggerSpec(CalibratedSpec):
    """Errors of thermometer, hygrometer and barometer, and their smallest steps."""

    kind: str
    title: str
    temperature: Annotated[float, Dimension("temperature difference")]
    temperature_u: Kelvin
    temperature_resolution: Kelvin
    humidity: Annotated[float, Dimension("number")]
    humidity_u: Share
    humidity_resolution: Share
    pressure: Annotated[float, Dimension("pressure")]
    pressure_u: Pascal
    pressure_resolution: Pascal


@dataclass(frozen=True, slots=True)
class ClimateLogger(CalibratedInstrument[ClimateLoggerSpec]):
    """The logger of one hall."""

    def exact(self) -> dict[str, Estimate]:
        steps = (f"{name}_resolution" for name in SHOWN)
        return {step: Estimate(value=getattr(self.spec, step)) for step in steps}

    def read(
        self,
        hall: HallSpec,
        density: TrueConstant,
        draws: Draws,
        name: str,
        store: NDArray[np.float64] | None = None,
    ) -> ClimateReadings:
        """Read the climate of a day on which the air has a density [kg/m³], start and end.

        Readings of a block are in the order of the laboratories. `store` is the mean relative
        humidity of a store, (laboratory,); None: it is drawn.
        """
        chance = draws.normal(name, 4)
        ends = np.array([-0.5, 0.5])
        temperature, humidity = (
            mean + spread * chance[..., at, None] + change * chance[..., at + 1, None] * ends
            for at, mean, spread, change in (
                (0, hall.temperature, hall.temperature_spread, hall.temperature_change),
                (2, hall.humidity, hall.humidity_spread, hall.humidity_change),
            )
        )
        if store is not None:
            humidity = store[..., None] + hall.humidity_change * chance[..., 3, None] * ends
        humidity = np.clip(humidity, *POSSIBLE)
        pressure = air_pressure(temperature, humidity, np.asarray(density)[..., None])
        readings = {
            name: quantise(
                values + np.asarray(self.true[name])[..., None],
                getattr(self.spec, f"{name}_resolution"),
            ).ravel()
            for name, values in zip(SHOWN, (temperature, humidity, pressure), strict=True)
        }
        return ClimateReadings(**readings)
