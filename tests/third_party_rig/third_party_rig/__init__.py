"""A pivoted-bat rig of another maker, with gates for the ball and no encoder for the bat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from virtual_lab.records import GateRecord, Record, ShotLog
from virtual_lab.simulation.instruments import (
    FittedStation,
    Instrument,
    calibration_of,
    true_constants_of,
)
from virtual_lab.simulation.instruments.air import HallAir, HallAirSpec
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import TrueOutcome
from virtual_lab.simulation.stations.impact import scenes_of, true_outcome
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["RIG", "SpeedGunPivot"]

PIVOT_FROM_KNOB = 6 * 0.0254  # distance of the pivot from the knob [m]
SPEED_SCATTER = 0.2  # standard deviation of the launcher's speed [m/s]
AIR = HallAirSpec(
    kind="air",
    title="Still air",
    density=1.2,
    density_u=0.02,
    drag_coefficient=0.4,
    drag_coefficient_u=0.05,
)
GATES = LightGateSpec(
    kind="light-gate",
    title="Three curtains in one frame",
    distances=(0.60, 0.40, 0.20),
    distance_u=0.05e-3,
    half_height=0.10,
    tick=0.5e-6,
    edge_jitter=1e-6,
    clock_u=10e-6,
)


class SpeedGunPivot:
    """The rig type."""

    name = "speed-gun-pivot"
    stage = Stage.IMPACT
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": GateRecord}

    def commission(self, draws: Draws, *, ideal: bool = False) -> SpeedGunStation:
        return SpeedGunStation(
            gates=LightGates.commission(
                GATES.ideal() if ideal else GATES, draws, f"{self.name}.gates"
            ),
            air=HallAir.commission(AIR.ideal() if ideal else AIR, draws, f"{self.name}.air"),
            scatter=0.0 if ideal else SPEED_SCATTER,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedGunStation(FittedStation):
    """The rig in one laboratory."""

    gates: LightGates
    air: HallAir
    scatter: float

    @property
    def calibration(self) -> dict[str, Estimate]:
        pivot = {"pivot.from_knob": Estimate(value=PIVOT_FROM_KNOB)}
        return pivot | calibration_of(self.instruments())

    @property
    def true_constants(self) -> dict[str, float]:
        return {"pivot.from_knob": PIVOT_FROM_KNOB} | true_constants_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        return {"gates": self.gates, "air": self.air}

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest and time the ball through every curtain, in both directions."""
        name, slots, balls = SpeedGunPivot.name, plan.slot, specimen.balls
        speed = plan.speed + self.scatter * draws.normal(f"{name}.launch", slots=slots)
        e0 = balls.draw_hits(plan.ball, speed, draws, f"{name}.hit", slots)
        mass = balls.mass[plan.ball]
        model = specimen.collision(specimen.bat.body, _support(specimen))
        hit = model.collide(scenes_of(specimen, plan.ball, plan.place, speed, e0))
        passage = Passage(
            speed_in=speed,
            speed_out=hit.collision_efficiency * speed,
            drag=self.air.drag(balls.spec.radius, mass),
            radius=balls.spec.radius,
            gravity=0.0,
        )
        contact = self.gates.arrival(passage)
        leaving = contact + hit.contact_time
        return RigOutput(
            records={
                "log": ShotLog(ball=plan.ball, nominal_speed=plan.speed, place=plan.place),
                "gates": self.gates.watch(passage, contact, leaving, draws, f"{name}.gates", slots),
            },
            truth={"speed": speed, "collision_efficiency": hit.collision_efficiency},
        )

    def outcome(self, plan: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return the measurand at the plan's positions, for this bat and the lot's mean ball."""
        return true_outcome(plan, specimen, _support(specimen), PIVOT_FROM_KNOB)


def _support(specimen: Specimen) -> Pinned:
    return Pinned(specimen.bat.body.length - PIVOT_FROM_KNOB)


RIG = SpeedGunPivot()
