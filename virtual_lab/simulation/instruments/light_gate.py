"""Light gates: light curtains that time the two edges of a passing ball.

The true position of a curtain differs from the surveyed position. The clock of the recorder has a
rate error, adds jitter to each edge, and counts whole ticks. The mean of the two edges is the
passage of the ball's center, whatever the trip level of the curtain is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Annotated, ClassVar, NamedTuple, TypeVar

import numpy as np
from annotated_types import Ge, Gt, MinLen

from virtual_lab.catalog.specs import Dimension
from virtual_lab.errors import InputError
from virtual_lab.records import GateRecord, PassageRecord, Record
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    StandardDeviation,
    TrueConstant,
    stated_constant,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

Time = Annotated[float, Ge(0), Dimension("time")]
# a standard uncertainty of all gates, or one of each gate
LengthsU = Annotated[float | tuple[float, ...], Dimension("length", low=0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class GateSheet(CalibratedSpec):
    """Data sheet of gates: distances from the ball's position at contact, farthest first."""

    kind: str
    title: str
    distances: Annotated[tuple[float, ...], MinLen(2), Dimension("length")]
    distance_u: LengthsU
    tick: Time
    edge_jitter: Time
    clock_u: Annotated[float, Ge(0), Dimension("number")]
    distance_dof: Freedom = inf
    clock_fast: Annotated[float, Gt(-1), Dimension("number")] = 0.0  # rate error of the clock

    def __post_init__(self) -> None:
        falling = sorted(set(self.distances), reverse=True)
        if list(self.distances) != falling or falling[-1] <= 0:
            raise ValueError("distances must fall from the cannon's to the target's, all above 0")
        self.of_each_gate(self.distance_u)

    def of_each_gate(self, u: float | tuple[float, ...]) -> tuple[float, ...]:
        """Return the standard uncertainty of each gate. Raises `ValueError` for another number."""
        values = u if isinstance(u, tuple) else (u,) * len(self.distances)
        if len(values) != len(self.distances):
            raise ValueError(f"{len(values)} uncertainties of {len(self.distances)} gates")
        return values

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return the distances of the gates, from their calibration `constants`."""
        count = sum(key.startswith("distance_") for key in constants)
        gates = tuple(constants[f"distance_{at}"] for at in range(count))
        return {"distances": gates} if gates else {}

    def certificate(self) -> dict[str, Estimate]:
        """Return the distance of each gate, and the clock: recorded time = clock x true time."""
        each = zip(self.distances, self.of_each_gate(self.distance_u), strict=True)
        return {
            f"distance_{index}": stated_constant(distance, u, self.distance_dof)
            for index, (distance, u) in enumerate(each)
        } | {"clock": stated_constant(1 + self.clock_fast, self.clock_u)}


def per_shot(constant: TrueConstant, shots: int) -> Array:
    """Return a constant, given once or per shot, as a new array with one value per shot, (shot,).

    `constant` is a number or an array (shot,). Raises `ValueError` for another shape.
    """
    return np.full(shots, constant)


class WatchedBatch(NamedTuple):
    """Balls that reach the target at `contact` and leave it at `leaving` [s]."""

    passage: Passage
    contact: Array  # (shot,)
    leaving: Array  # (shot,)
    draws: Draws
    name: str  # name for the random numbers
    slots: Slots


G = TypeVar("G", bound=GateSheet)


@dataclass(frozen=True, slots=True)
class BallGates(CalibratedInstrument[G], ABC):
    """Gates of either type in one laboratory or a block of laboratories."""

    @property
    def distances(self) -> Array:
        """True distances [m], (gate,); in a block (laboratory, gate) or (shot, gate)."""
        return self.of_gates("distance")

    @property
    def clock(self) -> TrueConstant:
        """Recorded seconds per true second."""
        return self.true["clock"]

    def of_gates(self, constant: str) -> Array:
        """Return a true constant of every gate, with the gates along the last axis."""
        gates = range(len(self.spec.distances))
        return np.stack([self.true[f"{constant}_{gate}"] for gate in gates], axis=-1)

    def rows(self, constant: str, shots: int) -> Array:
        """Return a true constant of every gate as rows for compiled code, (gate, shot)."""
        gates = range(len(self.spec.distances))
        return np.stack([np.broadcast_to(self.true[f"{constant}_{at}"], shots) for at in gates])

    def arrival(self, passage: Passage) -> Array:
        """Return the true time from the trigger to contact [s], shape (shot,).

        The trigger is the passage of the ball's front at the far gate.
        """
        return passage.inbound(np.atleast_1d(self.true["distance_0"] + passage.radius))[0]

    def watch(
        self,
        passage: Passage,
        contact: Array,
        leaving: Array,
        draws: Draws,
        name: str,
        slots: Slots,
        detail: RecordDetail = RecordDetail.FULL,
    ) -> Record:
        """Return the record of balls at the target from `contact` to `leaving` [s], (shot,).

        Raises `InputError` if `slots` have another shape than `contact`.
        """
        if slots.shape != contact.shape:
            raise InputError("", "slots", slots.shape, f"allowed: one per shot, {contact.shape}")
        record = self.edges if detail is RecordDetail.FULL else self.sums
        written = record(WatchedBatch(passage, contact, leaving, draws, name, slots))
        return (
            written
            if passage.frame_distance is None
            else passage.without_unreached(written, self.distances)
        )

    @abstractmethod
    def edges(self, batch: WatchedBatch) -> Record:
        """Return the record of every edge."""

    @abstractmethod
    def sums(self, batch: WatchedBatch) -> PassageRecord:
        """Return the passages that a recorder computes from the edges of each gate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LightGateSpec(GateSheet):
    """Data sheet of a row of light curtains."""

    other_errors: ClassVar[tuple[str, ...]] = ("tick",)

    half_height: Annotated[float, Gt(0), Dimension("length")]  # half height about the line of fire

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return the calibrated distances of the gates, and the jitter that the edges show.

        The chords of an incoming ball at two gates differ by the jitter of four edges, and by the
        drag between the gates, which is proportional to the chord.
        """
        numbers = dict(GateSheet.numbers_in(self, records, constants))
        for record in records:
            if isinstance(record, GateRecord):
                chords = np.diff(record.times[:, 0], axis=-1)[..., 0]
                first, last = chords[np.isfinite(chords).all(axis=1)][:, [0, -1]].T
                if first.size > 2:
                    apart = last - first
                    apart = apart - np.polynomial.Polynomial.fit(first, apart, 1)(first)
                    jitter = sqrt(float(apart @ apart) / (first.size - 2)) / 2
                    numbers |= {
                        "edge_jitter": StandardDeviation(jitter, first.size - 2),
                        "tick": 0.0,
                    }
        return numbers

    @property
    def detected_depth(self) -> float:
        """Largest depth of a ball's center below the line of fire that is still detected [m]."""
        return self.half_height

    def view(self, radius: float) -> tuple[float, float]:
        """Return the lowest and the highest position of a ball's center that is detected [m]."""
        return -self.half_height, self.half_height


