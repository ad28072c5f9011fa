"""Raw records: what instruments and operators wrote down, and nothing they could not know.

A record is a set of arrays with named axes and one CSV form: a row for every index
combination, an index column for every axis, a value column with its unit for every field.
Another laboratory can write the same files by hand or from its own recorder; ``data/README.md``
documents every column.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "RECORD_TYPES",
    "AimMarks",
    "Column",
    "EncoderRecord",
    "GateRecord",
    "LengthReadings",
    "MassReadings",
    "PendulumRecord",
    "Record",
    "ShotLog",
    "join",
]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class MassReadings(Record):
    """Repeated readings of a scale, shape (item, repeat)."""

    readings: Array
    columns: ClassVar[Mapping[str, Column]] = {"readings": Column("mass_kg", ("item", "repeat"))}


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthReadings(Record):
    """Repeated readings of a rule or a balance stand, shape (item, repeat)."""

    readings: Array
    columns: ClassVar[Mapping[str, Column]] = {"readings": Column("length_m", ("item", "repeat"))}


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumRecord(Record):
    """Times of the same-way passages, shape (release, passage); amplitudes (release, end).

    `end` 0 is the amplitude read at the first passage, 1 at the last.
    """

    times: Array
    first_amplitude: Array
    last_amplitude: Array
    columns: ClassVar[Mapping[str, Column]] = {
        "times": Column("time_s", ("release", "passage")),
        "first_amplitude": Column("first_amplitude_rad", ("release",)),
        "last_amplitude": Column("last_amplitude_rad", ("release",)),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRecord(Record):
    """Times at which beams broke and cleared, shape (shot, way, gate, edge), NaN: not seen.

    `way` 0 is the ball going in, 1 coming back; `edge` 0 broke, 1 cleared; gates count from
    the cannon to the target.
    """

    times: Array
    columns: ClassVar[Mapping[str, Column]] = {
        "times": Column("time_s", ("shot", "way", "gate", "edge"), may_be_missing=True)
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderRecord(Record):
    """Counts at the ticks of the recorder's clock: counts (shot, sample), times (sample,)."""

    counts: Array
    times: Array
    columns: ClassVar[Mapping[str, Column]] = {
        "counts": Column("counts", ("shot", "sample")),
        "times": Column("time_s", ("sample",)),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class AimMarks(Record):
    """Where test shots marked a witness paper, off the aim: along and across the bat."""

    along: Array
    across: Array
    columns: ClassVar[Mapping[str, Column]] = {
        "along": Column("along_m", ("mark",)),
        "across": Column("across_m", ("mark",)),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotLog(Record):
    """The operator's log: ball used, nominal speed, place set with the rule, shape (shot,)."""

    ball: Array
    nominal_speed: Array
    place: Array
    columns: ClassVar[Mapping[str, Column]] = {
        "ball": Column("ball", ("shot",)),
        "nominal_speed": Column("nominal_speed_m_per_s", ("shot",)),
        "place": Column("place_m", ("shot",)),
    }


RECORD_TYPES: Mapping[str, type[Record]] = {
    "mass-readings": MassReadings,
    "length-readings": LengthReadings,
    "pendulum": PendulumRecord,
    "gates": GateRecord,
    "encoder": EncoderRecord,
    "aim-marks": AimMarks,
    "shot-log": ShotLog,
}
