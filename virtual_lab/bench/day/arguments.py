"""Arguments of an action: their description in the table of actions, and their conversion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Literal

from virtual_lab.bench.day.doubts import LONGEST_TEXT, fault_of_text
from virtual_lab.catalog.specs import Real, Spec, is_line
from virtual_lab.errors import InputError, nearest
from virtual_lab.units import DIMENSIONS, INCH, OUNCE

Value = str | float | int
LENGTHS = MappingProxyType({"mm": 1e-3, "cm": 1e-2, "in": INCH})
MASSES = MappingProxyType({"g": 1e-3, "oz": OUNCE})
# a number followed by a unit
TYPED = re.compile(r"([^a-zA-Z%]+?(?:[eE][+-]?\d+)?)\s*([a-zA-Z%/]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Argument(Spec):
    """One argument of an action."""

    name: str
    title: str
    kind: Literal["number", "whole", "choice", "text", "doubt"]
    unit: str = ""  # unit of a number
    default: Value | None = None  # None: required
    low: Real = -1e6
    high: Real = 1e6
    choices: tuple[str, ...] = ()

    def read(self, raw: object, action: str, length: str = "mm") -> Value:
        """Return the value of a typed or sent argument, in the unit of the argument.

        An empty string gives the default. A length without a unit is in the unit `length`, and a
        decimal comma is accepted. Raises `InputError` if the value is missing or not allowed.
        """
        if raw is None or (isinstance(raw, str) and not raw.strip()):
            if self.default is None:
                choices = f"; allowed: {', '.join(self.choices)}" if self.choices else ""
                raise InputError(action, self.name, None, f"is missing{choices}")
            return self.default
        if self.kind == "text":
            text = str(raw).strip()
            if not is_line(text, LONGEST_TEXT):
                allowed = f"allowed: a line of up to {LONGEST_TEXT} characters"
                raise InputError(action, self.name, text, allowed)
            return text
        if self.kind == "doubt":
            return fault_of_text(str(raw).strip(), action, self.name)
        if self.kind == "choice":
            if raw not in self.choices:
                allowed = f"{nearest(raw, self.choices)}allowed: {', '.join(self.choices)}"
                raise InputError(action, self.name, raw, allowed)
            return str(raw)
        return self._number(raw, action, length)

    def _number(self, raw: object, action: str, length: str) -> Value:
        text = str(raw).strip()
        factor = self._factor(length) if self.unit == "mm" else 1.0
        if (match := TYPED.fullmatch(text)) and self.unit:
            text, factor = match[1], self._factor(match[2])
        if re.fullmatch(r"[+-]?\d+,\d+", text):  # a decimal comma, unlike 1,200,000
            text = text.replace(",", ".")
        try:
            number = factor * float(text) if not isinstance(raw, bool) else float("nan")
        except ValueError:
            number = float("nan")
        whole = self.kind == "whole"
        fits = isfinite(number) and self.low <= number <= self.high
        if not fits or (whole and number != int(number)):
            kind = "whole numbers" if whole else "numbers"
            allowed = f"allowed: {kind} from {self.low:g} to {self.high:g} {self.unit}".rstrip()
            raise InputError(action, self.name, raw, allowed)
        return int(number) if whole else number

    def _factor(self, unit: str) -> float:
        """Return the factor from `unit` to the unit of the argument; NaN if they do not match."""
        for units in DIMENSIONS.values():
            if {unit, self.unit} <= units.keys():
                return units[unit] / units[self.unit]
        return float("nan")
