"""The NCAA swing machine: a ball of 70 mph meets a bat that a drive rotates about its handle.

At contact the bat should be square to the line of fire. If ball and bat are not synchronous, they
meet at an angle, and closer to the light boards or farther away. An encoder on the shaft measures
rate and angle, and the light boards measure the incoming and the rebound speed of the ball.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import tau
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import AimMarks, BoardRecord, EncoderRecord, Record, ShotLog
from virtual_lab.simulation.instruments import Instrument, InstrumentFactory, RecordDetail
from virtual_lab.simulation.instruments.calibrated import CalibratedSpec, StandardDeviation
from virtual_lab.simulation.instruments.encoder import Encoder, EncoderSpec
from virtual_lab.simulation.instruments.holder import Holder, HolderSpec
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.stations.cannon_station import CannonRigSpec, CannonStation, commission
from virtual_lab.simulation.stations.impact import contact_angle, rebound_velocity
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws
from virtual_lab.units import Array

GAP = 1e-3  # time before contact left out of summary values; contact may be early [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSpec(CalibratedSpec):
    """The servo that rotates the bat: stability of its speed and of its timing."""

    other_errors: ClassVar[tuple[str, ...]] = ("ripple", "droop")

    speed_scatter: Annotated[float, Ge(0), Dimension("number")]  # relative scatter between shots
    ripple: Annotated[float, Ge(0), Dimension("number")]  # relative amplitude of the speed ripple
    ripple_frequency: Annotated[float, Gt(0), Dimension("frequency")]
    droop: Annotated[float, Dimension("rate")]  # relative loss of speed per second
    timing_scatter: Annotated[float, Ge(0), Dimension("time")]  # scatter of bat relative to ball


@dataclass(frozen=True, slots=True, kw_only=True)
class NcaaSwingSpec(CannonRigSpec):
    """Data sheet of the rig: instruments, drive, and clamp of the bat."""

    encoder: str
    drive: DriveSpec
    holder: HolderSpec


@dataclass(frozen=True, slots=True)
class _Swing:
    """Rotation of the bat near contact, arrays (shot,)."""

    angle: Array  # angle at contact, 0 if the bat is square to the ball [rad]
    rate: Array  # angular rate at contact [rad/s]
    even: Array  # angular rate without ripple and droop [rad/s]
    phase: Array  # phase of the ripple at contact [rad]


class NcaaSwing:
    """The NCAA swing machine."""

    name = "ncaa-swing"
    stage = Stage.IMPACT
    blocks = True
    channels: Mapping[str, type[Record]] = {
        "log": ShotLog,
        "gates": BoardRecord,
        "swing": EncoderRecord,
        "aim": AimMarks,
    }

    def commission(self, draws: Draws, *, ideal: bool = False) -> NcaaSwingStation:
        spec = catalog.load("rigs", self.name, NcaaSwingSpec).spec
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        holder, drive = factory.adapt(spec.holder), factory.adapt(spec.drive)
        return NcaaSwingStation(
            drive=drive,
            holder=Holder.commission(holder, draws, "ncaa-swing.holder"),
            encoder=factory.commission(
                Encoder.commission, EncoderSpec, spec.encoder, "ncaa-swing.encoder"
            ),
            **commission(spec, factory, self.name, LightBoards, LightBoardSpec),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class NcaaSwingStation(CannonStation):
    """The NCAA swing machine in one laboratory, or in a block of them."""

    name = "ncaa-swing"

    drive: DriveSpec
    encoder: Encoder

    def instruments(self) -> dict[str, Instrument]:
        return {
            "pivot": self.holder,
            "cannon": self.cannon,
            "gates": self.gates,
            "swing": self.encoder,
            "air": self.air,
            "hall": self.hall,
        }

    def numbers_in(
        self, records: Mapping[str, Record], measured: Mapping[str, StandardDeviation]
    ) -> Mapping[str, object]:
        """Return the scatter of the drive's speed."""
        return {"drive.speed_scatter": measured["turn_rate_scatter"]}

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the rotating bat. The ball is timed in both directions, the shaft to contact."""
        station, streams, struck = self.at(plan.owner), draws.at(plan.owner), specimen.at(plan)
        balls, slots = struck.balls, plan.slot
        launch = station.cannon.fire(plan.speed, streams, "ncaa-swing.launch", slots)
        swing = self._swing(plan, streams)
        axis = struck.bat.body.length - station.holder.from_knob
        # The ball flies at a set distance from the pivot, so it hits an oblique bat farther out.
        abreast = axis - plan.place - launch.along
        cosine, sine = np.cos(swing.angle), np.sin(swing.angle)
        lever = abreast / cosine
        bat_speed = swing.rate * lever
        across = launch.across - station.holder.height
        tilt = contact_angle(struck, axis - lever, across)
        closing = launch.speed * cosine + bat_speed
        e0 = balls.draw_hits(..., closing, streams, "ncaa-swing.hit", slots)
        impacts = station.impacts(plan.detail, struck, axis - lever, closing * np.cos(tilt), e0)
        efficiency = impacts.efficiency
        square, up = rebound_velocity(efficiency, tilt, closing, bat_speed)
        back = square * cosine - launch.speed * sine**2
        passage = Passage(
            speed_in=launch.speed,
            speed_out=back,
            drag=station.air.drag(balls.spec.radius, balls.mass),
            radius=balls.spec.radius,
            gravity=station.hall.acceleration,
            height=launch.across,
            slope_in=launch.slope,
            slope_out=up,
            plane=lever * sine,
        )
        contact = station.gates.arrival(passage)
        leaving = contact + impacts.contact_time
        return RigOutput(
            records=self.records(passage, contact, leaving, plan, draws)
            | {"swing": station._count(plan, swing, contact, streams)},
            truth={
                "speed": launch.speed,
                "bat_speed": bat_speed,
                "angle": swing.angle,
                "place": axis - lever,
                "across": across,
                "ball_restitution": e0,
                "collision_efficiency": efficiency,
                "rebound_speed": back,
                "contact_time": impacts.contact_time,
            },
        )

    def _swing(self, plan: ShotPlan, draws: Draws) -> _Swing:
        drive = self.drive
        scatter, delay = draws.normal("ncaa-swing.drive", 2, plan.slot).T
        even = plan.turn_rate * (1 + drive.speed_scatter * scatter)
        phase = tau * draws.uniform("ncaa-swing.ripple", slots=plan.slot)
        return _Swing(
            angle=even * drive.timing_scatter * delay,
            rate=even * (1 + drive.ripple * np.cos(phase)),
            even=even,
            phase=phase,
        )

    def _count(self, plan: ShotPlan, swing: _Swing, contact: Array, draws: Draws) -> Record:
        """Return the record of the shaft up to contact, with the clock of the light boards."""
        name, slots = "ncaa-swing.encoder", plan.slot
        if plan.detail is RecordDetail.SUMMED:
            rate = swing.rate / self.gates.clock
            return self.encoder.sum_up(
                rate, draws, name, slots, span=contact - GAP, gap=GAP, angle=swing.angle
            )
        ticks = self.encoder.spec.sample_times() / self.gates.clock
        turned = tau * self.drive.ripple_frequency

        def turn(part: slice) -> Array:
            chosen = swing.angle, swing.even, swing.phase
            angle, even, phase = (values[part, None] for values in chosen)
            since = np.minimum(ticks - contact[part, None], 0.0)
            wave = np.sin(turned * since + phase) - np.sin(phase)
            droop, ripple = self.drive.droop / 2, self.drive.ripple / turned
            return np.asarray(angle + even * (since * (1 + droop * since) + ripple * wave))

        return self.encoder.read(turn, draws, name, slots)


RIG = NcaaSwing()
