"""A study of another package and its command, which need only an entry point."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi

from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column
from virtual_lab.parameters import Numbers, values_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Relative error of a radar gun at an angle to the flight."""

    angle_deg: float = column("angle", "deg")
    error_percent: float = column("error", "%")


def cosine(angles: Numbers = (0, 5, 10, 20)) -> Rows[Reading]:
    """Show how much too low a radar gun reads at an angle to the flight.

    Parameters
    ----------
    angles
        Angles between the axis of the gun and the flight [deg].
    """
    rows = [
        Reading(angle_deg=angle, error_percent=100 * (cos(angle * pi / 180) - 1))
        for angle in values_of(angles)
    ]
    return Rows(name="cosine", title="error of a radar gun by its angle", rows=rows)