@dataclass(frozen=True, slots=True)
class LightGates(BallGates[LightGateSpec]):
    """The light curtains of one laboratory or a block of laboratories."""

    def edges(self, batch: WatchedBatch) -> GateRecord:
        passage, contact, leaving, draws, name, slots = batch
        edge = passage.radius * np.array([1.0, -1.0])
        before, _ = passage.inbound((self.distances[:, None] + edge)[None])
        after, height = passage.outbound((self.distances[:, None] - edge)[None])
        inbound = contact[:, None, None] - before
        outbound = leaving[:, None, None] + self._blank_missed(after, height)
        times = np.stack([inbound, outbound], axis=1)
        spec = self.spec
        start = spec.tick * draws.uniform(f"{name}.start", (1, 1, 1), slots)
        jitter = spec.edge_jitter * draws.normal(f"{name}.jitter", times.shape[1:], slots)
        return GateRecord(times=quantise(self.clock * times + start + jitter, spec.tick))

    def sums(self, batch: WatchedBatch) -> PassageRecord:
        """Return the passage at each gate, with the noise of the mean of two edges.

        The heights are NaN, because gates do not measure them.
        """
        passage, contact, leaving, draws, name, slots = batch
        from virtual_lab.simulation.instruments.gate_kernel import Gates, sum_up_gates

        spec, shots = self.spec, slots.size
        gates = Gates(
            distances=self.rows("distance", shots),
            clock=per_shot(self.clock, shots),
            gravity=per_shot(passage.gravity, shots),
            half_height=spec.half_height,
        )
        jitter = sqrt((spec.edge_jitter**2 + spec.tick**2 / 12) / 2)
        # an array of noise, which the kernel replaces by the times
        times = draws.normal(f"{name}.sums", (2, len(spec.distances)), slots)
        for direction, start in enumerate((contact, leaving)):
            out = bool(direction)
            sum_up_gates(times, passage.trajectory_rows(out=out), start, out, gates, jitter)
        heights = np.full(times.shape, np.nan)
        for values in (times, heights):
            values.setflags(write=False)
        return PassageRecord(times=times, heights=heights)

    def _blank_missed(self, time: Array, height: Array) -> Array:
        return np.where(np.abs(height) < self.spec.half_height, time, np.nan)
