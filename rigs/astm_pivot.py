"""The ASTM pivoted bat: a 60 mph ball, a bat at rest on a vertical axis 6 in from its knob.

The cannon fires at the place the operator set; light gates time the ball in and, where it
reaches them, out; an encoder on the axis counts the recoil. The encoder turns with the
section of the bat at the axis, so it also shows the bending ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.collision.scene import CollisionModel, Collisions, Scenes
from virtual_lab.estimate import Estimate
from virtual_lab.instruments import Instrument, calibration_of, errors_of
from virtual_lab.instruments.air import Air, AirSpec
from virtual_lab.instruments.cannon import Cannon, CannonSpec, Launch
from virtual_lab.instruments.encoder import Encoder, EncoderSpec
from virtual_lab.instruments.light_gate import LightGates, LightGateSpec, Passage
from virtual_lab.physics.beam import beam_of
from virtual_lab.physics.coasting import coast, ring
from virtual_lab.physics.section import outer_diameter
from virtual_lab.physics.supports import Pinned
from virtual_lab.records import AimMarks, EncoderRecord, GateRecord, Record, ShotLog
from virtual_lab.relations.kinematics import (
    efficiency_off_axis,
    offset_angle,
    recoil_factor_pivoted,
    restitution_from_efficiency,
)
from virtual_lab.rig import Order, Play, Specimen, Stage
from virtual_lab.specs import Dimension, Spec
from virtual_lab.streams import Draws
from virtual_lab.truth import TrueOutcome
from virtual_lab.units import STANDARD_GRAVITY

__all__ = ["RIG", "AstmPivot"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotSpec(Spec):
    """The bearing that holds the bat: its place, and the torques that slow the recoil."""

    from_knob: Annotated[float, Gt(0), Dimension("length")]
    place_u: Annotated[float, Ge(0), Dimension("length")]
    constant_torque: Annotated[float, Ge(0), Dimension("torque")]
    viscous_torque: Annotated[float, Ge(0), Dimension("viscous torque")]
    air_torque: Annotated[float, Ge(0), Dimension("quadratic torque")]

    def ideal(self) -> Self:
        """Return the bearing that is where it should be and turns freely in no air."""
        return replace(self, place_u=0.0, constant_torque=0.0, viscous_torque=0.0, air_torque=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotSpec(Spec):
    """Which instruments make up the rig, and its bearing."""

    name: str
    title: str
    cannon: str
    gates: str
    encoder: str
    air: str
    pivot: PivotSpec


class AstmPivot:
    """The rig."""

    name = "astm-pivot"
    title = "ASTM pivoted bat: 60 mph cannon, light gates, encoder on the pivot"
    stage = Stage.IMPACT
    channels: Mapping[str, type[Record]] = {
        "log": ShotLog,
        "gates": GateRecord,
        "encoder": EncoderRecord,
        "aim": AimMarks,
    }

    def commission(self, draws: Draws, *, ideal: bool = False) -> AstmPivotStation:
        spec = catalog.load("rigs", self.name, AstmPivotSpec).spec
        cannon = catalog.load("instruments", spec.cannon, CannonSpec).spec
        gates = catalog.load("instruments", spec.gates, LightGateSpec).spec
        encoder = catalog.load("instruments", spec.encoder, EncoderSpec).spec
        air = catalog.load("instruments", spec.air, AirSpec).spec
        pivot = spec.pivot
        if ideal:
            cannon, gates, encoder = cannon.ideal(), gates.ideal(), encoder.ideal()
            air, pivot = air.ideal(), pivot.ideal()
        misplaced = pivot.place_u * float(draws.normal("astm-pivot.pivot.errors"))
        return AstmPivotStation(
            pivot=pivot,
            pivot_from_knob=pivot.from_knob + misplaced,
            cannon=Cannon.commission(cannon, draws, "astm-pivot.cannon"),
            gates=LightGates.commission(gates, draws, "astm-pivot.gates"),
            encoder=Encoder.commission(encoder, draws, "astm-pivot.encoder"),
            air=Air.commission(air, draws, "hall.air"),
            gravity=0.0 if ideal else STANDARD_GRAVITY,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotStation:
    """The rig in one laboratory."""

    pivot: PivotSpec
    pivot_from_knob: float
    cannon: Cannon
    gates: LightGates
    encoder: Encoder
    air: Air
    gravity: float

    @property
    def calibration(self) -> dict[str, Estimate]:
        place = Estimate(value=self.pivot.from_knob, u=self.pivot.place_u)
        return {"pivot.from_knob": place} | calibration_of(self._instruments)

    @property
    def true_constants(self) -> dict[str, float]:
        return {"pivot.from_knob": self.pivot_from_knob} | errors_of(self._instruments)

    @property
    def _instruments(self) -> dict[str, Instrument]:
        return {
            "cannon": self.cannon,
            "gates": self.gates,
            "encoder": self.encoder,
            "air": self.air,
        }

    def play(self, order: Order, specimen: Specimen, draws: Draws) -> Play:
        """Fire at the bat; every shot finds it at rest and is timed from its trigger."""
        launch = self.cannon.fire(order.speed, draws, "astm-pivot.launch", order.block)
        hit_restitution = specimen.balls.draw_hits(
            order.ball, launch.speed, draws, "astm-pivot.hit", order.block
        )
        place = order.place + launch.along
        tilt = self._contact_angle(specimen, place, launch)
        model = self._collision(specimen)
        scenes = _scenes(specimen, order.ball, place, launch.speed * np.cos(tilt), hit_restitution)
        collisions = model.collide(scenes)
        passage = self._passage(order, specimen, launch, tilt, collisions)
        contact = self.gates.arrival(passage)
        leaving = contact + collisions.contact_time
        angle = self._recoil(specimen, model, collisions, tilt, contact, leaving)
        block = order.block
        return Play(
            records={
                "log": order.log(),
                "gates": self.gates.watch(
                    passage, contact, leaving, draws, "astm-pivot.gates", block
                ),
                "encoder": self.encoder.read(angle, draws, "astm-pivot.encoder", block),
                "aim": self.cannon.mark(draws, "astm-pivot.aim"),
            },
            truth={
                "speed": launch.speed,
                "place": place,
                "across": launch.across,
                "ball_restitution": hit_restitution,
                "collision_efficiency": collisions.collision_efficiency,
                "rebound_speed": passage.speed_out,
                "contact_time": collisions.contact_time,
            },
        )

    def outcome(self, speed: float, place: float, specimen: Specimen) -> TrueOutcome:
        """Return what an error-free test would find, on an axis exactly where it should be."""
        ball = specimen.balls.mean_ball()
        beam = beam_of(specimen.bat.body)
        axis = beam.length - self.pivot.from_knob
        first, at = np.zeros(1, dtype=int), np.array([speed])
        e0 = ball.restitution_at(first, at)
        scenes = _scenes(replace(specimen, balls=ball), first, np.array([place]), at, e0)
        model = specimen.collision(specimen.bat.body, Pinned(axis))
        efficiency = model.collide(scenes).collision_efficiency
        recoil = np.asarray(recoil_factor_pivoted(ball.mass, beam.inertia(axis), axis - place))
        return TrueOutcome(
            collision_efficiency=float(efficiency[0]),
            restitution=float(np.ravel(restitution_from_efficiency(efficiency, recoil))[0]),
            recoil_factor=float(recoil[0]),
            ball_restitution=float(e0[0]),
            relative_speed=speed,
        )

    def _collision(self, specimen: Specimen) -> CollisionModel:
        body = specimen.bat.body
        return specimen.collision(body, Pinned(body.length - self.pivot_from_knob))

    def _contact_angle(self, specimen: Specimen, place: Array, launch: Launch) -> Array:
        """Return the angle between the line of fire and the line of centres [rad]."""
        barrel = outer_diameter(specimen.bat.body.profile, place) / 2
        return np.asarray(offset_angle(launch.across, specimen.balls.spec.radius, barrel))

    def _passage(
        self,
        order: Order,
        specimen: Specimen,
        launch: Launch,
        tilt: Array,
        collisions: Collisions,
    ) -> Passage:
        """Return the flights: smooth contact keeps the speed along the barrel's surface."""
        balls = specimen.balls
        efficiency = collisions.collision_efficiency
        back = np.asarray(efficiency_off_axis(efficiency, tilt))
        up = (1 + efficiency) * np.cos(tilt) * np.sin(tilt)
        return Passage(
            speed_in=launch.speed,
            speed_out=back * launch.speed,
            drag=self.air.drag(balls.spec.radius, balls.mass[order.ball]),
            radius=balls.spec.radius,
            rise_per_metre=up / np.where(back == 0, np.nan, back),
            gravity=self.gravity,
        )

    def _recoil(
        self,
        specimen: Specimen,
        model: CollisionModel,
        collisions: Collisions,
        tilt: Array,
        contact: Array,
        leaving: Array,
    ) -> Array:
        """Return the true angle at the encoder [rad], shape (shot, sample)."""
        body, modes = specimen.bat.body, model.modes
        axis = body.length - self.pivot_from_knob
        turn = modes.rotation(axis) * np.cos(tilt)[:, None]
        inertia = beam_of(body).inertia(axis)
        # the recorder's ticks are the gates' clock, which runs a little fast or slow
        since = self.encoder.spec.sample_times() / self.gates.clock - leaving[:, None]
        free = np.maximum(since, 0.0)
        bends = slice(modes.rigid, None)
        start = (collisions.modal_displacements * turn)[:, : modes.rigid].sum(axis=1)
        rate = (collisions.modal_velocities * turn)[:, : modes.rigid].sum(axis=1)
        angle = start[:, None] + coast(
            rate,
            free,
            constant=self.pivot.constant_torque / inertia,
            linear=self.pivot.viscous_torque / inertia,
            quadratic=self.pivot.air_torque / inertia,
        )
        if self.encoder.spec.sees_ring:
            angle += ring(
                turn[:, bends],
                collisions.modal_displacements[:, bends],
                collisions.modal_velocities[:, bends],
                modes.angular_frequencies[bends],
                body.damping_ratio,
                free,
            )
        # during contact, a millisecond that no reduction uses, the angle just grows smoothly
        touching = np.clip(1 + since / (leaving - contact)[:, None], 0.0, 1.0)
        return np.asarray(angle * touching**2 * (3 - 2 * touching))


def _scenes(
    specimen: Specimen, ball: NDArray[np.int_], place: Array, speed: Array, e0: Array
) -> Scenes:
    balls = specimen.balls
    return Scenes.of(
        impact_position=place,
        relative_speed=speed,
        ball_mass=balls.mass[ball],
        ball_restitution=e0,
        stiffness=balls.spec.stiffness,
        exponent=balls.spec.exponent,
    )


RIG = AstmPivot()
