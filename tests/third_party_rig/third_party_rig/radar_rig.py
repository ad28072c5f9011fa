"""A rig with a bat at rest on a pivot, a cannon, and a radar gun in place of gates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from third_party_rig.radar_gun import RadarGun, RadarGunSpec
from third_party_rig.radar_record import RadarRecord
from virtual_lab.records import AimMarks, Record, ShotLog
from virtual_lab.simulation.instruments import (
    FittedStation,
    Instrument,
    InstrumentFactory,
    calibration_of,
    true_constants_of,
)
from virtual_lab.simulation.instruments.air import HallAir, HallAirSpec
from virtual_lab.simulation.instruments.cannon import Cannon, CannonSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import TrueOutcome
from virtual_lab.simulation.stations.impact import (
    contact_angle,
    rebound_velocity,
    scenes_of,
    true_outcome,
)
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

PIVOT_FROM_KNOB = 6 * 0.0254  # distance of the pivot from the knob [m]
FLIGHT = 0.02  # time from the trigger to the bat [s]
GUN = RadarGunSpec(
    kind="radar-gun",
    title="Radar gun behind a net",
    distance=0.4,
    distance_u=2e-3,
    scale=1.0005,
    scale_u=2e-4,
    speed_scatter=0.02,
    time_jitter=1e-4,
)
CANNON = CannonSpec(
    kind="cannon",
    title="Air cannon",
    fastest=75.0,
    speed_scatter=0.2,
    along_scatter=1.5e-3,
    across_scatter=1.5e-3,
    slope_scatter=2e-3,
    along_u=0.3e-3,
    across_u=0.3e-3,
    marks=20,
    mark_resolution=0.5e-3,
)


class RadarPivot:
    """The rig type."""

    name = "radar-range"
    stage = Stage.IMPACT
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "radar": RadarRecord, "aim": AimMarks}

    def commission(self, draws: Draws, *, ideal: bool = False) -> RadarStation:
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        fit = factory.commission
        return RadarStation(
            gun=RadarGun.commission(factory.adapt(GUN), draws, f"{self.name}.radar"),
            cannon=Cannon.commission(factory.adapt(CANNON), draws, f"{self.name}.cannon"),
            air=fit(HallAir.commission, HallAirSpec, "hall-air", "hall.air"),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarStation(FittedStation):
    """The rig in one laboratory."""

    gun: RadarGun
    cannon: Cannon
    air: HallAir

    @property
    def calibration(self) -> dict[str, Estimate]:
        pivot = {"pivot.from_knob": Estimate(value=PIVOT_FROM_KNOB)}
        return pivot | calibration_of(self.instruments())

    @property
    def true_constants(self) -> dict[str, float]:
        return {"pivot.from_knob": PIVOT_FROM_KNOB} | true_constants_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        return {"radar": self.gun, "cannon": self.cannon, "air": self.air}

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest; the gun reads the ball's speeds in and back."""
        name, slots, balls, body = RadarPivot.name, plan.slot, specimen.balls, specimen.bat.body
        launch = self.cannon.fire(plan.speed, draws, f"{name}.launch", slots)
        e0 = balls.draw_hits(plan.ball, launch.speed, draws, f"{name}.hit", slots)
        place = plan.place + launch.along
        tilt = contact_angle(specimen, place, launch.across)
        scenes = scenes_of(specimen, plan.ball, place, launch.speed * np.cos(tilt), e0)
        support = Pinned(body.length - PIVOT_FROM_KNOB)
        efficiency = specimen.collision(body, support).collide(scenes).collision_efficiency
        back, _ = rebound_velocity(efficiency, tilt, launch.speed, 0.0)
        passage = Passage(
            speed_in=launch.speed,
            speed_out=back,
            drag=self.air.drag(balls.spec.radius, balls.mass[plan.ball]),
            radius=balls.spec.radius,
            gravity=0.0,
        )
        contact = np.full(plan.speed.shape, FLIGHT)
        return RigOutput(
            records={
                "log": plan.log(),
                "radar": self.gun.watch(passage, contact, draws, f"{name}.radar", slots),
                "aim": self.cannon.mark(draws, f"{name}.aim"),
            },
            truth={"speed": launch.speed, "place": place, "collision_efficiency": efficiency},
        )

    def outcome(self, plan: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return the measurand at the plan's positions, for this bat and the lot's mean ball."""
        support = Pinned(specimen.bat.body.length - PIVOT_FROM_KNOB)
        return true_outcome(plan, specimen, support, PIVOT_FROM_KNOB)


RIG = RadarPivot()
