"""Readings of the instruments that time balls, by type of record, including other packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.gates import GateReadings
from virtual_lab.records import (
    BallRecord,
    BoardRecord,
    GateRecord,
    PassageRecord,
    Record,
    record_types,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.estimate import Estimate

Maker = Callable[[Any, Mapping[str, Estimate], str], FlightReadings]  # (record, constants, stage)
OURS: Mapping[type[Record], Maker] = dict.fromkeys(
    (GateRecord, BoardRecord, PassageRecord), GateReadings.of
)


@cache
def makers() -> Mapping[type[Record], Maker]:
    """Return functions that make flight readings from a record, keyed by the type of the record.

    A function takes the record, the calibration constants keyed by name, and the stage of the test
    (``balls`` or ``impact``).

    Another package can add its own type of record. It needs two entry points with the same name:

    * one in the group ``virtual_lab.records`` for the type of record;
    * one in the group ``virtual_lab.flights`` for the function.

    `KeyError` is raised if an entry point in the second group has no counterpart in the first. The
    functions of this package cannot be replaced.
    """
    others = entry_points(group="virtual_lab.flights")
    return {**{record_types()[point.name]: point.load() for point in others}, **OURS}


def flight_readings(block: SessionBlock, stage: str) -> FlightReadings:
    """Return the flight readings of all balls in a stage, (shot,), in the order of its record.

    The stage is "balls" (at the wall) or "impact". The surveyed positions of the gates are read
    from the first laboratory, because they are the same in all laboratories of a block.

    Raises
    ------
    InputError
        The stage has no record of its balls, or two, or one of an unknown type.
    """
    channels = {
        channel: record
        for channel, record in block.records.get(stage, {}).items()
        if isinstance(record, BallRecord)
    }
    if not channels:
        raise InputError(f"{stage}/gates", "record", None, "this record is missing")
    if len(channels) > 1:
        allowed = "allowed: one record of the ball's flight"
        raise InputError(stage, "channels", ", ".join(channels), allowed)
    ((channel, record),) = channels.items()
    # other packages are loaded only for a record that is not ours
    maker = OURS.get(type(record)) or makers().get(type(record))
    if maker is None:
        names = ", ".join(sorted(kind.__name__ for kind in makers()))
        raise InputError(f"{stage}/{channel}", "record", type(record).__name__, f"allowed: {names}")
    return maker(record, block.constants_of(0), stage)
