"""Faults of the machine at the bat: cannon, pivot and encoder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import Any, ClassVar

import numpy as np

from virtual_lab.records import Record
from virtual_lab.simulation.faults.fault import BaseFault, Fault, altered, edited, other_sheet, some
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
class AimAlong(BaseFault):
    """The cannon is aimed too far from the tip."""

    name: ClassVar[str] = "aim-along"
    off: float = 0.5 * INCH

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return altered(station, "cannon", along=_of(station, "cannon").along + self.off)


@dataclass(frozen=True, slots=True, kw_only=True)
class AimAcross(BaseFault):
    """The cannon is aimed above the bat's axis."""

    name: ClassVar[str] = "aim-across"
    off: float = 0.3 * INCH

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return altered(station, "cannon", across=_of(station, "cannon").across + self.off)


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotOff(BaseFault):
    """The axis is farther from the knob than it was surveyed to be."""

    name: ClassVar[str] = "pivot-off"
    shift: float = 5e-3  # m

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return altered(station, "holder", from_knob=_of(station, "holder").from_knob + self.shift)


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingFriction(BaseFault):
    """The bearing is dry: it drags, and rubs like a plain one under the blow."""

    name: ClassVar[str] = "bearing-friction"
    torque: float = 1.0  # N m
    friction: float = 0.1

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return other_sheet(station, "holder", constant_torque=self.torque, friction=self.friction)


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderHalfCounts(BaseFault):
    """The encoder has half the counts a turn that its sheet says."""

    name: ClassVar[str] = "encoder-half-counts"

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.IMPACT:
            return station
        return altered(station, "encoder", scale=_of(station, "encoder").scale / 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderSlip(BaseFault):
    """The coupling of the encoder slips once in some of the shots, and counts are lost."""

    name: ClassVar[str] = "encoder-slip"
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
    play: float = 0.3 / 360 * tau  # rad

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        counts = _encoded(play).counts
        width = np.round(self.play / tau * _of(station, "encoder").spec.counts_per_turn)
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
    rate: float = 0.3  # rad/s, either way

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.IMPACT:
            return play.records
        record = _encoded(play)
        way = np.where(some(0.5, order, draws, self.name), 1.0, -1.0)
        turned = _of(station, "encoder").spec.counts_per_turn / tau * self.rate * record.times
        counts = record.counts + np.round(way[:, None] * turned)
        return edited(play, "encoder", counts=counts)


def _of(station: Station, part: str) -> Any:
    return getattr(station, part)


def _encoded(play: RigOutput) -> Any:
    return play.records["encoder"]


FAULTS: tuple[Fault, ...] = (
    AimAcross(),
    AimAlong(),
    BatNotAtRest(),
    BearingFriction(),
    CannonSlow(),
    EncoderHalfCounts(),
    EncoderPlay(),
    EncoderSlip(),
    PivotOff(),
)
