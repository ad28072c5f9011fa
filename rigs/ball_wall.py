"""The ball-wall rig: balls fired at a massive rigid wall, timed by gates in both directions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import GateRecord, Record, ShotLog
from virtual_lab.simulation.instruments import (
    FittedStation,
    Instrument,
    InstrumentFactory,
    true_constants_of,
)
from virtual_lab.simulation.instruments.air import Gravity, HallAir
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.instruments.cannon import Cannon
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.ageing import loss_of_restitution
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.stations.cannon_station import CannonRigSpec, commission
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws, Owner, of_owners
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BallWallSpec(CannonRigSpec):
    """Data sheet of the rig: its instruments and its wall."""

    rest: Annotated[float, Ge(0), Dimension("time")]  # time between two hits of one ball
    # rebound speed relative to that from a rigid wall
    wall_restitution: Annotated[float, Gt(0), Le(1), Dimension("number")]
    # standard deviation of this ratio between laboratories; it is limited to at most 1
    wall_spread: Annotated[float, Ge(0), Le(0.1), Dimension("number")] = 0.0


class BallWall:
    """The ball-wall rig."""

    name = "ball-wall"
    stage = Stage.BALLS
    blocks = True
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": GateRecord}

    def commission(self, draws: Draws, *, ideal: bool = False) -> BallWallStation:
        spec = catalog.load("rigs", self.name, BallWallSpec).spec
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        station = BallWallStation(
            rest=spec.rest,
            wall_restitution=1.0,
            **commission(spec, factory, self.name, LightGates, LightGateSpec),
        )
        wall = spec.wall_restitution + spec.wall_spread * draws.normal("ball-wall.wall")
        return station.with_wall(np.minimum(wall, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class BallWallStation(FittedStation):
    """The ball-wall rig in one laboratory, or in a block of them."""

    cannon: Cannon
    gates: LightGates
    air: HallAir
    hall: Gravity
    rest: float  # time between two hits of one ball [s]
    wall_restitution: TrueConstant
    ideal: bool

    @property
    def true_constants(self) -> dict[str, Any]:
        return {"wall.restitution": self.wall_restitution} | true_constants_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        return {"gates": self.gates, "air": self.air}

    def with_wall(self, restitution: Array | float) -> BallWallStation:
        """Return the rig with a wall whose rebound speed is `restitution` times a rigid wall's.

        In a block of laboratories `restitution` is an array (laboratory,), or a number for all.
        """
        every = np.broadcast_to(restitution, self.gates.laboratories)[()]
        return replace(self, wall_restitution=every)

    def at(self, owner: Owner) -> BallWallStation:
        """Return the station with the true constants of each shot's laboratory."""
        if owner is ...:
            return self
        station = FittedStation.at(self, owner)
        return replace(station, wall_restitution=of_owners(self.wall_restitution, owner))

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire the balls of `plan` at the wall. The impact positions of the plan are not used."""
        station, streams, balls = self.at(plan.owner), draws.at(plan.owner), specimen.at(plan).balls
        launch = station.cannon.fire(plan.speed, streams, "ball-wall.launch", plan.slot)
        loss = self._loss(plan, specimen, launch.speed)
        hit = balls.draw_hits(..., launch.speed, streams, "ball-wall.hit", plan.slot, loss)
        rebound = station.wall_restitution * hit
        passage = Passage(
            speed_in=launch.speed,
            speed_out=rebound * launch.speed,
            drag=station.air.drag(balls.spec.radius, balls.mass),
            radius=balls.spec.radius,
            gravity=0.0 if self.ideal else station.hall.acceleration,
        )
        contact = station.gates.arrival(passage)
        touching = wall_contact(
            speed=launch.speed,
            mass=balls.mass,
            restitution=rebound,
            stiffness=np.array(balls.spec.stiffness),
            exponent=np.array(balls.spec.exponent),
        ).time
        record = station.gates.watch(
            passage, contact, contact + touching, streams, "ball-wall.gates", plan.slot, plan.detail
        )
        log = plan.log()
        return RigOutput(
            records={"log": log, "gates": record},
            truth={"speed": launch.speed, "ball_restitution": hit, "restitution_loss": loss},
        )

    def _loss(self, plan: ShotPlan, specimen: Specimen, speed: Array) -> Array:
        """Return the loss of e0 caused by earlier hits, (shot,); 0 for an ideal rig."""
        ageing = specimen.balls.spec.ageing
        if ageing is None or self.ideal:
            return np.zeros(speed.shape)
        ball = specimen.balls.numbers(plan.owner, plan.ball)
        turn = np.argsort(plan.slot, kind="stable")
        loss = np.empty(speed.shape)
        loss[turn] = loss_of_restitution(ageing, ball[turn], speed[turn], self.rest)
        return loss


RIG = BallWall()
