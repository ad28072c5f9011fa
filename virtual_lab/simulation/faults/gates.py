"""Faults of what times the ball: the gates at the bat and those at the wall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from virtual_lab.records import BoardRecord, Record
from virtual_lab.simulation.arrays import Array
from virtual_lab.simulation.faults.fault import (
    BaseFault,
    ConstantOff,
    Fault,
    SheetOff,
    edited,
    some,
)
from virtual_lab.simulation.rig import Rig, RigOutput, ShotPlan, Stage, Station
from virtual_lab.streams import Draws

__all__ = ["FAULTS"]

Records = Mapping[str, Record]
NEAR, FAR = -1, 0  # gates count from the cannon to the target
INBOUND, OUTBOUND = 0, 1
BROKE, CLEARED = 0, 1
SHARE = 0.6  # of the balls that the scraps of a bad sabot are ahead of


@dataclass(frozen=True, slots=True, kw_only=True)
class GateMisses(BaseFault):
    """The gate nearest the bat does not see every second ball that comes in."""

    name: ClassVar[str] = "gate-misses"
    written: ClassVar[str] = "gates"

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
    written: ClassVar[str] = "gates"
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
class SabotTrip(SheetOff):
    """Scraps of the sabot break the first gate ahead of many a ball."""

    name: str = "sabot-trip"
    part: str = "gates"
    values: Mapping[str, float] = field(default_factory=lambda: {"sabot_rate": SHARE})
    ahead: float = 0.03  # m

    def befalls(self, rig: Rig, station: Station) -> bool:
        return "gates" in rig.channels

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT or isinstance(play.records["gates"], BoardRecord):
            return play.records  # boards play their own scraps
        times = _times(play).copy()
        struck = some(SHARE, order, draws, self.name)
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


def _times(play: RigOutput) -> Array:
    record: Any = play.records["gates"]
    return np.asarray(record.times)


FAULTS: tuple[Fault, ...] = (
    # the recorder's clock runs fast, far more than its sheet allows
    ConstantOff(name="gate-clock", part="gates", constant="clock", times=1 + 100e-6),
    GateDoubles(),
    GateMisses(),
    # the one nearest the bat was knocked toward the cannon after its survey
    ConstantOff(name="gate-moved", part="gates", constant="distance", plus=1e-3),
    SabotTrip(),
    WallDrift(),
)
