"""Base of all records: arrays with named axes, and their form in a CSV file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd

    Table = pd.DataFrame | Mapping[str, NDArray[Any]]  # columns keyed by name, of one length

LARGEST = 1e18  # largest value that a recorder shows, so that products stay finite
PAIRS = {"way": "in and back", "edge": "broke and cleared"}  # axes of length two
AXES = {  # meaning of each index column; all indices start at 0
    "item": "number of the piece on the scale or rule",
    "repeat": "number of the repeated reading",
    "release": "number of the release of the pendulum",
    "passage": "number of the passage of the pendulum, in one direction",
    "shot": "number of the shot",
    "way": "direction of the ball: 0 inbound, 1 back",
    "gate": "number of the gate, counted from the cannon",
    "board": "number of the board, counted from the cannon",
    "beam": "number of the beam, counted from below",
    "edge": "0: the beam breaks, 1: the beam clears",
    "sample": "number of the encoder sample",
    "reading": "number of the reading: 0 at the start of the test, the last one at its end",
    "frame": "number of the frame",
    "mark": "number of the mark on the aim paper",
}


@dataclass(frozen=True, slots=True)
class RecordColumn:
    """Form of one field in the file: its column, its axes and its meaning.

    The name ends in the unit. The meaning is printed in ``datapackage.json``, in the forms of
    another laboratory, and in the dictionary of the site.
    """

    name: str
    axes: tuple[str, ...]
    meaning: str
    may_be_missing: bool = False
    is_index: bool = False  # whether it holds the index of an item, from 0 like index columns
    is_share: bool = False  # whether it is a share, 0 to 1, that a form may also state in percent


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Values that must not decrease along an axis (if `strictly`, must increase), ignoring NaN."""

    column: str
    values: Array
    axes: tuple[str, ...]
    along: str
    fault: str  # message for values out of order
    sign: float | Array = 1.0  # -1 for values that must not increase
    strictly: bool = False

    def first_fault(self) -> tuple[int, ...] | None:
        """Return the index of the first value out of order, None if all are in order."""
        axis = self.axes.index(self.along)
        signed = np.moveaxis(self.values * self.sign, axis, 0)
        highest, later = np.fmax.accumulate(signed)[:-1], signed[1:]
        wrong = later <= highest if self.strictly else later < highest
        if not wrong.any():
            return None
        place = np.argwhere(np.moveaxis(wrong, 0, axis))[0]
        place[axis] += 1
        return tuple(map(int, place))


