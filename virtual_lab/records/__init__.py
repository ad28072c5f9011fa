"""Raw records: what instruments and operators wrote down, and nothing they could not know.

A record is a set of arrays with named axes and one CSV form: a row for every index
combination, an index column for every axis, a value column with its unit for every field.
Another laboratory can write the same files by hand or from its own recorder; ``data/README.md``
documents every column.
"""

from virtual_lab.records.clip import ClipRecord, TrackRecord
from virtual_lab.records.kinds import (
    RECORD_TYPES,
    AimMarks,
    BoardRecord,
    EncoderRecord,
    GateRecord,
    LengthReadings,
    MassReadings,
    PassageRecord,
    PendulumRecord,
    RateRecord,
    ShotLog,
)
from virtual_lab.records.record import Record, RecordColumn, join

__all__ = [
    "RECORD_TYPES",
    "AimMarks",
    "BoardRecord",
    "ClipRecord",
    "EncoderRecord",
    "GateRecord",
    "LengthReadings",
    "MassReadings",
    "PassageRecord",
    "PendulumRecord",
    "RateRecord",
    "Record",
    "RecordColumn",
    "ShotLog",
    "TrackRecord",
    "join",
]
