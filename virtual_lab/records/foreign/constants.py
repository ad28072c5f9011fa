"""Calibration constants in the form of another laboratory: value, u and unit."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from virtual_lab.errors import InputError, nearest
from virtual_lab.records.constants import GREATEST, constant_of, require_plausible
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DIMENSIONS, to_si

KEYS = ("value", "unit", "u", "dof", "source")


def read_constants(entries: Mapping[str, Any], where: str) -> dict[str, Estimate]:
    """Return the calibration constants that another laboratory stated, keyed by name, in SI.

    `entries` are the constants in the form that the laboratory filled in. An entry must have the
    keys value, unit and u, and may have dof (by default inf) and source. `InputError` is raised for
    the first entry that cannot be used or is not plausible. It names the file `where` and the key.
    """
    constants = {key: _constant(key, entry, where) for key, entry in entries.items()}
    for key, constant in constants.items():
        require_plausible(key, constant, where)
    return constants


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
        raise InputError(where, at, None, f"lacks {', '.join(missing)}")
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
    """Return the allowed units of a constant, with their dimensions."""
    only = constant_of(key)
    return {
        unit: dimension
        for dimension, units in DIMENSIONS.items()
        for unit in units
        if (dimension == only.dimension if only else dimension != "temperature")
    }
