"""Calibration constants as another laboratory writes them: a value, its u, their unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple

from virtual_lab.errors import InputError, nearest
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DIMENSIONS, to_si

__all__ = ["Constant", "constant_of", "read_constants"]

GREATEST = 1e300  # a whole number in TOML may be beyond any float
KEYS = ("value", "unit", "u", "dof", "source")


class Constant(NamedTuple):
    """What a constant is."""

    dimension: str
    meaning: str


CONSTANTS = {  # by "instrument.constant"
    "scale.zero": Constant("mass", "what the scale shows of nothing"),
    "scale.span": Constant("number", "mass shown, less the zero, over true mass"),
    "scale.resolution": Constant("mass", "its smallest step"),
    "rule.offset": Constant("length", "length shown less true length"),
    "rule.resolution": Constant("length", "its smallest step"),
    "stand.offset": Constant("length", "balance point shown less true one"),
    "stand.resolution": Constant("length", "its smallest step"),
    "pendulum.clock": Constant("number", "time shown over true time"),
    "pendulum.amplitude_offset": Constant("angle", "amplitude shown less true one"),
    "pendulum.pivot_from_knob": Constant("length", "from the knob's end to the axis it swings on"),
    "pendulum.clamp_inertia": Constant("inertia", "of the clamp alone, about that axis"),
    "pendulum.clamp_moment": Constant("moment", "mass of the clamp times its lever below the axis"),
    "gates.distance": Constant("length", "from the ball's centre at contact; 0: farthest gate"),
    "gates.height": Constant("length", "of the gate above the line of fire, against its nominal"),
    "gates.lowest": Constant("length", "of the lowest beam above the line of fire"),
    "gates.pitch": Constant("length", "from beam to beam"),
    "gates.clock": Constant("number", "time shown over true time"),
    "hall.gravity": Constant("acceleration", "in the hall"),
    "air.density": Constant("density", "of the air in the hall"),
    "air.drag_coefficient": Constant("number", "of the ball"),
    "pivot.from_knob": Constant("length", "from the knob's end to the axis the bat turns on"),
    "pivot.height": Constant("length", "of the bat's axis above the line of fire"),
    "cannon.along": Constant("length", "where balls strike less where they were set to"),
    "encoder.scale": Constant("number", "angle shown over true angle"),
    "encoder.counts_per_turn": Constant("number", "of the encoder"),
    "swing.scale": Constant("number", "angle shown over true angle"),
    "swing.counts_per_turn": Constant("number", "of the encoder"),
    "control.restitution_ratio": Constant(
        "number", "e of the control bat with this lot, over its own"
    ),
    "ball.radius": Constant("length", "of the ball"),
    "ball.restitution_slope": Constant("slope of speed", "of the ball's e0 over its speed"),
}


def constant_of(key: str) -> Constant | None:
    """Return what a constant ``stage.instrument.constant`` is, None where it is not ours.

    A number at the end tells apart constants of a kind: ``distance_0``, ``distance_1``.
    """
    return CONSTANTS.get(re.sub(r"_\d+$", "", ".".join(key.split(".")[-2:])))


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
        allowed = f"{nearest(unknown[0], KEYS)}allowed: {', '.join(KEYS)}{hint}"
        raise InputError(where, at, unknown[0], allowed)
    if missing := [name for name in KEYS[:3] if name not in entry]:
        raise InputError(where, at, None, f"misses {', '.join(missing)}")
    units = _units(key)
    unit = str(entry["unit"])
    if unit not in units:
        raise InputError(
            where, f"{at}.unit", unit, f"{nearest(unit, units)}allowed: {', '.join(units)}"
        )
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
    only = constant_of(key)
    return {
        unit: dimension
        for dimension, units in DIMENSIONS.items()
        for unit in units
        if only is None or only.dimension == dimension
    }
