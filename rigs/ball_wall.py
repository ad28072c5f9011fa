"""The ball-wall rig: balls fired at a massive rigid wall through gates that time both ways."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import GateRecord, Record, ShotLog
from virtual_lab.simulation.cannon_station import CannonRigSpec, fitted
from virtual_lab.simulation.instruments import (
    FittedStation,
    Instrument,
    InstrumentFactory,
    errors_of,
)
from virtual_lab.simulation.instruments.air import Gravity, HallAir
from virtual_lab.simulation.instruments.cannon import Cannon
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.ageing import loss_of_restitution
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BallWallSpec(CannonRigSpec):
    """Which instruments make up the rig."""

    rest: Annotated[float, Ge(0), Dimension("time")]  # between two hits of one ball
    # of what a rigid wall would give back: 1 for one that stands fast
    wall_restitution: Annotated[float, Gt(0), Le(1), Dimension("number")]


class BallWall:
    """The rig."""

    name = "ball-wall"
    stage = Stage.BALLS
    blocks = True
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": GateRecord}

    def commission(self, draws: Draws, *, ideal: bool = False) -> BallWallStation:
        spec = catalog.load("rigs", self.name, BallWallSpec).spec
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        return BallWallStation(
            rest=spec.rest,
            wall_restitution=spec.wall_restitution,
            **fitted(spec, factory, self.name, LightGates, LightGateSpec),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BallWallStation(FittedStation):
    """The rig in one laboratory."""

    cannon: Cannon
    gates: LightGates
    air: HallAir
    hall: Gravity
    rest: float  # [s]
    wall_restitution: float
    ideal: bool

    @property
    def true_constants(self) -> dict[str, Any]:
        wall = np.full(self.gates.laboratories, self.wall_restitution)[()]
        return {"wall.restitution": wall} | errors_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        return {"gates": self.gates, "air": self.air}

    def with_wall(self, restitution: float) -> BallWallStation:
        """Return the rig on a wall that gives back `restitution` of what a rigid one would."""
        return replace(self, wall_restitution=restitution)

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire the balls that `plan` names at the wall; its places mean nothing here."""
        here, own, balls = self.at(plan.owner), draws.at(plan.owner), specimen.at(plan).balls
        launch = here.cannon.fire(plan.speed, own, "ball-wall.launch", plan.slot)
        loss = self._loss(plan, specimen, launch.speed)
        hit = balls.draw_hits(..., launch.speed, own, "ball-wall.hit", plan.slot, loss)
        back = self.wall_restitution * hit
        passage = Passage(
            speed_in=launch.speed,
            speed_out=back * launch.speed,
            drag=here.air.drag(balls.spec.radius, balls.mass),
            radius=balls.spec.radius,
            gravity=0.0 if self.ideal else here.hall.acceleration,
        )
        contact = here.gates.arrival(passage)
        touching = wall_contact(
            speed=launch.speed,
            mass=balls.mass,
            restitution=back,
            stiffness=np.array(balls.spec.stiffness),
            exponent=np.array(balls.spec.exponent),
        ).time
        record = here.gates.watch(
            passage, contact, contact + touching, own, "ball-wall.gates", plan.slot, plan.detail
        )
        log = plan.log()
        return RigOutput(
            records={"log": log, "gates": record},
            truth={"speed": launch.speed, "ball_restitution": hit, "restitution_loss": loss},
        )

    def _loss(self, plan: ShotPlan, specimen: Specimen, speed: Array) -> Array:
        """Return what a ball's earlier hits have taken off its e0; balls of an ideal do not age."""
        ageing = specimen.balls.spec.ageing
        if ageing is None or self.ideal:
            return np.zeros(speed.shape)
        ball = specimen.balls.numbers(plan.owner, plan.ball)
        turn = np.argsort(plan.slot, kind="stable")
        loss = np.empty(speed.shape)
        loss[turn] = loss_of_restitution(ageing, ball[turn], speed[turn], self.rest)
        return loss


RIG = BallWall()
