"""The dictionary of columns: meaning and unit of every column in a result folder.

A column's name ends in its unit; units are written as UCUM codes.
"""

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
    "K": ColumnUnit("K"),
    "Pa": ColumnUnit("Pa"),
    "px": ColumnUnit("{pixel}"),
    "us": ColumnUnit("us", 1e-6),
    "s": ColumnUnit("s"),
    "m": ColumnUnit("m"),
}
PURE = ColumnUnit("1")
MEANINGS = {  # meaning of each column of a record
    "item": "number of the piece on the scale or rule",
    "repeat": "number of the reading",
    "release": "number of the release of the pendulum",
    "passage": "number of the passage, in one direction",
    "shot": "number of the shot",
    "ball": "number of the ball",
    "way": "0 inbound, 1 back",
    "gate": "number of the gate, from the cannon",
    "board": "number of the board, from the cannon",
    "beam": "number of the beam, from below",
    "edge": "0 beam broken, 1 beam cleared",
    "sample": "number of the reading",
    "reading": "0 at the start of the test, the last at its end",
    "frame": "number of the frame",
    "mark": "number of the mark on the aim paper",
    "mass_kg": "mass shown",
    "length_m": "length shown",
    "time_s": "time shown by the recorder, uncorrected; empty: not seen",
    "first_amplitude_rad": "amplitude at the first passage",
    "last_amplitude_rad": "amplitude at the last passage",
    "temperature_K": "temperature shown in the hall",
    "humidity": "relative humidity shown, 0 to 1",
    "pressure_Pa": "pressure of the air shown",
    "nominal_speed_m_per_s": "speed asked for",
    "place_m": "place set with the rule, from the barrel tip",
    "counts": "count shown by the encoder",
    "height_m": "height of the ball's centre above the zero of the gates",
    "counts_per_s": "rate at contact",
    "u_counts_per_s": "its standard uncertainty by the fit",
    "counts_per_s_before": "rate before contact",
    "counts_at_contact": "count at contact",
    "speed_in_m_per_s": "speed shown of the ball coming in",
    "speed_out_m_per_s": "speed shown of the ball coming back",
    "along_m": "mark from the aim, along the bat",
    "across_m": "mark from the aim, across the bat",
    "left_px": "first column of the window",
    "top_px": "first row of the window",
    "x_px": "column of the ball's centre",
    "y_px": "row of the ball's centre",
    "u_px": "standard uncertainty of the ball's centre",
}


def unit_of(name: str) -> ColumnUnit:
    """Return the unit at the end of a column's name; without one, that of pure numbers."""
    parts = name.split("_")
    endings = ("_".join(parts[at:]) for at in range(len(parts)))
    return next((UNITS[ending] for ending in endings if ending in UNITS), PURE)
