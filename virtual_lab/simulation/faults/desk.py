"""Faults of hands and papers: the bench, what is typed in, and the specimens themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import Any, ClassVar

import numpy as np

from virtual_lab.records import Record
from virtual_lab.simulation.faults.fault import BaseFault, ConstantOff, Fault, edited, other_sheet
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Specimen, Stage, Station
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, OUNCE

__all__ = ["FAULTS"]

Records = Mapping[str, Record]
GRAM = 1e-3  # kg


@dataclass(frozen=True, slots=True, kw_only=True)
class Misread(BaseFault):
    """Every reading of a channel of the bench was entered as so many times itself."""

    name: str
    channel: str
    factor: float

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.BENCH:
            return play.records
        readings = _readings(play, self.channel) * self.factor
        return edited(play, self.channel, readings=readings)


@dataclass(frozen=True, slots=True, kw_only=True)
class BalanceFromKnob(BaseFault):
    """The balance point was measured from the knob's end and entered as from the tip."""

    name: ClassVar[str] = "balance-from-knob"

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.BENCH:
            return play.records
        readings = _readings(play, "balance")
        return edited(play, "balance", readings=float(play.truth["length"]) - readings)


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumWide(BaseFault):
    """The pendulum was let go far out and the amplitude noted was the usual one."""

    name: ClassVar[str] = "pendulum-wide"
    released: float = 20 * DEGREE

    def station(self, stage: Stage, station: Station) -> Station:
        if stage is not Stage.BENCH:
            return station
        return other_sheet(station, "pendulum", release_amplitude=self.released)

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if stage is not Stage.BENCH:
            return play.records
        record: Any = play.records["pendulum"]
        usual = 4 * DEGREE / self.released
        return edited(
            play,
            "pendulum",
            first_amplitude=record.first_amplitude * usual,
            last_amplitude=record.last_amplitude * usual,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampForgotten(BaseFault):
    """The moment of inertia of the pendulum's clamp was never entered."""

    name: ClassVar[str] = "clamp-forgotten"

    def calibration(self, known: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        key = "bench.pendulum.clamp_inertia"
        return {**known, key: replace(known[key], value=0.0)}


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongLot(BaseFault):
    """The balls fired at the bat are of a livelier lot than those measured at the wall."""

    name: ClassVar[str] = "wrong-lot"
    livelier: float = 0.02

    def specimen(self, stage: Stage, specimen: Specimen) -> Specimen:
        if stage is not Stage.IMPACT:
            return specimen
        balls = specimen.balls
        return replace(
            specimen, balls=replace(balls, restitution=balls.restitution + self.livelier)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BallWornOut(BaseFault):
    """One ball of the lot has been hit too often."""

    name: ClassVar[str] = "ball-worn-out"
    ball: int = 3
    lost: float = 0.04

    def specimen(self, stage: Stage, specimen: Specimen) -> Specimen:
        balls = specimen.balls
        restitution = balls.restitution.copy()
        restitution[self.ball] -= self.lost
        return replace(specimen, balls=replace(balls, restitution=restitution))


@dataclass(frozen=True, slots=True, kw_only=True)
class BallOutOfRound(BaseFault):
    """The balls are egg-shaped: every passage meets another radius, front and back."""

    written: ClassVar[str] = "gates"
    name: ClassVar[str] = "ball-out-of-round"
    depth: float = 1.5e-3  # m, of the radius

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        if "gates" not in play.records:
            return play.records
        record: Any = play.records["gates"]
        times = record.times.copy()
        speed = play.truth["speed"]
        back = play.truth.get("rebound_speed", play.truth.get("ball_restitution", 0) * speed)
        speeds = np.stack([speed, np.abs(back)], axis=1)[:, :, None, None]
        shape = (*times.shape[1:3], 2)
        turn = tau * draws.uniform(f"fault.{self.name}.{stage.value}", shape, order.slot)
        late = self.depth * np.sin(turn) * np.array([-1.0, 1.0]) / speeds
        beams = times.ndim - late.ndim
        times += late.reshape(*late.shape[:3], *(1,) * beams, 2)
        return edited(play, "gates", times=times)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatCracked(BaseFault):
    """The bat cracked between the bench and the first hit: a tenth less stiff, f1 5 % lower."""

    name: ClassVar[str] = "bat-cracked"
    softer: float = 0.1

    def specimen(self, stage: Stage, specimen: Specimen) -> Specimen:
        if stage is not Stage.IMPACT:
            return specimen
        bat, left = specimen.bat, 1 - self.softer
        material = replace(
            bat.body.material,
            youngs_modulus=bat.body.material.youngs_modulus * left,
            shear_modulus=bat.body.material.shear_modulus * left,
        )
        return replace(specimen, bat=replace(bat, body=replace(bat.body, material=material)))


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordsSwapped(BaseFault):
    """The gate records of two shots of one round were filed under each other's number."""

    written: ClassVar[str] = "gates"
    name: ClassVar[str] = "records-swapped"
    shots: tuple[int, int] = (1, 4)

    def records(
        self, stage: Stage, station: Station, order: ShotPlan, play: RigOutput, draws: Draws
    ) -> Records:
        first, second = (np.flatnonzero(order.slot == shot) for shot in self.shots)
        if stage is not Stage.IMPACT or not (first.size and second.size):
            return play.records
        record: Any = play.records["gates"]
        filed = np.arange(len(order.place))
        filed[first], filed[second] = second, first
        return edited(play, "gates", times=record.times[filed])


def _readings(play: RigOutput, channel: str) -> Any:
    record: Any = play.records[channel]
    return record.readings


FAULTS: tuple[Fault, ...] = (
    BalanceFromKnob(),
    # two digits transposed: 5.152 oz for 5.125 oz
    Misread(name="ball-mass-typed", channel="ball-mass", factor=5.152 / 5.125),
    BallOutOfRound(),
    BallWornOut(),
    BatCracked(),
    ClampForgotten(),
    # the scale showed ounces, and they were entered as grams
    Misread(name="ounces-as-grams", channel="ball-mass", factor=GRAM / OUNCE),
    Misread(name="bat-ounces-as-grams", channel="bat-mass", factor=GRAM / OUNCE),
    PendulumWide(),
    RecordsSwapped(),
    # a dish of 2 g was left on it when bat and balls were weighed
    ConstantOff(
        name="scale-not-tared", stage=Stage.BENCH, part="scale", constant="zero", plus=2e-3
    ),
    WrongLot(),
)
