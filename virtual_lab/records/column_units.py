"""Units of columns: a column's name ends in its unit. Units are written as UCUM codes."""

from __future__ import annotations

from typing import NamedTuple

from virtual_lab.units import DEGREE, INCH, MPH, OUNCE


class ColumnUnit(NamedTuple):
    """A unit at the end of a column's name: its UCUM code, and its size in SI."""

    ucum: str
    si: float = 1.0


UNITS = {
    "u_counts_per_s": ColumnUnit("{count}/s"),
    "counts_per_s": ColumnUnit("{count}/s"),
    "rad_per_s": ColumnUnit("rad/s"),
    "m_per_s": ColumnUnit("m/s"),
    "counts_per_s_before": ColumnUnit("{count}/s"),
    "counts_at_contact": ColumnUnit("{count}"),
    "counts": ColumnUnit("{count}"),
    "mph": ColumnUnit("[mi_i]/h", MPH),
    "deg": ColumnUnit("deg", DEGREE),
    "rad": ColumnUnit("rad"),
    "in": ColumnUnit("[in_i]", INCH),
    "oz": ColumnUnit("[oz_av]", OUNCE),
    "kg": ColumnUnit("kg"),
    "kg_m2": ColumnUnit("kg.m2"),
    "kg_per_m3": ColumnUnit("kg/m3"),
    "K": ColumnUnit("K"),
    "Pa": ColumnUnit("Pa"),
    "px": ColumnUnit("{pixel}"),
    "us": ColumnUnit("us", 1e-6),
    "ms": ColumnUnit("ms", 1e-3),
    "s": ColumnUnit("s"),
    "per_s": ColumnUnit("/s"),
    "hz": ColumnUnit("Hz"),
    "m": ColumnUnit("m"),
    "percent": ColumnUnit("%", 1e-2),
}
PURE = ColumnUnit("1")


def unit_of(name: str) -> ColumnUnit:
    """Return the unit in which a column's name ends, as UCUM code and size in SI.

    For example, ``speed_mph`` is in mph. A name can also be just a unit, such as ``counts``. If a
    name does not end in a unit, the column holds pure numbers with the unit "1".
    """
    parts = name.split("_")
    endings = ("_".join(parts[at:]) for at in range(len(parts)))
    return next((UNITS[ending] for ending in endings if ending in UNITS), PURE)
