"""Light-gate records: passages of the ball's centre and the time between gates.

A gate's two edges lie symmetrically about the passage of the centre, whatever part of the
beam trips it and however the ball passes it, so their mean is the passage.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import GateRecord

__all__ = ["inbound_duration", "inbound_passages", "outbound_duration"]

Array = NDArray[np.float64]


def inbound_passages(record: GateRecord) -> Array:
    """Return shown times of the centre's passages on the way in [s], shape (shot, gate)."""
    return np.asarray(record.times[:, 0].mean(axis=-1))


def inbound_duration(record: GateRecord) -> Array:
    """Return the shown time from the first gate to the last [s], (shot,), NaN: not seen."""
    passages = inbound_passages(record)
    return passages[:, -1] - passages[:, 0]


def outbound_duration(record: GateRecord) -> Array:
    """Return the same for the ball coming back: from the last gate to the first [s]."""
    passages = record.times[:, 1].mean(axis=-1)
    return np.asarray(passages[:, 0] - passages[:, -1])
