"""Raw records: readings that instruments and operators wrote down.

A record is a set of arrays with named axes and a CSV form: one row per index combination, one
index column per axis, one value column with its unit per field. Another laboratory can write the
same files by hand or from its recorder; ``docs/raw-records.md`` documents every column.
"""

from virtual_lab.records.clip import ClipRecord, TrackRecord
from virtual_lab.records.kinds import (
    RECORD_TYPES,
    REFERENCE_MASS,
    AimMarks,
    BallRecord,
    BoardRecord,
    ClimateReadings,
    EncoderRecord,
    GateRecord,
    LengthReadings,
    MassReadings,
    PassageRecord,
    PendulumRecord,
    RateRecord,
    ShotLog,
    record_name,
    record_type,
    record_types,
)
from virtual_lab.records.record import Record, RecordColumn, join

__all__ = [
    "RECORD_TYPES",
    "REFERENCE_MASS",
    "AimMarks",
    "BallRecord",
    "BoardRecord",
    "ClimateReadings",
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
    "record_name",
    "record_type",
    "record_types",
]
