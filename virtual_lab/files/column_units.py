"""Units of columns: a column's name ends in its unit.

Descriptors of files write a unit as its UCUM code, tables in memory as it is printed.
"""

from __future__ import annotations

from typing import NamedTuple

from virtual_lab.units import DEGREE, INCH, MPH, OUNCE


class ColumnUnit(NamedTuple):
    """A unit at the end of a column's name: its UCUM code, its size in SI, and its printed form."""

    ucum: str
    si: float = 1.0
    printed: str = ""  # "": as the code

    @property
    def text(self) -> str:
        """The unit as printed, such as ``mph``; "1" for pure numbers."""
        return self.printed or self.ucum


UNITS = {
    "u_counts_per_s": ColumnUnit("{count}/s", printed="counts/s"),
    "counts_per_s": ColumnUnit("{count}/s", printed="counts/s"),
    "rad_per_s": ColumnUnit("rad/s"),
    "m_per_s2": ColumnUnit("m/s2", printed="m/s²"),
    "m_per_s": ColumnUnit("m/s"),
    "counts_per_s_before": ColumnUnit("{count}/s", printed="counts/s"),
    "counts_at_contact": ColumnUnit("{count}", printed="counts"),
    "counts": ColumnUnit("{count}", printed="counts"),
    "mph": ColumnUnit("[mi_i]/h", MPH, "mph"),
    "deg": ColumnUnit("deg", DEGREE),
    "rad": ColumnUnit("rad"),
    "in": ColumnUnit("[in_i]", INCH, "in"),
    "oz": ColumnUnit("[oz_av]", OUNCE, "oz"),
    "kg": ColumnUnit("kg"),
    "kg_m2": ColumnUnit("kg.m2", printed="kg m²"),
    "kg_per_m3": ColumnUnit("kg/m3", printed="kg/m³"),
    "K": ColumnUnit("K"),
    "Pa": ColumnUnit("Pa"),
    "px": ColumnUnit("{pixel}", printed="px"),
    "us": ColumnUnit("us", 1e-6),
    "ms": ColumnUnit("ms", 1e-3),
    "s": ColumnUnit("s"),
    "per_s": ColumnUnit("/s", printed="1/s"),
    "hz": ColumnUnit("Hz"),
    "m": ColumnUnit("m"),
    "percent": ColumnUnit("%", 1e-2),
}
PURE = ColumnUnit("1")


def unit_of(name: str) -> ColumnUnit:
    """Return the unit at the end of a column name, such as mph for ``speed_mph``.

    The whole name can be a unit, such as ``counts``. If the name does not end in a unit, the column
    holds pure numbers and the unit is "1".
    """
    parts = name.split("_")
    endings = ("_".join(parts[at:]) for at in range(len(parts)))
    return next((UNITS[ending] for ending in endings if ending in UNITS), PURE)


def name_of_u(name: str) -> str:
    """Return the column name of the standard uncertainty of a column.

    For ``speed_mph`` it is ``speed_u_mph``. Without a unit, ``_u`` is added at the end.
    """
    parts = name.split("_")
    ends = (at for at in range(1, len(parts)) if "_".join(parts[at:]) in UNITS)
    at = next(ends, len(parts))
    return "_".join([*parts[:at], "u", *parts[at:]])
