"""Name, symbol, unit and decimals of each metric in print."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from virtual_lab.units import MPH, Array

Value = TypeVar("Value", float, Array, float | None)


@dataclass(frozen=True, slots=True)
class MetricFormat:
    """Form of a metric in print. The printed number is its SI value divided by `unit_si`."""

    words: str
    symbol: str  # letter, with an index after an underscore
    unit: str
    unit_si: float
    si_unit: str
    places: int  # decimals of a printed limit

    def in_unit(self, value: Value) -> Value:
        """Return an SI value or an array of SI values in the printed unit; None stays None."""
        return value if value is None else value / self.unit_si

    def limit(self, value: float, more: int = 0) -> str:
        """Return a limit [SI] as printed, with its unit and `more` additional decimals."""
        return self.text(lambda size: f"{value / size:.{self.places + more}f}")

    def text(self, write: Callable[[float], str]) -> str:
        """Return a value with its printed unit and, of a speed, with the SI unit in parentheses.

        `write` returns the number as text in a unit, given the size of the unit [SI].
        """
        text = write(self.unit_si)
        return f"{text} {self.unit} ({write(1.0)} {self.si_unit})" if self.unit else text


METRICS = {
    "bat_performance_factor": MetricFormat("Bat performance factor", "BPF", "", 1.0, "", 3),
    "besr": MetricFormat("Ball exit speed ratio", "BESR", "", 1.0, "", 3),
    "restitution": MetricFormat("Restitution of ball and bat", "e", "", 1.0, "", 3),
    "batted_speed": MetricFormat("Batted-ball speed", "v_f", "mph", MPH, "m/s", 1),
}
# rebound speed of the ball from a bat at rest, which is not the metric of any procedure
REBOUND_SPEED = "rebound_speed"
QUANTITIES = METRICS | {
    REBOUND_SPEED: MetricFormat("Rebound speed", "rebound speed", "mph", MPH, "m/s", 1)
}
