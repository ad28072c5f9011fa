"""What a fault is: hooks at the seams where a day in the laboratory can go wrong.

A fault changes what is true or what is written down, never what a reduction makes of it; the
calibrations stay as the laboratory believes them unless the fault is in the believing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import Record
from virtual_lab.simulation.instruments import FittedStation
from virtual_lab.simulation.rig import Rig, RigOutput, ShotPlan, Specimen, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = [
    "BaseFault",
    "ConstantOff",
    "Fault",
    "SheetOff",
    "edited",
    "fitted_with",
    "instrument_of",
    "other_sheet",
    "some",
]


class Fault(Protocol):
    """One thing that goes wrong; each hook returns what it was given where nothing does."""

    @property
    def name(self) -> str: ...
    def befalls(self, rig: Rig, station: Station) -> bool:
        """Return whether it can befall an impact rig, by what that and its station offer."""
        ...

    def station(self, stage: Stage, station: Station) -> Station:
        """Return the rig of a stage as it really stands."""
        ...

    def specimen(self, stage: Stage, specimen: Specimen) -> Specimen:
        """Return the bat and the balls that really are on the rig."""
        ...

    def order(self, stage: Stage, order: ShotPlan) -> ShotPlan:
        """Return what the machine really does; the log keeps what was asked."""
        ...

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Mapping[str, Record]:
        """Return the records by channel as they were written down."""
        ...

    def calibration(self, known: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        """Return the constants as they were entered."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseFault:
    """A sound day, and the base of the faults: each has a name and the hooks it needs.

    `written` is the channel that an impact rig must have for the fault to befall it.
    """

    written: ClassVar[str] = ""

    def befalls(self, rig: Rig, station: Station) -> bool:
        return not self.written or self.written in rig.channels

    def station(self, stage: Stage, station: Station) -> Station:
        return station

    def specimen(self, stage: Stage, specimen: Specimen) -> Specimen:
        return specimen

    def order(self, stage: Stage, order: ShotPlan) -> ShotPlan:
        return order

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Mapping[str, Record]:
        return play.records

    def calibration(self, known: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        return known


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantOff(BaseFault):
    """A true constant of an instrument is not what its calibration says."""

    name: str
    stage: Stage = Stage.IMPACT
    part: str  # the instrument
    constant: str  # or the last of several that are numbered
    times: float = 1.0
    plus: float = 0.0

    def befalls(self, rig: Rig, station: Station) -> bool:
        return self.stage is not Stage.IMPACT or bool(self._constants(station))

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not self.stage:
            return station
        instrument = instrument_of(station, self.part)
        key = self._constants(station)[-1]
        true = {key: instrument.true[key] * self.times + self.plus}
        return fitted_with(station, self.part, instrument.altered(**true))

    def _constants(self, station: Station) -> list[str]:
        true = getattr(instrument_of(station, self.part), "true", {})
        return [key for key in true if key.rstrip("_0123456789") == self.constant]


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetOff(BaseFault):
    """An instrument is not what its sheet says."""

    name: str
    stage: Stage = Stage.IMPACT
    part: str
    values: Mapping[str, float]

    def befalls(self, rig: Rig, station: Station) -> bool:
        return self.stage is not Stage.IMPACT or self._offered(station)

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not self.stage or not self._offered(station):
            return station
        return other_sheet(station, self.part, **self.values)

    def _offered(self, station: Station) -> bool:
        spec = getattr(instrument_of(station, self.part), "spec", None)
        return spec is not None and self.values.keys() <= {part.name for part in fields(spec)}


def instrument_of(station: Station, part: str) -> Any:
    """Return an instrument of a station by its name, None where it offers none."""
    return station.instruments().get(part) if isinstance(station, FittedStation) else None


def fitted_with(station: Station, part: str, instrument: Any) -> Station:
    """Return the station with another instrument of this name."""
    fitted: Any = station
    changed: Station = fitted.with_instrument(part, instrument)
    return changed


def other_sheet(station: Station, part: str, **changes: Any) -> Station:
    """Return a station one of whose instruments is not what its sheet says."""
    instrument = instrument_of(station, part)
    spec = replace(instrument.spec, **changes)
    return fitted_with(station, part, replace(instrument, spec=spec))


def edited(play: RigOutput, channel: str, **arrays: Any) -> Mapping[str, Record]:
    """Return a play's records with some arrays of one channel changed."""
    record: Any = play.records[channel]
    return {**play.records, channel: replace(record, **arrays)}


def some(share: float, order: ShotPlan, draws: Draws, name: str) -> NDArray[np.bool_]:
    """Return which shots a fault that comes and goes strikes, a `share` of them, (shot,)."""
    return np.asarray(draws.uniform(f"fault.{name}", slots=order.slot) + 0.5 < share)
