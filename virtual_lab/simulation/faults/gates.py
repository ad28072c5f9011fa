"""Faults of what times the ball: the gates at the bat and those at the wall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import BoardRecord, Record
from virtual_lab.simulation.faults.fault import BaseFault, Fault, altered, edited, other_sheet, some
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Stage, Station
from virtual_lab.streams import Draws

__all__ = ["FAULTS"]

Records = Mapping[str, Record]
Array = NDArray[np.float64]
NEAR, FAR = -1, 0  # gates count from the cannon to the target
INBOUND, OUTBOUND = 0, 1
BROKE, CLEARED = 0, 1


@dataclass(frozen=True, slots=True, kw_only=True)
class GateMoved(BaseFault):
    """The gate nearest the bat was knocked toward the cannon after its survey."""

    name: ClassVar[str] = "gate-moved"
    shift: float = 1e-3  # m

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        distances = _gates(station).distances
        near = {f"distance_{len(distances) - 1}": distances[NEAR] + self.shift}
        return altered(station, "gates", **near)


@dataclass(frozen=True, slots=True, kw_only=True)
class GateClock(BaseFault):
    """The recorder's clock runs fast, far more than its sheet allows."""

    name: ClassVar[str] = "gate-clock"
    fast: float = 100e-6

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return altered(station, "gates", clock=_gates(station).clock * (1 + self.fast))


@dataclass(frozen=True, slots=True, kw_only=True)
class GateMisses(BaseFault):
    """The gate nearest the bat does not see every second ball that comes in."""

    name: ClassVar[str] = "gate-misses"

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        times = _times(play).copy()
        times[order.slot % 2 == 1, INBOUND, NEAR] = np.nan
        return edited(play, "gates", times=times)


@dataclass(frozen=True, slots=True, kw_only=True)
class GateDoubles(BaseFault):
    """The gate nearest the bat clears a second time: its last edge is a later one."""

    name: ClassVar[str] = "gate-doubles"
    share: float = 0.6
    late: float = 0.4e-3  # s

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        times = _times(play).copy()
        struck = some(self.share, order, draws, self.name)
        times[struck, INBOUND, NEAR, ..., CLEARED] += self.late
        return edited(play, "gates", times=times)


@dataclass(frozen=True, slots=True, kw_only=True)
class SabotTrip(BaseFault):
    """Scraps of the sabot break the first gate ahead of many a ball."""

    name: ClassVar[str] = "sabot-trip"
    share: float = 0.6
    ahead: float = 0.03  # m

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT or not hasattr(_gates(station).spec, "sabot_rate"):
            return station
        return other_sheet(station, "gates", sabot_rate=self.share)

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT or isinstance(play.records["gates"], BoardRecord):
            return play.records  # boards play their own scraps
        times = _times(play).copy()
        struck = some(self.share, order, draws, self.name)
        times[struck, INBOUND, FAR, BROKE] -= self.ahead / play.truth["speed"][struck]
        return edited(play, "gates", times=times)


@dataclass(frozen=True, slots=True, kw_only=True)
class WallDrift(BaseFault):
    """The wall rig shows a greater and greater e0 from its first hit to its last."""

    name: ClassVar[str] = "wall-drift"
    drift: float = 0.06  # relative, over the check

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.BALLS:
            return play.records
        times = _times(play).copy()
        back = times[:, OUTBOUND]
        start = back[:, NEAR, BROKE][:, None, None]
        faster = (1 + self.drift * order.slot / max(order.slot.max(), 1))[:, None, None]
        times[:, OUTBOUND] = start + (back - start) / faster
        return edited(play, "gates", times=times)


def _gates(station: Station) -> Any:
    gated: Any = station
    return gated.gates


def _times(play: RigOutput) -> Array:
    record: Any = play.records["gates"]
    return np.asarray(record.times)


FAULTS: tuple[Fault, ...] = (
    GateClock(),
    GateDoubles(),
    GateMisses(),
    GateMoved(),
    SabotTrip(),
    WallDrift(),
)
