"""The ball cannon: a ball of 60 to 160 mph, a bat at rest on its pivot, boards of light beams.

Nothing watches the bat: e_A is the ball's own speed back over its speed in, from all the edges
of three boards, which also show how high above the bat's axis each ball struck. The pivot only
holds the bat: e_A does not know it is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import Spec
from virtual_lab.records import AimMarks, BoardRecord, Record, ShotLog
from virtual_lab.simulation.flights import at_rest
from virtual_lab.simulation.impact import (
    contact_angle,
    error_free,
    impact_efficiency,
    scenes_of,
    thrown_back,
)
from virtual_lab.simulation.instruments import (
    Instrument,
    InstrumentFactory,
    calibration_of,
    errors_of,
)
from virtual_lab.simulation.instruments.air import Air, AirSpec
from virtual_lab.simulation.instruments.cannon import Cannon, CannonSpec
from virtual_lab.simulation.instruments.gravity import Gravity, GravitySpec
from virtual_lab.simulation.instruments.holder import Holder, HolderSpec
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.supports import Pinned
from virtual_lab.simulation.rig import Motion, RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.simulation.truth import TrueOutcome
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["RIG", "BallCannon", "BallCannonSpec", "BallCannonStation", "BallFlights", "fitted"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonSpec(Spec):
    """Which instruments make up the rig, and what holds the bat."""

    name: str
    title: str
    cannon: str
    gates: str
    air: str
    gravity: str
    holder: HolderSpec


class BallCannon:
    """The rig."""

    name = "ball-cannon"
    title = "Ball cannon: bat at rest on a pivot, three boards of light beams"
    stage = Stage.IMPACT
    motions = frozenset(Motion)
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": BoardRecord, "aim": AimMarks}

    def commission(self, draws: Draws, *, ideal: bool = False) -> BallCannonStation:
        spec = catalog.load("rigs", self.name, BallCannonSpec).spec
        return BallCannonStation(**fitted(spec, InstrumentFactory(draws=draws, ideal=ideal)))


def fitted(spec: BallCannonSpec, outfitter: InstrumentFactory) -> dict[str, Any]:
    """Return the instruments of a ball cannon, by the names of its station's fields."""
    fit = outfitter.commission
    holder = outfitter.as_asked(spec.holder)
    return {
        "holder": Holder.commission(holder, outfitter.draws, "ball-cannon.holder"),
        "cannon": fit(Cannon.commission, CannonSpec, spec.cannon, "ball-cannon.cannon"),
        "gates": fit(LightBoards.commission, LightBoardSpec, spec.gates, "ball-cannon.gates"),
        "air": fit(Air.commission, AirSpec, spec.air, "hall.air"),
        "hall": fit(Gravity.commission, GravitySpec, spec.gravity, "hall.gravity"),
        "ideal": outfitter.ideal,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class BallFlights:
    """What the balls of an order do, shape (shot,)."""

    passage: Passage
    contact: Array  # when the ball meets the bat [s]
    contact_time: Array  # [s]
    place: Array  # struck, from the barrel tip [m]
    across: Array  # height of the ball above the bat's axis [m]
    ball_restitution: Array
    collision_efficiency: Array

    @property
    def leaving(self) -> Array:
        """When the ball leaves the bat [s]."""
        return self.contact + self.contact_time


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonStation:
    """The rig in one laboratory."""

    holder: Holder
    cannon: Cannon
    gates: LightBoards
    air: Air
    hall: Gravity
    ideal: bool

    @property
    def calibration(self) -> dict[str, Estimate]:
        return calibration_of(self.instruments())

    @property
    def true_constants(self) -> dict[str, float]:
        return errors_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        """Return what measures, by name."""
        return {
            "pivot": self.holder,
            "cannon": self.cannon,
            "gates": self.gates,
            "air": self.air,
            "hall": self.hall,
        }

    def play(self, order: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest and time the ball through every board, both ways."""
        return self.timed(self.fly(order, specimen, draws), order, draws)

    def fly(self, order: ShotPlan, specimen: Specimen, draws: Draws) -> BallFlights:
        """Fire at the bat at rest: return what the balls do."""
        balls, slots = specimen.balls, order.slot
        launch = self.cannon.fire(order.speed, draws, "ball-cannon.launch", slots)
        e0 = balls.draw_hits(order.ball, launch.speed, draws, "ball-cannon.hit", slots)
        place = order.place + launch.along
        across = launch.across - self.holder.height
        tilt = contact_angle(specimen, place, across)
        scenes = scenes_of(specimen, order.ball, place, launch.speed * np.cos(tilt), e0)
        efficiency, contact_time = impact_efficiency(
            specimen, order.rung, scenes, self.holder.from_knob, self.holder.spec.nominal_from_knob
        )
        back, up = thrown_back(efficiency, tilt, launch.speed, 0.0)
        passage = Passage(
            speed_in=launch.speed,
            speed_out=back,
            drag=self.air.drag(balls.spec.radius, balls.mass[order.ball]),
            radius=balls.spec.radius,
            gravity=self.hall.acceleration,
            height=launch.across,
            slope_in=launch.slope,
            slope_out=up,
        )
        passage = at_rest(
            passage, order, specimen, self.holder.from_knob, place, across, efficiency
        )
        return BallFlights(
            passage=passage,
            contact=self.gates.arrival(passage),
            contact_time=contact_time,
            place=place,
            across=across,
            ball_restitution=e0,
            collision_efficiency=efficiency,
        )

    def timed(self, flown: BallFlights, order: ShotPlan, draws: Draws) -> RigOutput:
        """Write down what the boards see of balls that fly, and the truth of them."""
        watched = self.gates.watch(
            flown.passage,
            flown.contact,
            flown.leaving,
            draws,
            "ball-cannon.gates",
            order.slot,
            order.rung,
        )
        return RigOutput(
            records={
                "log": order.log(),
                "gates": watched,
                "aim": self.cannon.mark(draws, "ball-cannon.aim"),
            },
            truth={
                "speed": flown.passage.speed_in,
                "place": flown.place,
                "across": flown.across,
                "ball_restitution": flown.ball_restitution,
                "collision_efficiency": flown.collision_efficiency,
                "rebound_speed": flown.passage.speed_out,
                "contact_time": flown.contact_time,
            },
        )

    def outcome(self, order: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return what an error-free test would find, on an axis exactly where it should be.

        An ideal laboratory is to show algebra alone, and e_A knows the axis to 1e-5: there it is
        that of the bat where it was surveyed to hang.
        """
        nominal = self.holder.spec.nominal_from_knob
        hung = self.holder.from_knob if self.ideal else nominal
        return error_free(order, specimen, Pinned(specimen.bat.body.length - hung), nominal)


RIG = BallCannon()
