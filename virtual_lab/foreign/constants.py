"""Calibration constants as another laboratory writes them: a value, its u, their unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate
from virtual_lab.units import DIMENSIONS, to_si

__all__ = ["UNIT_OF", "dimension_of", "read_constants"]

GREATEST = 1e300  # a whole number in TOML may be beyond any float
KEYS = ("value", "unit", "u", "dof", "source")
UNIT_OF = {  # "instrument.constant": its dimension
    "scale.zero": "mass",
    "scale.span": "number",
    "scale.resolution": "mass",
    "rule.offset": "length",
    "rule.resolution": "length",
    "stand.offset": "length",
    "stand.resolution": "length",
    "pendulum.clock": "number",
    "pendulum.amplitude_offset": "angle",
    "pendulum.pivot_from_knob": "length",
    "pendulum.clamp_inertia": "inertia",
    "pendulum.clamp_moment": "moment",
    "pendulum.gravity": "acceleration",
    "gates.distance": "length",
    "gates.height": "length",
    "gates.lowest": "length",
    "gates.pitch": "length",
    "gates.clock": "number",
    "air.density": "density",
    "air.drag_coefficient": "number",
    "pivot.from_knob": "length",
    "pivot.height": "length",
    "cannon.along": "length",
    "encoder.scale": "number",
    "encoder.counts_per_turn": "number",
    "swing.scale": "number",
    "swing.counts_per_turn": "number",
    "ball.radius": "length",
    "ball.restitution_slope": "slope of speed",
}


def dimension_of(key: str) -> str | None:
    """Return the dimension of a constant ``stage.instrument.constant``, None where unknown.

    A number at the end tells apart constants of a kind: ``distance_0``, ``distance_1``.
    """
    return UNIT_OF.get(re.sub(r"_\d+$", "", ".".join(key.split(".")[-2:])))


def read_constants(entries: Mapping[str, Any], where: str) -> dict[str, Estimate]:
    """Return the constants of a form in SI; `InputError` names the first that cannot be used."""
    return {key: _constant(key, entry, where) for key, entry in entries.items()}


def _constant(key: str, entry: Any, where: str) -> Estimate:
    at = f"calibration.{key}"
    if not isinstance(entry, Mapping):
        # a key written without quotes is a table of tables in TOML
        raise InputError(where, at, str(entry), f"expected a table {{ {', '.join(KEYS)} }}")
    if unknown := [name for name in entry if name not in KEYS]:
        hint = " (quotes around the whole key?)" if isinstance(entry[unknown[0]], Mapping) else ""
        raise InputError(where, at, unknown[0], f"allowed: {', '.join(KEYS)}{hint}")
    if missing := [name for name in KEYS[:3] if name not in entry]:
        raise InputError(where, at, None, f"misses {', '.join(missing)}")
    units = _units(key)
    unit = str(entry["unit"])
    if unit not in units:
        raise InputError(where, f"{at}.unit", unit, f"allowed: {', '.join(units)}")
    value, u, dof = (_number(entry, name, at, where) for name in ("value", "u", "dof"))
    try:
        return Estimate(
            value=to_si(value, unit, units[unit]),
            u=to_si(u, unit, units[unit]),
            dof=dof,
            source=str(entry.get("source", "")),
        )
    except ValueError as fault:
        raise InputError(where, at, None, str(fault)) from fault


def _number(entry: Mapping[str, Any], name: str, at: str, where: str) -> float:
    number = entry.get(name, inf)
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise InputError(where, f"{at}.{name}", str(number), "must be a number")
    if name in entry and not abs(number) < GREATEST:
        raise InputError(where, f"{at}.{name}", number, "must be a finite number")
    return float(number)


def _units(key: str) -> dict[str, str]:
    """Return the units a constant may be in, and the dimension each is of."""
    only = dimension_of(key)
    return {
        unit: dimension
        for dimension, units in DIMENSIONS.items()
        for unit in units
        if only in (None, dimension)
    }
