"""Check for records that were stored for two shots."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Raised
from virtual_lab.records import (
    BoardRecord,
    EncoderRecord,
    GateRecord,
    PendulumRecord,
    Record,
    ShotLog,
)
from virtual_lab.units import Array, Mask


def records_repeated(evidence: Evidence) -> Iterator[Raised]:
    """Yield one flag for each instrument that has the same record for two shots.

    A record was stored twice if two shots have identical records of one instrument, but different
    records of another instrument. The flag is raised in all laboratories and rules out a verdict on
    the bat.

    Nothing is yielded if no record was stored twice. Nothing is yielded either if all releases of
    the pendulum have the same times to the last digit. Such records come from simulated instruments
    without noise, for which equal records are possible.
    """
    pendulum = evidence.block.records["bench"].get("pendulum")
    if isinstance(pendulum, PendulumRecord) and not np.ptp(pendulum.times, axis=0).any():
        return
    for stage in ("balls", "impact"):
        channels = evidence.block.records[stage]
        tables = ((name, _rows(record)) for name, record in channels.items())
        rows = {name: table for name, table in tables if table is not None}
        for channel, table in rows.items():
            whole, partial = _traces(channels[channel])
            others = [each for name, each in rows.items() if name != channel]
            twice = _repeated_records(table, partial, others)
            # A single partial trace may repeat by chance.
            if sum(2 if whole[shot] else 1 for _, shot in twice) > 1:
                yield _flag_repeat(evidence, f"{stage}/{channel}", *twice[0])


def _rows(record: Record) -> Array | None:
    """Return a record's values by shot, (shot, ...); None if they do not distinguish shots."""
    if isinstance(record, EncoderRecord):
        return record.counts
    if isinstance(record, GateRecord | BoardRecord):
        return record.times
    return record.ball if isinstance(record, ShotLog) else None


def _traces(record: Record) -> tuple[Mask, Mask]:
    """Return masks of the shots with a whole trace, and with at least half of one, (shot,).

    The constant trace of a bat that was not hit is excluded. A ball that does not come back leaves
    half a trace.
    """
    if isinstance(record, EncoderRecord):
        rotates = np.asarray(np.ptp(record.counts, axis=1) > 0)
        return rotates, rotates
    if isinstance(record, GateRecord | BoardRecord):
        shots, directions = record.times.shape[:2]
        detected = np.isfinite(record.times).reshape(*record.times.shape[:3], -1).any(axis=3)
        passed = np.asarray(detected.reshape(shots, directions, -1).all(axis=2))
        return np.asarray(passed.all(axis=1)), passed[:, 0]
    none = np.zeros(0, dtype=bool)
    return none, none


def _repeated_records(rows: Array, candidates: Mask, others: list[Array]) -> list[tuple[int, int]]:
    """Return pairs of a shot and an earlier shot with the same record."""
    first: dict[bytes, int] = {}
    repeats = []
    for shot in map(int, np.flatnonzero(candidates)):
        same = first.setdefault(rows[shot].tobytes(), shot)
        pairs = ((each[same], each[shot]) for each in others if same < shot)
        if not all(np.array_equal(*pair, equal_nan=True) for pair in pairs):
            repeats.append((same, shot))
    return repeats


def _flag_repeat(evidence: Evidence, record: str, first: int, second: int) -> Raised:
    return Raised(
        name="records-repeated",
        where=np.ones(evidence.laboratories, dtype=bool),  # full records come from one laboratory
        sentence=lambda _: (
            f"shots {first + 1} and {second + 1} have identical records in {record}, but different "
            "records of the other instruments"
        ),
        invalidates=True,
    )