def rising(times: Array, axes: tuple[str, ...]) -> Order:
    """Return the requirement that times increase strictly along their last axis. NaN is ignored.

    `axes` are the names of the axes of `times`. An error message about a violation names the column
    ``time_s``.
    """
    fault = f"must increase from {axes[-1]} to {axes[-1]}"
    return Order(
        column="time_s", values=times, axes=axes, along=axes[-1], fault=fault, strictly=True
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Base of all records: immutable arrays, checked against the declared axes.

    A writable array is copied; a read-only array is used as it is.
    """

    columns: ClassVar[Mapping[str, RecordColumn]]
    # fields too large for a table, which are stored as arrays beside it, and their axes
    attached: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name in self.attached:
                continue
            array = np.asarray(getattr(self, field.name))
            values = np.array(array, dtype=np.float64, copy=array.flags.writeable or None)
            values.setflags(write=False)
            object.__setattr__(self, field.name, values)
        self.sizes()

    @classmethod
    def axes(cls) -> list[str]:
        """Return the names of the table's axes, which are its index columns, in their order."""
        return list(dict.fromkeys(axis for column in cls.columns.values() for axis in column.axes))

    def sizes(self) -> dict[str, int]:
        """Return the length of every axis of the table.

        Raises `ValueError` if two fields disagree.
        """
        sizes: dict[str, int] = {}
        for name, column in self.columns.items():
            _count(name, getattr(self, name), column.axes, sizes)
        beside = dict(sizes)
        for name, axes in self.attached.items():
            values = getattr(self, name)
            if values is None:
                continue
            if values.dtype.kind not in "iuf":
                raise ValueError(f"{name} needs real numbers, got {values.dtype}")
            _count(name, values, axes, beside)
        return sizes

    def table(self) -> pd.DataFrame:
        """Return the record as the table of its file: index columns, then value columns."""
        import pandas as pd

        return pd.DataFrame(self.table_columns())

    def table_columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of the record's file keyed by name, (row,): indices, then values."""
        sizes = self.sizes()
        index = np.indices(tuple(sizes.values())).reshape(len(sizes), -1)
        data: dict[str, Any] = dict(zip(sizes, index, strict=True))
        for name, column in self.columns.items():
            data[column.name] = getattr(self, name)[tuple(data[axis] for axis in column.axes)]
        return data

    def select(self, rows: Any) -> Self:
        """Return the record with only the given `rows` of its first axis, a slice or a mask.

        Arrays beside the table are left out.
        """
        first = next(iter(self.columns.values())).axes[0]
        chosen = {
            name: getattr(self, name)[rows if column.axes[0] == first else ...]
            for name, column in self.columns.items()
        }
        return type(self)(**chosen)

    def join_attached(self, parts: list[Any]) -> dict[str, Any]:
        """Return the joined arrays beside the tables of several rounds, keyed by name."""
        return {}

    def orders(self) -> tuple[Order, ...]:
        """Return the requirements on the order of values, mostly of times."""
        return ()

    @classmethod
    def from_table(
        cls, table: Table, where: str, first: Mapping[str, int] = MappingProxyType({})
    ) -> Self:
        """Return the record in a table. Raises `InputError` if columns, rows or times do not fit.

        `first` holds the first number of index columns that do not start at 0.
        """
        axes = cls.axes()
        required = [*axes, *(column.name for column in cls.columns.values())]
        if list(table) != required:
            names = ", ".join(map(str, table))
            raise InputError(where, "columns", names, f"expected {', '.join(required)}")
        numbers_of = _check_numbers(table, axes, cls.columns.values(), where, first)
        for name in first.keys() & numbers_of.keys():
            numbers_of[name] = numbers_of[name] - first[name]
        many = numbers_of[axes[0]].size
        sizes = {axis: int(numbers_of[axis].max(initial=-1)) + 1 for axis in axes}
        for axis in sizes.keys() & PAIRS.keys():
            if many and sizes[axis] != 2:
                numbers = f"{first.get(axis, 0)} and {first.get(axis, 0) + 1}"
                raise InputError(where, axis, None, f"needs {numbers}, {PAIRS[axis]}")
        rows = int(np.prod(list(sizes.values())))
        if rows == 0 or many != rows:
            raise InputError(where, "rows", many, f"expected {rows} (is the record cut short?)")
        index = tuple(numbers_of[axis].astype(np.intp) for axis in axes)
        row = np.ravel_multi_index(index, tuple(sizes.values()))
        if np.unique(row).size < rows:
            raise InputError(where, "rows", None, f"two rows have the same {', '.join(axes)}")
        order = np.argsort(row)
        arrays = {}
        for name, column in cls.columns.items():
            grid = numbers_of[column.name][order].reshape(tuple(sizes.values()))
            values = grid[tuple(slice(None) if axis in column.axes else 0 for axis in axes)]
            others = tuple(i for i, axis in enumerate(axes) if axis not in column.axes)
            if not np.array_equal(
                grid, np.broadcast_to(np.expand_dims(values, others), grid.shape), equal_nan=True
            ):
                over = ", ".join(column.axes)
                allowed = f"needs a single value for each {over}"
                raise InputError(where, column.name, None, allowed)
            arrays[name] = values
        record = cls(**arrays)
        record._check_orders(where, first)
        return record

    def _check_orders(self, where: str, first: Mapping[str, int]) -> None:
        for order in self.orders():
            place = order.first_fault()
            if place is not None:
                numbered = zip(order.axes, place, strict=True)
                at = ", ".join(f"{axis} {number + first.get(axis, 0)}" for axis, number in numbered)
                raise InputError(where, order.column, order.values[place], f"{order.fault} ({at})")


def _check_numbers(
    table: Table, axes: list[str], columns: Any, where: str, first: Mapping[str, int]
) -> dict[str, Array]:
    """Return the columns of a table as floats. Raises `InputError` for values that do not fit."""
    require_numbers(table, where)
    numbers_of = {str(name): np.asarray(values, np.float64) for name, values in table.items()}
    for axis in axes:
        _check_index(numbers_of[axis], axis, first.get(axis, 0), where)
        numbers = np.unique(numbers_of[axis])
        due = first.get(axis, 0) + np.arange(numbers.size)
        if (numbers != due).any():
            skipped = due[numbers != due][0]
            allowed = f"is missing, although the numbers go up to {numbers[-1]:g}"
            raise InputError(where, axis, skipped, allowed)
    for column in columns:
        values = numbers_of[column.name]
        sound = np.abs(values) <= LARGEST
        if not (sound | (np.isnan(values) & column.may_be_missing)).all():
            allowed = f"every row needs a finite number up to {LARGEST:g}"
            raise InputError(where, column.name, values[~sound][0], allowed)
        if column.is_index:
            _check_index(values, column.name, first.get(column.name, 0), where)
    return numbers_of


def _check_index(values: Array, name: str, first: int, where: str) -> None:
    wrong = values[~((values >= first) & (values == np.round(values)))]
    if wrong.size:
        raise InputError(where, name, wrong[0], f"must be whole numbers, {first} and up")


def require_numbers(table: Table, where: str) -> None:
    """Raise `InputError` for the first cell of a table that is not a number.

    Empty cells are allowed. `where` is the name of the table in the error message.
    """
    for name, values in table.items():
        kind = np.asarray(values).dtype.kind
        if kind in "iuf":
            continue
        import pandas as pd

        cells = pd.Series(values, dtype=str if kind == "b" else None)
        text = cells[pd.to_numeric(cells, errors="coerce").isna()].dropna()
        cell, row = (
            (str(text.iloc[0]), f"; see row {text.index[0] + 1}") if len(text) else (None, "")
        )
        allowed = f"must be numbers, without unit or decimal comma{row}"
        raise InputError(where, str(name), cell, allowed)


def _count(name: str, values: NDArray[Any], axes: tuple[str, ...], sizes: dict[str, int]) -> None:
    """Add the lengths of a field's axes to `sizes`. Raises `ValueError` if they contradict it."""
    if values.ndim != len(axes):
        raise ValueError(f"{name} needs the axes {axes}, but has the shape {values.shape}")
    for axis, size in zip(axes, values.shape, strict=True):
        if sizes.setdefault(axis, size) != size:
            raise ValueError(
                f"{name} has the length {size} along {axis!r}; other columns have {sizes[axis]}"
            )


def join(parts: list[Record]) -> Record:
    """Return one record that holds the shots of several records, in the order of `parts`.

    All records must be of the same kind. A field is concatenated if its first axis is the shot. Any
    other field is taken from the first record. Raises `IndexError` for an empty list, and
    `ValueError` if the lengths of other axes differ.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    arrays = {}
    for name, column in first.columns.items():
        values = [getattr(part, name) for part in parts]
        arrays[name] = np.concatenate(values) if column.axes[0] == "shot" else values[0]
    return type(first)(**arrays, **first.join_attached(parts))
