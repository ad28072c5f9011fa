"""Calibration constants as another laboratory writes them: a value, its u, their unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple

from virtual_lab.errors import InputError, nearest
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DIMENSIONS, to_si

__all__ = ["Constant", "constant_of", "read_constants", "require_plausible"]

GREATEST = 1e18  # of any constant, SI: products of such numbers stay finite
KEYS = ("value", "unit", "u", "dof", "source")


class Constant(NamedTuple):
    """What a constant is."""

    dimension: str
    meaning: str
    low: float = 0.0  # SI; beyond this range no such thing is made, nor known as badly
    high: float = GREATEST


CONSTANTS = {  # by "instrument.constant"
    "scale.zero": Constant("mass", "what the scale shows of nothing", -1, 1),
    "scale.span": Constant("number", "mass shown, less the zero, over true mass", 0.5, 2),
    "scale.resolution": Constant("mass", "its smallest step"),
    "rule.offset": Constant("length", "length shown less true length", -1, 1),
    "rule.resolution": Constant("length", "its smallest step"),
    "stand.offset": Constant("length", "balance point shown less true one", -1, 1),
    "stand.resolution": Constant("length", "its smallest step"),
    "pendulum.clock": Constant("number", "time shown over true time", 0.5, 2),
    "pendulum.amplitude_offset": Constant("angle", "amplitude shown less true one", -1, 1),
    "pendulum.pivot_from_knob": Constant(
        "length", "from the knob's end to the axis it swings on", -1, 2
    ),
    "pendulum.clamp_inertia": Constant("inertia", "of the clamp alone, about that axis", 0, 10),
    "pendulum.clamp_moment": Constant(
        "moment", "mass of the clamp times its lever below the axis", -10, 10
    ),
    "gates.distance": Constant(
        "length", "from the ball's centre at contact; 0: farthest gate", 0, 100
    ),
    "gates.height": Constant(
        "length", "of the gate above the line of fire, against its nominal", -10, 10
    ),
    "gates.lowest": Constant("length", "of the lowest beam above the line of fire", -10, 10),
    "gates.pitch": Constant("length", "from beam to beam", 1e-4, 1),
    "gates.clock": Constant("number", "time shown over true time", 0.5, 2),
    "hall.gravity": Constant("acceleration", "in the hall", 9, 11),
    "air.density": Constant("density", "of the air in the hall", 0, 10),
    "air.drag_coefficient": Constant("number", "of the ball", 0, 5),
    "pivot.from_knob": Constant(
        "length", "from the knob's end to the axis the bat turns on", -1, 2
    ),
    "pivot.height": Constant("length", "of the bat's axis above the line of fire", -10, 10),
    "cannon.along": Constant("length", "where balls strike less where they were set to", -1, 1),
    "encoder.scale": Constant("number", "angle shown over true angle", 0.5, 2),
    "encoder.counts_per_turn": Constant("number", "of the encoder", 1, 1e9),
    "swing.scale": Constant("number", "angle shown over true angle", 0.5, 2),
    "swing.counts_per_turn": Constant("number", "of the encoder", 1, 1e9),
    "control.restitution_ratio": Constant(
        "number", "e of the control bat with this lot, over its own", 0.1, 10
    ),
    "ball.radius": Constant("length", "of the ball", 5e-3, 0.2),
    "ball.restitution_slope": Constant("slope of speed", "of the ball's e0 over its speed", -1, 1),
}


def constant_of(key: str) -> Constant | None:
    """Return what a constant ``stage.instrument.constant`` is, None where it is not ours.

    A number at the end tells apart constants of a kind: ``distance_0``, ``distance_1``.
    """
    return CONSTANTS.get(re.sub(r"_\d+$", "", ".".join(key.split(".")[-2:])))


def require_plausible(key: str, known: Estimate, where: str) -> None:
    """Refuse a constant beyond the range of its kind, or whose u is wider than that.

    A budget takes the constant one u up and down, where a model far off says nothing.
    """
    of = constant_of(key)
    low, high = (of.low, of.high) if of else (-GREATEST, GREATEST)
    for name, value, least, most in (
        ("value", known.value, low, high),
        ("u", known.u, 0.0, high - low),
    ):
        if not least <= value <= most:
            unit = next(iter(DIMENSIONS[of.dimension])) if of else ""
            allowed = f"allowed: {least:g} to {most:g} {unit}".removesuffix(" 1").strip()
            raise InputError(where, f"calibration.{key}.{name}", f"{value:g}", allowed)


def read_constants(entries: Mapping[str, Any], where: str) -> dict[str, Estimate]:
    """Return the constants of a form in SI; `InputError` names the first that cannot be used."""
    found = {key: _constant(key, entry, where) for key, entry in entries.items()}
    for key, known in found.items():
        require_plausible(key, known, where)
    return found


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
