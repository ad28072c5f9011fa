"""The kinds of record: one class per kind, with fields, axes and columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import ClassVar

import numpy as np

from virtual_lab.records.clip import ClipRecord, TrackRecord
from virtual_lab.records.record import Order, Record, RecordColumn, rising
from virtual_lab.units import Array

# channel of the bench: the reference mass, weighed before and after all other items
REFERENCE_MASS = "reference-mass"


@dataclass(frozen=True, slots=True, kw_only=True)
class MassReadings(Record):
    """Repeated readings of a scale, shape (item, repeat)."""

    readings: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "readings": RecordColumn("mass_kg", ("item", "repeat"), "mass shown by the scale")
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthReadings(Record):
    """Repeated readings of a rule or a balance stand, shape (item, repeat)."""

    readings: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "readings": RecordColumn(
            "length_m", ("item", "repeat"), "length shown by the rule or the balance stand"
        )
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumRecord(Record):
    """Times of passages in one direction, shape (release, passage); amplitudes (release, end).

    The amplitude at `end` 0 is read at the first passage, the amplitude at `end` 1 at the last.
    """

    times: Array
    first_amplitude: Array
    last_amplitude: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s", ("release", "passage"), "time of the passage shown by the timer, uncorrected"
        ),
        "first_amplitude": RecordColumn(
            "first_amplitude_rad", ("release",), "amplitude read at the first passage"
        ),
        "last_amplitude": RecordColumn(
            "last_amplitude_rad", ("release",), "amplitude read at the last passage"
        ),
    }

    def orders(self) -> tuple[Order, ...]:
        return (rising(self.times, ("release", "passage")),)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClimateReadings(Record):
    """Readings of a thermometer, a hygrometer and a barometer, shape (reading,).

    They were taken in the hall, or in the store in which the balls are conditioned. Reading 0 was
    taken at the start of the test, the last one at its end. The relative humidity is a number from
    0 to 1. The density of the air is computed from the readings of the hall; without them the
    density in the calibration is used.
    """

    temperature: Array
    humidity: Array
    pressure: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "temperature": RecordColumn(
            "temperature_K", ("reading",), "air temperature shown by the thermometer"
        ),
        "humidity": RecordColumn(
            "humidity",
            ("reading",),
            "relative humidity shown by the hygrometer, 0 to 1",
            is_share=True,
        ),
        "pressure": RecordColumn(
            "pressure_Pa", ("reading",), "air pressure shown by the barometer"
        ),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class BallRecord(Record):
    """Base of the records of ball flights. A stage that fires balls has one such channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRecord(BallRecord):
    """Times at which beams were broken and cleared, (shot, way, gate, edge); NaN: not detected.

    `way` 0 is the incoming ball and 1 the returning ball; `edge` 0 is the break and 1 the clearing.
    Gates are numbered from the cannon to the target.
    """

    times: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s",
            ("shot", "way", "gate", "edge"),
            "time shown by the recorder, uncorrected; empty: no edge was recorded",
            may_be_missing=True,
        )
    }

    def orders(self) -> tuple[Order, ...]:
        return _flight_orders(self.times, ("shot", "way", "gate", "edge"))


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardRecord(BallRecord):
    """Times at which each beam of a light board was broken and cleared; NaN: the ball missed it.

    The shape is (shot, way, board, beam, edge). Ways and edges are numbered as in `GateRecord`,
    boards from the cannon to the target, and beams from the lowest to the highest.
    """

    times: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s",
            ("shot", "way", "board", "beam", "edge"),
            "time shown by the recorder, uncorrected; empty: the ball missed the beam",
            may_be_missing=True,
        )
    }

    def orders(self) -> tuple[Order, ...]:
        return _flight_orders(self.times, ("shot", "way", "board", "beam", "edge"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PassageRecord(BallRecord):
    """Record of gates that store passages instead of edges, (shot, way, gate).

    For each passage of the ball's center it holds the time [s], and the height above the zero of
    the gates [m]. A value is NaN if it was not detected or not measured.
    """

    times: Array
    heights: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s",
            ("shot", "way", "gate"),
            "time at which the ball's center passes the gate; empty: no passage was recorded",
            may_be_missing=True,
        ),
        "heights": RecordColumn(
            "height_m",
            ("shot", "way", "gate"),
            "height of the ball's center above the zero of the gates; empty: not measured",
            may_be_missing=True,
        ),
    }

    def orders(self) -> tuple[Order, ...]:
        return _flight_orders(self.times, ("shot", "way", "gate"))


