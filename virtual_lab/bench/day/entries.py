"""Conversion of records, constants and the first session of a day to JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from virtual_lab.records import Record, record_name, record_types
from virtual_lab.records.origin import Simulated
from virtual_lab.records.session import Session, entry_of_constant
from virtual_lab.uncertainty.estimate import Estimate


def entry_of_record(record: Record) -> dict[str, Any]:
    """Return a record as a JSON object: its kind, and one list per column, with null for NaN."""
    arrays = {
        name: np.ma.masked_invalid(getattr(record, name)).tolist(None) for name in record.columns
    }
    return {"kind": record_name(record), **arrays}


def record_of(entry: Mapping[str, Any]) -> Record:
    """Return the record that `entry_of_record` wrote, with identical values; null becomes NaN.

    Raises `KeyError` for an unknown kind of record or a missing column.
    """
    kind = record_types()[entry["kind"]]
    return kind(**{name: np.array(entry[name], dtype=np.float64) for name in kind.columns})


def entry_of_session(session: Session) -> dict[str, Any]:
    """Return a simulated session as a JSON object.

    It holds bat, ball, rigs, rules and calibration constants, but no records.
    """
    return {
        "bat": session.bat,
        "ball": session.ball,
        "bat_sport": session.bat_sport,
        "ball_sport": session.ball_sport,
        "bat_construction": session.bat_construction,
        "date": session.date,
        "rigs": dict(session.rigs),
        "procedure_text": session.procedure_text,
        "simulation": cast("Simulated", session.origin).as_json(),
        "calibration": {
            name: entry_of_constant(estimate) for name, estimate in session.calibration.items()
        },
    }


def session_of_entry(entry: Mapping[str, Any]) -> Session:
    """Return the session that `entry_of_session` wrote, without records.

    Raises `KeyError` or `TypeError` for an object of another form.
    """
    calibration = {name: Estimate(**parts) for name, parts in entry["calibration"].items()}
    fields = {name: value for name, value in entry.items() if name != "simulation"}
    origin = {"origin": Simulated(**entry["simulation"]), "calibration": calibration}
    return Session(**{**fields, **origin, "records": {}})
