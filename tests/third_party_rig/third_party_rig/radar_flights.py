"""Flights from the record of the radar gun, with the methods that the reduction requires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from third_party_rig.radar_record import RadarRecord
from virtual_lab.measurement.reduction.flights import Constants, Flights, RawFlights, RawFlightsU
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array, Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarReadings:
    """Readings of a stage's balls. The gun sees no heights, so aim marks replace them."""

    stage: str
    raw: RawFlights
    shows_height: bool = False

    @classmethod
    def of(cls, record: RadarRecord, known: Mapping[str, Estimate], stage: str) -> Self:
        return cls(
            stage=stage,
            raw=RawFlights(
                speed_in=record.speed_in,
                speed_out=record.speed_out,
                contact=record.turned,
                misfit=np.full((record.speed_in.size, 2), np.nan),
                complete=np.isfinite(record.speed_in),
            ),
        )

    @property
    def raw_u(self) -> RawFlightsU:
        return RawFlightsU.nan_like(self.raw.speed_in)

    def correct(self, x: Constants, drag: Array) -> Flights:
        """Return speeds at the target, v exp(∓κ d) with the gun's distance d, from dv/dx = -κ v."""
        scale, distance = (x[f"{self.stage}.radar.{name}"] for name in ("scale", "distance"))
        speed_in = self.raw.speed_in / scale * np.exp(-drag * distance)
        unseen = np.full(speed_in.shape, np.nan)
        return Flights(
            speed_in=speed_in,
            speed_out=self.raw.speed_out / scale * np.exp(drag * distance),
            offset=unseen,
            slope_in=unseen,
            slope_out=unseen,
        )

    def clock(self, x: Constants) -> Array:
        """Return 1, because no encoder shares the gun's clock."""
        return np.ones(1)

    def part(self, chosen: Mask) -> Self:
        return replace(self, raw=self.raw.part(chosen))
