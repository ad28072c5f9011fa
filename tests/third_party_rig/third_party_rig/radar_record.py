"""The raw record of a radar gun: the values that its display shows for each ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from virtual_lab.records import BallRecord, RecordColumn
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarRecord(BallRecord):
    """Speeds of a ball at the gun's distance, and the time at which its echo turned, (shot,).

    NaN: the ball did not come back.
    """

    speed_in: Array
    speed_out: Array
    turned: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "speed_in": RecordColumn(
            "speed_in_m_per_s", ("shot",), "speed of the incoming ball shown by the gun"
        ),
        "speed_out": RecordColumn(
            "speed_out_m_per_s",
            ("shot",),
            "speed of the returning ball shown by the gun; empty: none",
            may_be_missing=True,
        ),
        "turned": RecordColumn("time_s", ("shot",), "time at which the echo turned"),
    }
