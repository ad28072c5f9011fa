"""Base of the classes of arrays that share their first axis: laboratories, shots or hits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

EVERY_FIELD: tuple[str, ...] = ("*",)  # value of `aligned` if all fields are aligned


class AlignedArrays:
    """A dataclass whose fields named in `aligned` have one row per laboratory, shot or hit.

    Such a field is an array, another instance of this class, a mapping of these, or flight readings
    of another package (which have a method `part`). A number or None applies to all rows. The other
    fields belong to all rows together.
    """

    __slots__ = ()
    aligned: ClassVar[tuple[str, ...]] = ()

    def select(self, rows: Any) -> Self:
        """Return an instance of the same class with the chosen rows; other fields are unchanged.

        `rows` is an index of the first axis: a slice, a mask, or numbers of any shape. A negative
        number in an array stands for a missing row, which is filled with NaN, False or 0.
        """
        numbers = isinstance(rows, np.ndarray) and rows.dtype != bool
        missing = rows < 0 if numbers and rows.min(initial=0) < 0 else None
        kind: Any = type(self)
        names, shared = _names(kind)
        aligned_rows = {name: _select(getattr(self, name), rows, missing) for name in names}
        selection: Self = kind(**aligned_rows, **{name: getattr(self, name) for name in shared})
        return selection

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return one instance with the rows of all parts in order.

        Fields that are not aligned, and aligned fields that are a number or None, are those of the
        first part.
        """
        kind: Any = cls
        names, shared = _names(kind)
        rows = {name: _concatenate([getattr(each, name) for each in parts]) for name in names}
        return cls(**rows, **{name: getattr(parts[0], name) for name in shared})


@cache
def _names(kind: type[Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the aligned fields, and of those that belong to all rows together."""
    every = tuple(each.name for each in fields(kind))
    aligned = every if kind.aligned == EVERY_FIELD else kind.aligned
    return aligned, tuple(name for name in every if name not in aligned)


def _select(values: Any, rows: Any, missing: NDArray[np.bool_] | None) -> Any:
    if isinstance(values, np.ndarray):
        selection = values[rows]
        if missing is not None:
            selection[missing] = np.nan if selection.dtype.kind == "f" else 0
        return selection
    if isinstance(values, AlignedArrays):
        return values.select(rows)
    if isinstance(values, Mapping):
        return {name: _select(each, rows, missing) for name, each in values.items()}
    return values.part(rows) if hasattr(values, "part") else values


def _concatenate(values: Sequence[Any]) -> Any:
    first = values[0]
    if isinstance(first, AlignedArrays):
        return type(first).concatenate(values)
    return np.concatenate(values) if isinstance(first, np.ndarray) else first
