"""Conversion of the records of a day to JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.records import Record, record_name, record_types


def entry_of_record(record: Record) -> dict[str, Any]:
    """Return a record as a JSON object: its kind, and one list per column, with null for NaN."""
    arrays = {
        name: np.ma.masked_invalid(getattr(record, name)).tolist(None) for name in record.columns
    }
    return {"kind": record_name(record), **arrays}


def record_of(entry: Mapping[str, Any]) -> Record:
    """Return the record that `entry_of_record` wrote, with identical values; null becomes NaN.

    Raises `InputError` for an unknown kind of record, and for a column that is missing or wrong.
    """
    try:
        kind = record_types()[entry["kind"]]
        return kind(**{name: np.array(entry[name], dtype=np.float64) for name in kind.columns})
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError("", "records", None, f"cannot be used ({fault})") from fault
