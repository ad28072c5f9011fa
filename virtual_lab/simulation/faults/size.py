"""Faults of another size: their changes of numbers multiplied by a factor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from virtual_lab.simulation.faults.fault import Fault

NO_SIZE = {"records-swapped"}  # faults that are there or not


def resize(fault: Fault, size: float) -> Fault:
    """Return a copy of a fault with its effect multiplied by `size`; a size of 1 changes nothing.

    Only changes of floats are multiplied. Changes of integers, strings and tuples of objects keep
    their full size. Readings that the fault adds or removes also keep it. A fault in `NO_SIZE` is
    returned unchanged.
    """
    if fault.name in NO_SIZE:
        return fault

    def scale_hook(hook: Callable[[Any], Any] | None) -> Any:
        return hook and (lambda before: _scale_change(before, hook(before), size))

    def record(before: Any, context: Any) -> Mapping[str, Any]:
        assert fault.record is not None
        changed = fault.record(before, context)
        return {name: blend(getattr(before, name), after, size) for name, after in changed.items()}

    return replace(
        fault,
        station=scale_hook(fault.station),
        specimen=scale_hook(fault.specimen),
        plan=scale_hook(fault.plan),
        calibration=scale_hook(fault.calibration),
        record=record if fault.record else None,
    )


def _scale_change(before: Any, after: Any, size: float) -> Any:
    return None if after is None else blend(before, after, size)


def blend(before: Any, after: Any, size: float) -> Any:
    """Return `before` + `size` · (`after` - `before`), number by number.

    Mappings, dataclasses, and tuples, lists and arrays of floats are changed entry by entry. If a
    number is not finite in `before` or in `after`, the number of `after` is returned. Integers,
    strings, tuples of objects and the keys of a mapping are those of `after`.
    """
    if before is after:
        return before
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        return {key: blend(before.get(key, each), each, size) for key, each in after.items()}
    if is_dataclass(before) and type(before) is type(after):
        whole: Any = after
        names = [part.name for part in fields(before)]
        parts = {key: blend(getattr(before, key), getattr(after, key), size) for key in names}
        return replace(whole, **parts)
    if np.asarray(before).dtype.kind != "f" or np.asarray(after).dtype.kind != "f":
        return after
    both = np.isfinite(before) & np.isfinite(after)
    with np.errstate(invalid="ignore"):
        blended = np.where(both, before + size * (np.asarray(after) - before), after)
    return blended if isinstance(after, np.ndarray) else type(after)(blended.tolist())
