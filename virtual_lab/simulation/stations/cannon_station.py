"""Common base of the impact rigs: a cannon that fires at a held bat, and gates for the ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from virtual_lab.catalog.specs import Spec
from virtual_lab.records import Record
from virtual_lab.simulation.instruments import (
    FittedStation,
    Instrument,
    InstrumentFactory,
    RecordDetail,
)
from virtual_lab.simulation.instruments.air import Gravity, GravitySpec, HallAir, HallAirSpec
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.instruments.cannon import Cannon, CannonSpec
from virtual_lab.simulation.instruments.holder import Holder
from virtual_lab.simulation.instruments.light_gate import BallGates
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.motion.scene import FrameSpec, StopSpec
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import TrueOutcome
from virtual_lab.simulation.stations.flights import (
    RestingBat,
    Surroundings,
    TrueFlights,
    simulate_flights,
)
from virtual_lab.simulation.stations.impact import (
    Impacts,
    compute_impacts,
    contact_angle,
    rebound_velocity,
    scenes_of,
    true_outcome,
)
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen
from virtual_lab.streams import Draws
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class CannonRigSpec(Spec):
    """Data sheet of an impact rig: names of its instruments."""

    name: str
    title: str
    cannon: str
    gates: str
    air: str
    gravity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RestingBatSpec(CannonRigSpec):
    """Data sheet of an impact rig with a bat at rest: also frames of the gates, stop of the bat."""

    frame: FrameSpec
    stop: StopSpec


def commission(
    spec: CannonRigSpec, factory: InstrumentFactory, name: str, gates: type[Any], sheet: type[Any]
) -> dict[str, Any]:
    """Return the instruments of a rig with a cannon, keyed by the field names of its station.

    The errors of the instruments are drawn at random. If `factory` is ideal, they are zero. The
    result also has the key ``ideal``, which is True for an ideal factory and False otherwise.
    Raises `InputError` for an unknown or invalid data sheet.

    Parameters
    ----------
    spec
        Data sheet of the rig. It names the data sheets of the instruments.
    factory
        Factory of the laboratory's instruments.
    name
        Name of the rig. It is the first part of the names of its streams of random numbers.
    gates, sheet
        Class of the gates, and class of their data sheet.
    """
    fit = factory.commission
    return {
        "cannon": fit(Cannon.commission, CannonSpec, spec.cannon, f"{name}.cannon"),
        "gates": fit(gates.commission, sheet, spec.gates, f"{name}.gates"),
        "air": fit(HallAir.commission, HallAirSpec, spec.air, "hall.air"),
        "hall": fit(Gravity.commission, GravitySpec, spec.gravity, "hall.gravity"),
        "ideal": factory.ideal,
    }


class FiredShots(NamedTuple):
    """True flights of the balls of a plan, arrays (shot,)."""

    flights: TrueFlights
    impacts: Impacts
    tilt: Array  # angle between the line of centers and the line of fire [rad]
    contact: Array  # time at which the ball meets the bat [s]
    leaving: Array  # time at which it leaves the bat [s]
    bat: RestingBat  # bat and its collisions
    ball_restitution: Array

    @property
    def passage(self) -> Passage:
        return self.flights.passage

    @property
    def efficiency(self) -> Array:
        """e_A, NaN for a ball that did not reach the bat."""
        return np.where(self.flights.reached_bat, self.impacts.efficiency, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True)
class CannonStation(FittedStation):
    """An impact rig commissioned in one laboratory or a block of laboratories."""

    name: ClassVar[str]  # prefix of the names of its random numbers
    channels: ClassVar[Mapping[str, tuple[str, ...]]] = {"cannon": ("aim",)}

    holder: Holder[Any]
    cannon: Cannon
    gates: BallGates[Any]
    air: HallAir
    hall: Gravity
    ideal: bool

    def instruments(self) -> dict[str, Instrument]:
        """Return the instruments, keyed by name."""
        return {
            "pivot": self.holder,
            "cannon": self.cannon,
            "gates": self.gates,
            "air": self.air,
            "hall": self.hall,
        }

    @property
    def gravity(self) -> TrueConstant:
        """Gravity that acts on the flights [m/s²]."""
        return self.hall.acceleration

    def outcome(self, plan: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return the result of an error-free test with the pivot at its nominal position.

        In an ideal laboratory the pivot is at its surveyed position instead. The difference changes
        e_A by 1e-5, but an ideal test must have no error except rounding errors.
        """
        nominal = self.holder.spec.nominal_from_knob
        hung = self.holder.spec.from_knob if self.ideal else nominal
        return true_outcome(plan, specimen, Pinned(specimen.bat.body.length - hung), nominal)

    def records(
        self, passage: Passage, contact: Array, leaving: Array, plan: ShotPlan, draws: Draws
    ) -> dict[str, Record]:
        """Return the records of log, gates and aim paper for balls in flight."""
        name, gates = self.name, self.gates.at(plan.owner)
        return {
            "log": plan.log(),
            "gates": gates.watch(
                passage,
                contact,
                leaving,
                draws.at(plan.owner),
                f"{name}.gates",
                plan.slot,
                plan.detail,
            ),
            "aim": self.cannon.mark(draws, f"{name}.aim"),
        }

    def impacts(
        self, detail: RecordDetail, struck: Specimen, place: Array, speed: Array, e0: Array
    ) -> Impacts:
        """Return the collisions of the shots, (shot,), on a station with one entry per shot.

        `place` is the impact position [m], `speed` the normal relative speed [m/s], and `e0` the
        ball's restitution.
        """
        scenes = scenes_of(struck, ..., place, speed, e0)
        nominal = self.holder.spec.nominal_from_knob
        return compute_impacts(struck, detail, scenes, self.holder.from_knob, nominal)


