"""The ASTM pivoted bat: a 60 mph ball, a bat at rest on a vertical axis 6 in from its knob.

The cannon fires at the place the operator set; light gates time the ball in and, where it
reaches them, out; an encoder on the axis counts the recoil. The encoder turns with the
section of the bat at the axis, so it also shows the bending ring.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BatBody, Dimension, Spec
from virtual_lab.records import AimMarks, EncoderRecord, GateRecord, Record, ShotLog
from virtual_lab.simulation.collision.scene import CollisionModel, Collisions, Scenes
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
    RecordDetail,
    calibration_of,
    errors_of,
)
from virtual_lab.simulation.instruments.air import Air, AirSpec
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, Freedom, certified
from virtual_lab.simulation.instruments.cannon import Cannon, CannonSpec
from virtual_lab.simulation.instruments.encoder import Encoder, EncoderSpec
from virtual_lab.simulation.instruments.gravity import Gravity, GravitySpec
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.physics.coasting import coasting, ringing
from virtual_lab.simulation.physics.supports import Pinned
from virtual_lab.simulation.rig import Motion, RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.simulation.truth import TrueOutcome
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["RIG", "AstmPivot"]

Array = NDArray[np.float64]
GAP = 2.3e-3  # s, a recorder that sums up leaves out after contact: the blow's own shudder


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotSpec(Spec):
    """The bearing that holds the bat: its place, and the torques that slow the recoil."""

    nominal_from_knob: Annotated[float, Gt(0), Dimension("length")]  # where the axis should be
    from_knob: Annotated[float, Gt(0), Dimension("length")]
    from_knob_u: Annotated[float, Ge(0), Dimension("length")]
    constant_torque: Annotated[float, Ge(0), Dimension("torque")]
    viscous_torque: Annotated[float, Ge(0), Dimension("viscous torque")]
    air_torque: Annotated[float, Ge(0), Dimension("quadratic torque")]
    friction: Annotated[float, Ge(0), Dimension("number")]  # of the journal, under the blow
    journal_radius: Annotated[float, Ge(0), Dimension("length")]
    clearance: Annotated[float, Ge(0), Dimension("length")]  # that the journal moves either way
    from_knob_dof: Freedom = inf

    def ideal(self) -> Self:
        """Return the bearing that is where it was surveyed and turns freely in no air."""
        return replace(
            self,
            from_knob_u=0.0,
            constant_torque=0.0,
            viscous_torque=0.0,
            air_torque=0.0,
            friction=0.0,
            clearance=0.0,
        )

    def certificate(self) -> dict[str, Estimate]:
        """Return where the axis was surveyed to be."""
        return {"from_knob": certified(self.from_knob, self.from_knob_u, self.from_knob_dof)}


@dataclass(frozen=True, slots=True)
class Pivot(CalibratedInstrument[PivotSpec]):
    """The bearing of one laboratory."""

    @property
    def from_knob(self) -> float:
        """The true distance of the axis from the knob [m]."""
        return self.true["from_knob"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotSpec(Spec):
    """Which instruments make up the rig, and its bearing."""

    name: str
    title: str
    cannon: str
    gates: str
    encoder: str
    air: str
    gravity: str
    pivot: PivotSpec


class AstmPivot:
    """The rig."""

    name = "astm-pivot"
    title = "ASTM pivoted bat: 60 mph cannon, light gates, encoder on the pivot"
    stage = Stage.IMPACT
    motions = frozenset(Motion)
    channels: Mapping[str, type[Record]] = {
        "log": ShotLog,
        "gates": GateRecord,
        "encoder": EncoderRecord,
        "aim": AimMarks,
    }

    def commission(self, draws: Draws, *, ideal: bool = False) -> AstmPivotStation:
        spec = catalog.load("rigs", self.name, AstmPivotSpec).spec
        outfitter = InstrumentFactory(draws=draws, ideal=ideal)
        fit = outfitter.commission
        pivot = outfitter.as_asked(spec.pivot)
        return AstmPivotStation(
            pivot=Pivot.commission(pivot, draws, "astm-pivot.pivot"),
            cannon=fit(Cannon.commission, CannonSpec, spec.cannon, "astm-pivot.cannon"),
            gates=fit(LightGates.commission, LightGateSpec, spec.gates, "astm-pivot.gates"),
            encoder=fit(Encoder.commission, EncoderSpec, spec.encoder, "astm-pivot.encoder"),
            air=fit(Air.commission, AirSpec, spec.air, "hall.air"),
            hall=fit(Gravity.commission, GravitySpec, spec.gravity, "hall.gravity"),
            ideal=ideal,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotStation:
    """The rig in one laboratory."""

    pivot: Pivot
    cannon: Cannon
    gates: LightGates
    encoder: Encoder
    air: Air
    hall: Gravity
    ideal: bool

    @property
    def calibration(self) -> dict[str, Estimate]:
        return calibration_of(self._instruments)

    @property
    def true_constants(self) -> dict[str, float]:
        return errors_of(self._instruments)

    @property
    def _instruments(self) -> dict[str, Instrument]:
        return {
            "pivot": self.pivot,
            "cannon": self.cannon,
            "gates": self.gates,
            "encoder": self.encoder,
            "air": self.air,
        }

    def play(self, order: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat; every shot finds it at rest and is timed from its trigger."""
        balls, body, slots = specimen.balls, specimen.bat.body, order.slot
        launch = self.cannon.fire(order.speed, draws, "astm-pivot.launch", slots)
        e0 = balls.draw_hits(order.ball, launch.speed, draws, "astm-pivot.hit", slots)
        place = order.place + launch.along
        tilt = contact_angle(specimen, place, launch.across)
        scenes = scenes_of(specimen, order.ball, place, launch.speed * np.cos(tilt), e0)
        if order.rung is RecordDetail.SUMMED:
            efficiency, contact_time = impact_efficiency(
                specimen,
                order.rung,
                scenes,
                self.pivot.from_knob,
                self.pivot.spec.nominal_from_knob,
            )
        else:
            model = specimen.collision(body, Pinned(body.length - self.pivot.from_knob))
            collisions = model.collide(scenes)
            efficiency, contact_time = collisions.collision_efficiency, collisions.contact_time
        back, up = thrown_back(efficiency, tilt, launch.speed, 0.0)
        passage = Passage(
            speed_in=launch.speed,
            speed_out=back,
            drag=self.air.drag(balls.spec.radius, balls.mass[order.ball]),
            radius=balls.spec.radius,
            gravity=0.0 if self.ideal else self.hall.acceleration,
            height=launch.across,
            slope_out=up,
        )
        passage = at_rest(
            passage, order, specimen, self.pivot.from_knob, place, launch.across, efficiency
        )
        contact = self.gates.arrival(passage)
        leaving = contact + contact_time
        if order.rung is RecordDetail.SUMMED:
            rate = self._rate(scenes, efficiency, tilt, specimen)
            span = self.encoder.spec.duration - leaving - GAP
            encoder: Record = self.encoder.sum_up(
                rate / self.gates.clock, draws, "astm-pivot.encoder", slots, span=span, gap=GAP
            )
        else:
            turn = self._recoil(specimen, model, collisions, tilt, contact, leaving)
            encoder = self.encoder.read(turn, draws, "astm-pivot.encoder", slots)
        return RigOutput(
            records={
                "log": order.log(),
                "gates": self.gates.watch(
                    passage, contact, leaving, draws, "astm-pivot.gates", slots, order.rung
                ),
                "encoder": encoder,
                "aim": self.cannon.mark(draws, "astm-pivot.aim"),
            },
            truth={
                "speed": launch.speed,
                "place": place,
                "across": launch.across,
                "ball_restitution": e0,
                "collision_efficiency": efficiency,
                "rebound_speed": passage.speed_out,
                "contact_time": contact_time,
            },
        )

    def outcome(self, order: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return what an error-free test would find, on an axis exactly where it should be.

        An ideal laboratory is to show algebra alone, and e_A knows the axis to 1e-5: there it is
        that of the bat where it was surveyed to hang.
        """
        nominal = self.pivot.spec.nominal_from_knob
        hung = self.pivot.from_knob if self.ideal else nominal
        return error_free(order, specimen, Pinned(specimen.bat.body.length - hung), nominal)

    def _rate(self, scenes: Scenes, efficiency: Array, tilt: Array, specimen: Specimen) -> Array:
        """Return the rate of the rigid bat as the ball leaves [rad/s], (shot,)."""
        body = specimen.bat.body
        axis = body.length - self.pivot.from_knob
        impulse = scenes.ball_mass * scenes.relative_speed * (1 + efficiency) * np.cos(tilt)
        rate = impulse * (axis - scenes.impact_position) / beam_of(body).inertia(axis)
        return rate - self._rubbed(rate, impulse, body)

    def _rubbed(self, rate: Array, impulse: Array, body: BatBody) -> Array:
        """Return the rate the bearing takes while the blow loads it; none at percussion [rad/s]."""
        beam = beam_of(body)
        axis = beam.length - self.pivot.from_knob
        reaction = np.abs(impulse - beam.mass * (axis - beam.z_cm) * rate)
        lost = (
            self.pivot.spec.friction
            * self.pivot.spec.journal_radius
            * reaction
            / beam.inertia(axis)
        )
        return np.asarray(np.sign(rate) * np.minimum(lost, np.abs(rate)))

    def _loose(self, impulse: Array, rate: Array, body: BatBody) -> tuple[Array, float]:
        """Return how fast a bat turns beside `rate` until its journal bears, and how far.

        Until then the bat moves as a free one. Its angular momentum about the axis is that of
        the pivoted bat all along, so the play is worth the angle clearance / distance from axis
        to centre of percussion, whichever side of it was struck, and no rate. The journal is
        taken not to bounce. (shot,) [rad/s], [rad].
        """
        beam = beam_of(body)
        lever = beam.length - self.pivot.from_knob - beam.z_cm
        reaction = impulse - beam.mass * lever * rate
        yields = 1 / beam.mass + lever**2 / beam.inertia_cm  # of the free bat, at the axis
        length = beam.inertia(beam.length - self.pivot.from_knob) / (beam.mass * lever)
        return -reaction * yields / length, self.pivot.spec.clearance / length

    def _recoil(
        self,
        specimen: Specimen,
        model: CollisionModel,
        collisions: Collisions,
        tilt: Array,
        contact: Array,
        leaving: Array,
    ) -> Callable[[slice], Array]:
        """Return what tells the true angles at the encoder [rad] of some shots, (shot, sample)."""
        body, modes = specimen.bat.body, model.modes
        axis = body.length - self.pivot.from_knob
        turn = modes.rotation(axis) * np.cos(tilt)[:, None]
        inertia = beam_of(body).inertia(axis)
        # the recorder's ticks are the gates' clock, which runs a little fast or slow
        ticks = self.encoder.spec.sample_times() / self.gates.clock
        moved, moving = collisions.modal_displacements, collisions.modal_velocities
        impulse = collisions.impulse * np.cos(tilt)
        start, rate = ((own * turn)[:, : modes.rigid].sum(axis=1) for own in (moved, moving))
        rate = rate - self._rubbed(rate, impulse, body)
        slip, play = self._loose(impulse, rate, body)
        shots, at_ticks = coasting(
            rate,
            ticks,
            leaving,
            constant=self.pivot.spec.constant_torque / inertia,
            linear=self.pivot.spec.viscous_torque / inertia,
            quadratic=self.pivot.spec.air_torque / inertia,
        )
        shots[:, 0] += start
        if self.encoder.spec.sees_ring:
            bends = slice(modes.rigid, None)
            state = turn[:, bends], moved[:, bends], moving[:, bends]
            frequencies = modes.angular_frequencies[bends]
            rings, ring_at_ticks = ringing(*state, frequencies, body.damping_ratio, ticks, leaving)
            shots, at_ticks = np.hstack([shots, rings]), np.vstack([at_ticks, ring_at_ticks])
            start = (moved * turn).sum(axis=1)

        def angle(part: slice) -> Array:
            found = shots[part] @ at_ticks
            touch, release = contact[part, None], leaving[part, None]
            early = slice(0, int(np.searchsorted(ticks, release.max())))
            found[:, early] = np.where(ticks[early] > release, found[:, early], start[part, None])
            slipped = np.maximum(ticks - touch, 0.0)
            slipped *= slip[part, None]
            found += np.clip(slipped, -play, play, out=slipped)
            # during contact, a millisecond that no reduction uses, the angle grows smoothly
            touching = np.clip((ticks[early] - touch) / (release - touch), 0.0, 1.0)
            found[:, early] *= touching**2 * (3 - 2 * touching)
            return np.asarray(found)

        return angle


RIG = AstmPivot()
