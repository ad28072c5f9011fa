"""The ASTM pivoted bat: a 60 mph ball, and a bat at rest on a vertical pivot 6 in from its knob.

The cannon fires at the position that the operator set. Light gates time the incoming ball and, if
it reaches them, the rebound. An encoder on the pivot counts the recoil. It rotates with the section
of the bat at the pivot, so it also records the bending vibration.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import AimMarks, EncoderRecord, GateRecord, Record, ShotLog
from virtual_lab.simulation.instruments import (
    Instrument,
    InstrumentFactory,
    RecordDetail,
    true_constants_of,
)
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.simulation.instruments.encoder import Encoder, EncoderSpec
from virtual_lab.simulation.instruments.holder import AxisSpec, Holder
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.physics.beam import RigidBat
from virtual_lab.simulation.physics.coasting import coasting, ringing
from virtual_lab.simulation.stations.cannon_station import (
    FiredShots,
    RestingBatSpec,
    RestingBatStation,
    commission,
)
from virtual_lab.simulation.stations.rig import MotionModel, RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws, Owner, of_owners
from virtual_lab.units import Array

GAP = 2.3e-3  # time after contact left out of summary values, because of the impact [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class PivotSpec(AxisSpec):
    """The bearing that holds the bat: its position, and the torques that slow the recoil."""

    other_errors: ClassVar[tuple[str, ...]] = (
        "constant_torque",
        "viscous_torque",
        "air_torque",
        "friction",
        "clearance",
        "clamp_inertia",
        "clamp_spread",
    )

    constant_torque: Annotated[float, Ge(0), Dimension("torque")]
    viscous_torque: Annotated[float, Ge(0), Dimension("viscous torque")]
    air_torque: Annotated[float, Ge(0), Dimension("quadratic torque")]
    friction: Annotated[float, Ge(0), Dimension("number")]  # coefficient of the loaded journal
    journal_radius: Annotated[float, Ge(0), Dimension("length")]
    clearance: Annotated[float, Ge(0), Dimension("length")]  # play of the journal in each direction
    # moment of inertia about the axis of parts that turn with the bat but are in no record, and its
    # standard deviation between laboratories
    clamp_inertia: Annotated[float, Ge(0), Dimension("inertia")] = 0.0
    clamp_spread: Annotated[float, Ge(0), Dimension("inertia")] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotSpec(RestingBatSpec):
    """Data sheet of the rig: instruments, bearing, and objects around the bat."""

    encoder: str
    pivot: PivotSpec


class AstmPivot:
    """The ASTM pivoted-bat rig."""

    name = "astm-pivot"
    stage = Stage.IMPACT
    blocks = True
    motions = frozenset(MotionModel)
    channels: Mapping[str, type[Record]] = {
        "log": ShotLog,
        "gates": GateRecord,
        "encoder": EncoderRecord,
        "aim": AimMarks,
    }

    def commission(self, draws: Draws, *, ideal: bool = False) -> AstmPivotStation:
        spec = catalog.load("rigs", self.name, AstmPivotSpec).spec
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        pivot = factory.adapt(spec.pivot)
        clamp = pivot.clamp_inertia + pivot.clamp_spread * draws.normal("astm-pivot.clamp")
        return AstmPivotStation(
            clamp=np.maximum(clamp, 0.0),
            holder=Holder.commission(pivot, draws, "astm-pivot.pivot"),
            encoder=factory.commission(
                Encoder.commission, EncoderSpec, spec.encoder, "astm-pivot.encoder"
            ),
            frame=spec.frame,
            stop=spec.stop,
            **commission(spec, factory, self.name, LightGates, LightGateSpec),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AstmPivotStation(RestingBatStation):
    """The ASTM pivoted-bat rig in one laboratory, or in a block of them."""

    name = "astm-pivot"

    holder: Holder[PivotSpec]
    encoder: Encoder
    clamp: TrueConstant  # moment of inertia of the parts that turn with the bat [kg m²]

    @property
    def true_constants(self) -> dict[str, Any]:
        clamp = {"clamp.inertia": self.clamp} if np.any(self.clamp) else {}
        return clamp | true_constants_of(self.instruments())

    def instruments(self) -> dict[str, Instrument]:
        return {
            "pivot": self.holder,
            "cannon": self.cannon,
            "gates": self.gates,
            "encoder": self.encoder,
            "air": self.air,
        }

    @property
    def gravity(self) -> TrueConstant:
        return 0.0 if self.ideal else self.hall.acceleration

    def at(self, owner: Owner) -> AstmPivotStation:
        """Return the station with the true constants of each shot's laboratory."""
        if owner is ...:
            return self
        station = RestingBatStation.at(self, owner)
        return replace(station, clamp=of_owners(self.clamp, owner))

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest; the times of each shot start at its trigger."""
        fired = self.fire(plan, specimen, draws)
        name, slots = "astm-pivot.encoder", plan.slot
        if plan.detail is RecordDetail.SUMMED:
            clamp = of_owners(self.clamp, plan.owner)
            rate = self._rate(specimen.bat.of_shots(plan.owner).rigid, fired, clamp)
            clock = self.gates.at(plan.owner).clock
            # The span ends with the record, or earlier when a bat without friction would reach its
            # stop.
            with np.errstate(divide="ignore"):
                turning = self.stop.angle / np.abs(rate)
            span = np.minimum(self.encoder.spec.duration - fired.leaving, turning) - GAP
            streams = draws.at(plan.owner)
            encoder: Record = self.encoder.at(plan.owner).sum_up(
                rate / clock, streams, name, slots, span=span, gap=GAP
            )
        else:
            encoder = self.encoder.read(self._recoil(specimen, fired), draws, name, slots)
        timed = self.record_flights(fired, plan, draws)
        return replace(timed, records={**timed.records, "encoder": encoder})

    def _rate(self, bat: RigidBat[Any], fired: FiredShots, clamp: TrueConstant) -> Array:
        """Return the angular rate of the rigid bat when the ball leaves it, (shot,) [rad/s].

        `clamp` is the moment of inertia of the parts that turn with the bat [kg m²], (shot,).
        """
        axis, scenes = fired.bat.axis, fired.impacts.scenes
        impulse = scenes.ball_mass * scenes.relative_speed * (1 + fired.impacts.efficiency)
        impulse = impulse * np.cos(fired.tilt) * fired.flights.reached_bat
        rate = impulse * (axis - scenes.impact_position) / (fired.bat.inertia + clamp)
        return np.asarray(rate - self._friction_loss(rate, impulse, bat, axis))

    def _friction_loss(self, rate: Array, impulse: Array, bat: RigidBat[Any], axis: Array) -> Array:
        """Return the rate lost by friction under the impact load, (shot,) [rad/s].

        It is 0 for a hit at the center of percussion.
        """
        reaction = np.abs(impulse - bat.mass * (axis - bat.z_cm) * rate)
        loss = (
            self.holder.spec.friction
            * self.holder.spec.journal_radius
            * reaction
            / bat.inertia(axis)
        )
        return np.asarray(np.sign(rate) * np.minimum(loss, np.abs(rate)))

    def _clearance(self, impulse: Array, rate: Array, bat: RigidBat[Any]) -> tuple[Array, float]:
        """Return the additional rate, (shot,) [rad/s], and angle [rad] in the bearing's clearance.

        While the bat takes up the clearance it moves like a free bat. Its angular momentum about
        the pivot always equals that of the pivoted bat. For a hit on either side of the center of
        percussion, the clearance therefore adds an angle (clearance divided by the distance from
        pivot to center of percussion), but does not change the final rate. The journal does not
        bounce.
        """
        lever = bat.length - self.holder.from_knob - bat.z_cm
        reaction = impulse - bat.mass * lever * rate
        yields = 1 / bat.mass + lever**2 / bat.inertia_cm  # compliance of the free bat at the pivot
        length = bat.inertia(bat.length - self.holder.from_knob) / (bat.mass * lever)
        return np.asarray(-reaction * yields / length), self.holder.spec.clearance / length

    def _recoil(self, specimen: Specimen, fired: FiredShots) -> Callable[[slice], Array]:
        """Return a function that computes true angles of the encoder, (shot, sample) [rad].

        It takes a slice of the shots.
        """
        body, bat = specimen.bat.body, specimen.bat.rigid
        tilt, contact, flights = fired.tilt, fired.contact, fired.flights
        leaving = contact + fired.impacts.contact_time
        modes, collisions = fired.impacts.modes, fired.impacts.collisions
        assert modes is not None
        assert collisions is not None
        axis = body.length - self.holder.from_knob
        turn = modes.rotation(axis) * np.cos(tilt)[:, None]
        inertia = bat.inertia(axis)
        # The recorder uses the clock of the gates, which has a small rate error.
        ticks = self.encoder.spec.sample_times() / self.gates.clock
        displacements, velocities = collisions.modal_displacements, collisions.modal_velocities
        impulse = collisions.impulse * np.cos(tilt)
        start, rate = (
            (modal * turn)[:, : modes.rigid].sum(axis=1) for modal in (displacements, velocities)
        )
        rate = rate * inertia / (inertia + self.clamp)  # bat and clamp share the angular momentum
        rate = rate - self._friction_loss(rate, impulse, bat, fired.bat.axis)
        slip, play = self._clearance(impulse, rate, bat)
        shots, at_ticks = coasting(
            rate,
            ticks,
            leaving,
            constant=self.holder.spec.constant_torque / inertia,
            linear=self.holder.spec.viscous_torque / inertia,
            quadratic=self.holder.spec.air_torque / inertia,
        )
        shots[:, 0] += start
        if self.encoder.spec.sees_ring:
            bends = slice(modes.rigid, None)
            state = turn[:, bends], displacements[:, bends], velocities[:, bends]
            frequencies = modes.angular_frequencies[bends]
            rings, ring_at_ticks = ringing(*state, frequencies, body.damping_ratio, ticks, leaving)
            shots, at_ticks = np.hstack([shots, rings]), np.vstack([at_ticks, ring_at_ticks])
            start = (displacements * turn).sum(axis=1)

        def angle(part: slice) -> Array:
            angles = shots[part] @ at_ticks
            touch, release = contact[part, None], leaving[part, None]
            early = slice(0, int(np.searchsorted(ticks, release.max())))
            angles[:, early] = np.where(ticks[early] > release, angles[:, early], start[part, None])
            slipped = np.maximum(ticks - touch, 0.0)
            slipped *= slip[part, None]
            angles += np.clip(slipped, -play, play, out=slipped)
            # During contact, a millisecond that no reduction uses, the angle grows smoothly.
            touching = np.clip((ticks[early] - touch) / (release - touch), 0.0, 1.0)
            angles[:, early] *= touching**2 * (3 - 2 * touching)
            stop, over = self.stop, angles > self.stop.angle
            angles[over] = stop.angle - stop.restitution * (angles[over] - stop.angle)
            for shot, after, change in flights.kicks:
                if shot in range(*part.indices(len(contact))):
                    record = angles[shot - (part.start or 0)]
                    record += change * np.maximum(ticks - contact[shot] - after, 0.0)
            if not np.all(flights.reached_bat):
                angles *= np.broadcast_to(flights.reached_bat, contact.shape)[part, None]
            return np.asarray(angles)

        return angle


RIG = AstmPivot()