@dataclass(frozen=True, slots=True, kw_only=True)
class RestingBatStation(CannonStation):
    """A station with a bat that hangs at rest until it is struck."""

    frame: FrameSpec
    stop: StopSpec

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest and time the ball through all gates, inbound and rebound."""
        return self.record_flights(self.fire(plan, specimen, draws), plan, draws)

    def surroundings(self, radius: TrueConstant) -> Surroundings:
        """Return the objects around the bat, for balls of a radius [m]."""
        view = self.gates.spec.view(radius)
        return Surroundings(self.frame, self.stop, self.gates.distances, view)

    def fire(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> FiredShots:
        """Fire at the bat at rest, and return the true flights."""
        station, streams, struck = self.at(plan.owner), draws.at(plan.owner), specimen.at(plan)
        name, slots, balls = self.name, plan.slot, struck.balls
        launch = station.cannon.fire(plan.speed, streams, f"{name}.launch", slots)
        e0 = balls.draw_hits(..., launch.speed, streams, f"{name}.hit", slots)
        place = plan.place + launch.along
        across = launch.across - station.holder.height
        tilt = contact_angle(struck, place, across)
        impacts = station.impacts(plan.detail, struck, place, launch.speed * np.cos(tilt), e0)
        speed_out, slope_out = rebound_velocity(impacts.efficiency, tilt, launch.speed, 0.0)
        passage = Passage(
            speed_in=launch.speed,
            speed_out=speed_out,
            drag=station.air.drag(balls.spec.radius, balls.mass),
            radius=balls.spec.radius,
            gravity=station.gravity,
            height=launch.across,
            slope_in=launch.slope,
            slope_out=slope_out,
        )
        rigid, profile = struck.bat.rigid, struck.bat.body.profile
        axis = np.broadcast_to(rigid.length - station.holder.from_knob, place.shape)
        inertia, efficiency = rigid.inertia(axis), impacts.efficiency
        bat = RestingBat(profile, axis, inertia, place, across, efficiency, balls.mass)
        shots = simulate_flights(passage, plan, bat, station.surroundings(balls.spec.radius))
        contact = station.gates.arrival(shots.passage)
        return FiredShots(
            flights=shots,
            impacts=impacts,
            tilt=tilt,
            contact=contact,
            leaving=contact + impacts.contact_time + shots.separation_time,
            bat=bat,
            ball_restitution=e0,
        )

    def record_flights(self, fired: FiredShots, plan: ShotPlan, draws: Draws) -> RigOutput:
        """Return the records and the true values of balls in flight."""
        return RigOutput(
            records=self.records(fired.passage, fired.contact, fired.leaving, plan, draws),
            truth={
                "speed": fired.passage.speed_in,
                "place": fired.bat.place,
                "across": fired.bat.across,
                "ball_restitution": fired.ball_restitution,
                "collision_efficiency": fired.efficiency,
                "rebound_speed": fired.passage.speed_out,
                "contact_time": fired.impacts.contact_time,
            },
        )
