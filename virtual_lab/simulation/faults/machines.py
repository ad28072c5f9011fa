"""Faults of the machine at the bat: cannon, pivot and encoder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import Any, ClassVar

import numpy as np

from virtual_lab.records import Record
from virtual_lab.simulation.faults.fault import (
    BaseFault,
    ConstantOff,
    Fault,
    SheetOff,
    edited,
    some,
)
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.units import INCH, MPH

__all__ = ["FAULTS"]

Records = Mapping[str, Record]


@dataclass(frozen=True, slots=True, kw_only=True)
class CannonSlow(BaseFault):
    """The cannon gives less than it is asked for."""

    name: ClassVar[str] = "cannon-slow"
    short: float = 3 * MPH

    def order(self, stage: Stage, order: ShotPlan) -> ShotPlan:
        return replace(order, speed=order.speed - self.short) if stage is Stage.IMPACT else order


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderSlip(BaseFault):
    """The coupling of the encoder slips once in some of the shots, and counts are lost."""

    name: ClassVar[str] = "encoder-slip"
    written: ClassVar[str] = "encoder"
    share: float = 0.6
    lost: float = 20.0  # counts

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        counts = _encoded(play).counts
        samples = counts.shape[1]
        struck = some(self.share, order, draws, self.name)
        when = draws.uniform(f"fault.{self.name}.when", slots=order.slot)
        slipped = np.arange(samples) > samples * (0.6 + 0.6 * when)[:, None]
        return edited(play, "encoder", counts=counts - self.lost * (slipped & struck[:, None]))


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderPlay(BaseFault):
    """The bat is loose on the pivot: the encoder follows it only when the play is taken up."""

    name: ClassVar[str] = "encoder-play"
    written: ClassVar[str] = "encoder"
    play: float = 0.3 / 360 * tau  # rad

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        counts = _encoded(play).counts
        width = np.round(self.play / tau * station.calibration["encoder.counts_per_turn"].value)
        followed = np.empty_like(counts)
        last = counts[:, 0]
        for sample in range(counts.shape[1]):
            last = np.clip(last, counts[:, sample] - width, counts[:, sample])
            followed[:, sample] = last
        return edited(play, "encoder", counts=followed)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatNotAtRest(BaseFault):
    """The bat still swings from being set when the ball is fired."""

    name: ClassVar[str] = "bat-not-at-rest"
    written: ClassVar[str] = "encoder"
    rate: float = 0.3  # rad/s, either way

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        record = _encoded(play)
        way = np.where(some(0.5, order, draws, self.name), 1.0, -1.0)
        turned = (
            station.calibration["encoder.counts_per_turn"].value / tau * self.rate * record.times
        )
        counts = record.counts + np.round(way[:, None] * turned)
        return edited(play, "encoder", counts=counts)


def _encoded(play: RigOutput) -> Any:
    return play.records["encoder"]


FAULTS: tuple[Fault, ...] = (
    # aimed above the bat's axis, and too far from its tip
    ConstantOff(name="aim-across", part="cannon", constant="across", plus=0.3 * INCH),
    ConstantOff(name="aim-along", part="cannon", constant="along", plus=0.5 * INCH),
    BatNotAtRest(),
    # dry: it drags, and rubs like a plain one under the blow [N m, 1]
    SheetOff(
        name="bearing-friction", part="pivot", values={"constant_torque": 1.0, "friction": 0.1}
    ),
    CannonSlow(),
    # half the counts a turn that its sheet says
    ConstantOff(name="encoder-half-counts", part="encoder", constant="scale", times=0.5),
    EncoderPlay(),
    EncoderSlip(),
    ConstantOff(name="pivot-off", part="pivot", constant="from_knob", plus=5e-3),
)