@dataclass(frozen=True, slots=True, kw_only=True)
class RateRecord(Record):
    """Record of an encoder that stores rates instead of counts: rate at contact and its u, (shot,).

    `before` is the rate before contact, for a bat that is not swung. `angle` is the angle at
    contact, for a swung bat; it is 0 if the bat is square to the ball. A value that does not apply
    is NaN.
    """

    rate: Array
    rate_u: Array
    before: Array
    angle: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "rate": RecordColumn("counts_per_s", ("shot",), "rate of the encoder just after contact"),
        "rate_u": RecordColumn(
            "u_counts_per_s", ("shot",), "standard uncertainty of this rate by the fit"
        ),
        "before": RecordColumn(
            "counts_per_s_before",
            ("shot",),
            "rate of a bat at rest before contact; empty: not applicable",
            may_be_missing=True,
        ),
        "angle": RecordColumn(
            "counts_at_contact",
            ("shot",),
            "angle of a swung bat at contact, 0 if square to the ball; empty: not applicable",
            may_be_missing=True,
        ),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderRecord(Record):
    """Counts at the ticks of the recorder's clock: counts (shot, sample), times (sample,)."""

    counts: Array
    times: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "counts": RecordColumn("counts", ("shot", "sample"), "count shown by the encoder"),
        "times": RecordColumn(
            "time_s", ("sample",), "time of the sample by the recorder's clock, uncorrected"
        ),
    }

    def orders(self) -> tuple[Order, ...]:
        return (rising(self.times, ("sample",)),)


@dataclass(frozen=True, slots=True, kw_only=True)
class AimMarks(Record):
    """Marks of test shots on an aim paper, as distances from the aimed point, shape (mark,).

    `along` is positive toward the knob, `across` is positive upward.
    """

    along: Array
    across: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "along": RecordColumn(
            "along_m", ("mark",), "distance of the mark from the aim, along the bat"
        ),
        "across": RecordColumn(
            "across_m", ("mark",), "distance of the mark from the aim, across the bat"
        ),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotLog(Record):
    """The operator's log: ball, nominal speed, impact position set with the rule, shape (shot,)."""

    ball: Array
    nominal_speed: Array
    place: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "ball": RecordColumn("ball", ("shot",), "number of the ball", is_index=True),
        "nominal_speed": RecordColumn(
            "nominal_speed_m_per_s", ("shot",), "speed set at the cannon"
        ),
        "place": RecordColumn(
            "place_m", ("shot",), "impact position set with the rule, from the barrel tip"
        ),
    }


def _flight_orders(times: Array, axes: tuple[str, ...]) -> tuple[Order, ...]:
    """Return the required order of times: in from first to last gate, then back in reverse."""
    gate = axes[2]
    back = np.reshape([1.0, -1.0], (2, *[1] * (times.ndim - 2)))
    faults = {
        "edge": "the beam clears before it breaks",
        gate: f"the ball passes this {gate} out of order",
        "way": "the ball returns before it arrives",
    }
    return tuple(
        Order(
            column="time_s",
            values=times,
            axes=axes,
            along=axis,
            sign=back if axis == gate else 1.0,
            fault=fault,
        )
        for axis, fault in faults.items()
        if axis in axes
    )


RECORD_TYPES: Mapping[str, type[Record]] = {
    "mass-readings": MassReadings,
    "length-readings": LengthReadings,
    "pendulum": PendulumRecord,
    "climate": ClimateReadings,
    "gates": GateRecord,
    "boards": BoardRecord,
    "passages": PassageRecord,
    "rates": RateRecord,
    "encoder": EncoderRecord,
    "clip": ClipRecord,
    "track": TrackRecord,
    "aim-marks": AimMarks,
    "shot-log": ShotLog,
}


@cache
def record_types() -> Mapping[str, type[Record]]:
    """Return the classes of all kinds of record, keyed by name, also of other packages.

    A package adds a kind by an entry point in the group ``virtual_lab.records``. It cannot replace
    a kind of this package. If a package cannot be loaded, its error is raised.
    """
    others = {point.name: point.load() for point in entry_points(group="virtual_lab.records")}
    # our kinds come first, and a package cannot replace them
    return {**RECORD_TYPES, **others, **RECORD_TYPES}


def record_type(name: str) -> type[Record] | None:
    """Return the class of a kind of record, such as "gates", or None if the name is unknown.

    Other packages are loaded only if this package has no such kind. Raises the errors of
    `record_types`.
    """
    return RECORD_TYPES.get(name) or record_types().get(name)


def record_name(record: Record) -> str:
    """Return the name of a record's kind, such as "gates".

    Raises `StopIteration` if the kind is not in `record_types`.
    """
    kinds = RECORD_TYPES if type(record) in RECORD_TYPES.values() else record_types()
    return next(name for name, kind in kinds.items() if kind is type(record))
