"""Records and constants as the entries of a log hold them: lists and numbers of JSON."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from virtual_lab.records import RECORD_TYPES, Record
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["constant_of_entry", "entry_of_constant", "entry_of_record", "record_of"]

KINDS = {kind: name for name, kind in RECORD_TYPES.items()}


def entry_of_record(record: Record) -> dict[str, Any]:
    """Return a record as arrays in lists; what was not seen is null."""
    arrays = {
        name: np.ma.masked_invalid(getattr(record, name)).tolist(None) for name in record.columns
    }
    return {"kind": KINDS[type(record)], **arrays}


def record_of(entry: Mapping[str, Any]) -> Record:
    """Return the record of an entry, to the bit."""
    kind = RECORD_TYPES[entry["kind"]]
    return kind(**{name: np.array(entry[name], dtype=np.float64) for name in kind.columns})


def entry_of_constant(known: Estimate) -> dict[str, Any]:
    """Return a constant of the laboratory as a table."""
    dof = {} if known.dof == inf else {"dof": known.dof}
    return {"value": known.value, "u": known.u, "source": known.source, **dof}


def constant_of_entry(entry: Mapping[str, Any]) -> Estimate:
    """Return the constant of an entry."""
    return Estimate(**entry)
