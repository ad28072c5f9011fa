"""What every record is: arrays with named axes, and their form in a CSV file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Column", "Record", "join"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Column:
    """How one field stands in the file: its column and the axes it runs over."""

    name: str
    axes: tuple[str, ...]
    may_be_missing: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Base of all records: immutable arrays, checked against the declared axes."""

    columns: ClassVar[Mapping[str, Column]]

    def __post_init__(self) -> None:
        for field in fields(self):
            values = np.array(getattr(self, field.name), dtype=np.float64)
            column = self.columns[field.name]
            if values.ndim != len(column.axes):
                raise ValueError(f"{field.name} needs axes {column.axes}, got shape {values.shape}")
            values.setflags(write=False)
            object.__setattr__(self, field.name, values)
        self.sizes()

    def sizes(self) -> dict[str, int]:
        """Return the length of every axis; `ValueError` where two fields disagree."""
        sizes: dict[str, int] = {}
        for field in fields(self):
            values = getattr(self, field.name)
            for axis, size in zip(self.columns[field.name].axes, values.shape, strict=True):
                if sizes.setdefault(axis, size) != size:
                    raise ValueError(
                        f"{field.name} has {size} along {axis!r}, others {sizes[axis]}"
                    )
        return sizes

    def table(self) -> pd.DataFrame:
        """Return the record in its file form: index columns, then value columns."""
        import pandas as pd

        sizes = self.sizes()
        index = np.indices(tuple(sizes.values())).reshape(len(sizes), -1)
        data: dict[str, Any] = dict(zip(sizes, index, strict=True))
        for field in fields(self):
            column = self.columns[field.name]
            data[column.name] = getattr(self, field.name)[tuple(data[axis] for axis in column.axes)]
        return pd.DataFrame(data)

    @classmethod
    def from_table(cls, table: pd.DataFrame, where: str) -> Self:
        """Return the record a file holds; `InputError` where columns or rows do not fit."""
        axes = list(dict.fromkeys(axis for column in cls.columns.values() for axis in column.axes))
        wanted = [*axes, *(column.name for column in cls.columns.values())]
        if list(table.columns) != wanted:
            raise InputError(
                where,
                "columns",
                ", ".join(map(str, table.columns)),
                f"expected {', '.join(wanted)}",
            )
        _check_numbers(table, axes, cls.columns.values(), where)
        sizes = {axis: int(table[axis].max()) + 1 if len(table) else 0 for axis in axes}
        rows = int(np.prod(list(sizes.values())))
        if rows == 0 or len(table) != rows:
            raise InputError(
                where, "rows", len(table), f"expected {rows} (is the record cut short?)"
            )
        if table.duplicated(axes).any():
            raise InputError(where, "rows", None, f"two rows have the same {', '.join(axes)}")
        table = table.sort_values(axes)
        arrays = {}
        for name, column in cls.columns.items():
            grid = table[column.name].to_numpy(dtype=np.float64).reshape(tuple(sizes.values()))
            values = grid[tuple(slice(None) if axis in column.axes else 0 for axis in axes)]
            others = tuple(i for i, axis in enumerate(axes) if axis not in column.axes)
            if not np.array_equal(
                grid, np.broadcast_to(np.expand_dims(values, others), grid.shape), equal_nan=True
            ):
                over = ", ".join(column.axes)
                raise InputError(where, column.name, None, f"one value for each {over}, found more")
            arrays[name] = values
        return cls(**arrays)


def _check_numbers(table: pd.DataFrame, axes: list[str], columns: Any, where: str) -> None:
    import pandas as pd

    for name in table.columns:
        if not pd.api.types.is_numeric_dtype(table[name]):
            text = table[name][pd.to_numeric(table[name], errors="coerce").isna()].dropna()
            raise InputError(
                where,
                str(name),
                str(text.iloc[0]) if len(text) else None,
                "must be numbers",
            )
    for axis in axes:
        if len(table) and (
            table[axis].isna().any()
            or (table[axis] != table[axis].round()).any()
            or table[axis].min() < 0
        ):
            raise InputError(where, axis, None, "must be whole numbers from 0")
    for column in columns:
        values = table[column.name].to_numpy(float)
        if np.isinf(values).any() or (np.isnan(values).any() and not column.may_be_missing):
            bad = values[~np.isfinite(values)][0]
            raise InputError(where, column.name, bad, "every row needs a finite number")


def join(parts: list[Record]) -> Record:
    """Return one record of several rounds: fields with a leading shot axis are concatenated."""
    first = parts[0]
    arrays = {}
    for name, column in first.columns.items():
        values = [getattr(part, name) for part in parts]
        arrays[name] = np.concatenate(values) if column.axes[0] == "shot" else values[0]
    return type(first)(**arrays)
