"""The instruments that time balls, by the kind of their record; others' from their packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.gates import GateReadings
from virtual_lab.records import BallRecord, Record, record_types
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.estimate import Estimate

Maker = Callable[[Any, Mapping[str, Estimate], str], FlightReadings]  # of record, constants, stage


@cache
def makers() -> Mapping[type[Record], Maker]:
    """Return what makes readings of the flights out of each kind of record.

    A package adds one by an entry point in the group ``virtual_lab.flights``, under the name its
    record has in the group ``virtual_lab.records``.
    """
    own = dict.fromkeys(("gates", "boards", "passages"), GateReadings.of)
    others = {point.name: point.load() for point in entry_points(group="virtual_lab.flights")}
    kinds = record_types()
    return {kinds[name]: maker for name, maker in (own | others).items()}


def flight_readings(block: SessionBlock, stage: str) -> FlightReadings:
    """Return the readings of a stage's balls, laboratory after laboratory or as fired, (shot,).

    Gates were surveyed to the same places in all laboratories of a block.

    Raises
    ------
    InputError
        The stage has no record of its balls, or two, or one that nothing here reduces.
    """
    found = {
        channel: record
        for channel, record in block.records.get(stage, {}).items()
        if isinstance(record, BallRecord)
    }
    if not found:
        raise InputError(f"{stage}/gates", "record", None, "this record is missing")
    if len(found) > 1:
        raise InputError(stage, "channels", ", ".join(found), "allowed: one that times the balls")
    ((channel, record),) = found.items()
    maker = makers().get(type(record))
    if maker is None:
        known = ", ".join(sorted(kind.__name__ for kind in makers()))
        raise InputError(f"{stage}/{channel}", "record", type(record).__name__, f"allowed: {known}")
    return maker(record, block.known_to(0), stage)
