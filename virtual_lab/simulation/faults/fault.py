"""What a fault is: hooks at the seams where a day in the laboratory can go wrong.

A fault changes what is true or what is written down, never what a reduction makes of it; the
calibrations stay as the laboratory believes them unless the fault is in the believing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import Record
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Specimen, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["BaseFault", "Fault", "altered", "edited", "other_sheet", "some"]


class Fault(Protocol):
    """One thing that goes wrong; each hook returns what it was given where nothing does."""

    @property
    def name(self) -> str: ...
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
    """A sound day, and the base of the faults: each has a name and the hooks it needs."""

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


def altered(station: Station, part: str, **true: float) -> Station:
    """Return a station with some true constants of one of its instruments changed."""
    whole: Any = station
    changed: Station = replace(whole, **{part: getattr(whole, part).altered(**true)})
    return changed


def other_sheet(station: Station, part: str, **changes: Any) -> Station:
    """Return a station one of whose instruments is not what its sheet says."""
    whole: Any = station
    instrument = getattr(whole, part)
    spec = replace(instrument.spec, **changes)
    changed: Station = replace(whole, **{part: replace(instrument, spec=spec)})
    return changed


def edited(play: RigOutput, channel: str, **arrays: Any) -> Mapping[str, Record]:
    """Return a play's records with some arrays of one channel changed."""
    record: Any = play.records[channel]
    return {**play.records, channel: replace(record, **arrays)}


def some(share: float, order: ShotPlan, draws: Draws, name: str) -> NDArray[np.bool_]:
    """Return which shots a fault that comes and goes strikes, a `share` of them, (shot,)."""
    return np.asarray(draws.uniform(f"fault.{name}", slots=order.slot) + 0.5 < share)
