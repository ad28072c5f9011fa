"""The behavior of a radar gun in the line of fire."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from third_party_rig.radar_record import RadarRecord
from virtual_lab.catalog.specs import Dimension
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, CalibratedSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Draws, Slots
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarGunSpec(CalibratedSpec):
    """Position and uncertainty of a radar gun."""

    kind: str
    title: str
    distance: Annotated[float, Gt(0), Dimension("length")]  # distance from the target
    distance_u: Annotated[float, Ge(0), Dimension("length")]
    scale: Annotated[float, Gt(0), Dimension("number")]  # ratio of displayed to true speed
    scale_u: Annotated[float, Ge(0), Dimension("number")]
    speed_scatter: Annotated[float, Ge(0), Dimension("speed")]
    time_jitter: Annotated[float, Ge(0), Dimension("time")]


@dataclass(frozen=True, slots=True)
class RadarGun(CalibratedInstrument[RadarGunSpec]):
    """The gun of one laboratory."""

    def watch(
        self, passage: Passage, contact: Array, draws: Draws, name: str, slots: Slots
    ) -> RadarRecord:
        """Return each ball's speeds at the gun's distance, in and back."""
        noise = draws.normal(name, 3, slots).T
        slowed = np.exp(passage.drag * self.true["distance"])
        back = np.where(passage.speed_out > 0, passage.speed_out, np.nan)
        speed_noise = self.spec.speed_scatter * noise[:2]
        return RadarRecord(
            speed_in=self.true["scale"] * passage.speed_in * slowed + speed_noise[0],
            speed_out=self.true["scale"] * back / slowed + speed_noise[1],
            turned=contact + self.spec.time_jitter * noise[2],
        )
