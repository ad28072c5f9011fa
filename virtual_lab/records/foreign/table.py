"""One table of another laboratory into a record: its columns, their units, its way of counting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from virtual_lab.catalog.specs import Spec, Whole
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import inside, read_table
from virtual_lab.records import RECORD_TYPES, Record
from virtual_lab.records.record import require_numbers
from virtual_lab.units import DIMENSIONS, suffix

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ChannelForm", "FirstIndex", "column_names", "read_channel"]

FirstIndex = Literal[0, 1]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelForm(Spec):
    """What the form says of one channel's file.

    `columns` gives our name, with their unit, the header it has in the file; `fixed` the index
    columns left out because they are the same in every row; `rows` the one left out because the
    rows count it; `wide` to a value column the headers of the several columns it stands in, each
    with the indices it is for.
    """

    record: str
    file: str
    columns: Mapping[str, str] = field(default_factory=dict)
    wide: Mapping[str, Mapping[str, Mapping[str, Whole]]] = field(default_factory=dict)
    fixed: Mapping[str, Whole] = field(default_factory=dict)
    rows: str = ""
    ignore: tuple[str, ...] = ()
    index_from: FirstIndex | Mapping[str, FirstIndex] | None = None
    delimiter: Literal[",", ";", "\t"] = ","
    decimal: Literal[".", ","] = "."


@dataclass(frozen=True, slots=True)
class _Meaning:
    """A header's: our column, and the factor that takes its cells to SI."""

    column: str
    factor: float


def column_names(column: str) -> dict[str, float]:
    """Return the names a column may have in a file, a unit each, and their factors to SI.

    ``mass_kg`` may be ``mass_oz``; what counts or numbers something has its one name.
    """
    fitting = [
        (dimension, ending)
        for dimension, units in DIMENSIONS.items()
        for unit, factor in units.items()
        if factor == 1
        and column.endswith(ending := f"_{suffix(unit)}")
        and not column.removesuffix(ending).endswith("_per")  # a rate is no time
    ]
    if not fitting:
        return {column: 1.0}
    dimension, ending = max(fitting, key=lambda each: len(each[1]))
    stem = column.removesuffix(ending)
    return {f"{stem}_{suffix(unit)}": factor for unit, factor in DIMENSIONS[dimension].items()}


def read_channel(form: ChannelForm, folder: Path, index_from: FirstIndex, where: str) -> Record:
    """Return the record that a channel's file holds.

    Parameters
    ----------
    form
        What the laboratory says of the file.
    folder
        That the file's name counts from.
    index_from
        Where indices start, if `form` does not say.
    where
        The form itself, in errors.

    Raises
    ------
    InputError
        A form that does not fit the record or the file, or a file that is no such record.
    """
    if form.record not in RECORD_TYPES:
        hint = nearest(form.record, RECORD_TYPES)
        raise InputError(where, "record", form.record, f"{hint}allowed: {', '.join(RECORD_TYPES)}")
    kind = RECORD_TYPES[form.record]
    meanings = _meanings(kind)
    first = _first(kind, form, index_from, where)
    path = inside(folder, form.file, where, "file")
    table = read_table(path, delimiter=form.delimiter, decimal=form.decimal)
    table, headers = _renamed(table, form, meanings, str(path), where)
    _require_known(form.wide, meanings, "wide", where)
    table = _spread(table, form, _axes(kind), first, str(path), where)
    found = _found(table, kind, meanings, str(path))
    require_numbers(table.rename(columns=headers), str(path))
    values = [found[column.name] for column in kind.columns.values() if not column.is_index]
    if table[values].isna().all(axis=None):
        raise InputError(str(path), ", ".join(values), None, "hold no number yet")
    record = table[list(found.values())].set_axis(list(found), axis="columns")
    for column in kind.columns.values():
        if column.axes != tuple(_axes(kind)):  # need stand only once
            once = record.groupby(list(column.axes))[column.name].transform("first")
            record = record.assign(**{column.name: record[column.name].fillna(once)})
    factors = {column: meanings[name].factor for column, name in found.items()}
    record = record.assign(**{key: record[key] * by for key, by in factors.items() if by != 1})
    try:
        return kind.from_table(record, str(path), first)
    except InputError as fault:
        name = found.get(fault.key, fault.key)
        value = fault.value
        if isinstance(value, float):
            value = value / factors.get(fault.key, 1.0)
        raise InputError(fault.where, headers.get(name, name), value, fault.allowed) from fault


def _axes(kind: type[Record]) -> list[str]:
    return list(dict.fromkeys(axis for column in kind.columns.values() for axis in column.axes))


def _meanings(kind: type[Record]) -> dict[str, _Meaning]:
    """Return every name that a column of a record's file may have, in the order of our own."""
    own = {axis: _Meaning(axis, 1.0) for axis in _axes(kind)}
    return own | {
        name: _Meaning(column.name, factor)
        for column in kind.columns.values()
        for name, factor in column_names(column.name).items()
    }


def _first(
    kind: type[Record], form: ChannelForm, index_from: FirstIndex, where: str
) -> dict[str, int]:
    numbered = [column.name for column in kind.columns.values() if column.is_index]
    indices = [*_axes(kind), *numbered]
    given = index_from if form.index_from is None else form.index_from
    if not isinstance(given, Mapping):
        return dict.fromkeys(indices, given)
    _require_known(given, indices, "index_from", where)
    return {index: given.get(index, index_from) for index in indices}


def _renamed(
    table: pd.DataFrame, form: ChannelForm, meanings: Mapping[str, _Meaning], path: str, where: str
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return the table under our names, and the header that each of these has in the file."""
    _require_known(form.columns, meanings, "columns", where)
    for header in [*form.columns.values(), *form.ignore]:
        if header not in table:
            raise InputError(path, "columns", _names(table), f"no {header!r}, named in {where}")
    theirs = {header: name for name, header in form.columns.items()}
    table = table.drop(columns=list(form.ignore)).rename(columns=theirs)
    for name in table:
        if list(table).count(name) > 1:
            raise InputError(path, "columns", str(name), f"stands there twice, see {where}")
    return table, dict(form.columns)


def _spread(
    table: pd.DataFrame,
    form: ChannelForm,
    axes: list[str],
    first: Mapping[str, int],
    path: str,
    where: str,
) -> pd.DataFrame:
    """Return the table with the index columns it left out, a value a row."""
    import pandas as pd

    for key, given in (("fixed", form.fixed), ("rows", [form.rows] if form.rows else [])):
        _require_known(given, axes, key, where)
        for axis in given:
            if axis in table:
                raise InputError(where, key, axis, f"is a column of {path} too")
    table = table.assign(**form.fixed)
    if form.rows:
        others = [axis for axis in axes if axis in table]
        number = table.groupby(others).cumcount() if others else np.arange(len(table))
        table = table.assign(**{form.rows: number + first[form.rows]})
    if not form.wide:
        return table
    if len(form.wide) > 1:
        raise InputError(where, "wide", ", ".join(form.wide), "one value column may be wide")
    (name, cells), *_ = form.wide.items()
    for header, indices in cells.items():
        _require_known(indices, axes, f"wide.{name}.{header}", where)
        if header not in table:
            raise InputError(path, "columns", _names(table), f"no {header!r}, named in {where}")
    rest = table.drop(columns=list(cells))
    if name in rest:
        raise InputError(where, "wide", name, f"is a column of {path} too")
    return pd.concat(
        [rest.assign(**indices, **{name: table[header]}) for header, indices in cells.items()],
        ignore_index=True,
    )


def _found(
    table: pd.DataFrame, kind: type[Record], meanings: Mapping[str, _Meaning], path: str
) -> dict[str, str]:
    """Return the name that each of the record's columns has in the table, in its own order."""
    unknown = [str(name) for name in table if name not in meanings]
    if unknown:
        allowed = f"allowed: {_allowed(kind)}; what is not to be read goes into ignore"
        raise InputError(path, "columns", ", ".join(unknown), allowed)
    found: dict[str, str] = {}
    for name in map(str, table):
        column = meanings[name].column
        if column in found:
            raise InputError(path, "columns", f"{found[column]}, {name}", "are the same column")
        found[column] = name
    wanted = [*_axes(kind), *(column.name for column in kind.columns.values())]
    missing = [column for column in wanted if column not in found]
    if missing:
        allowed = f"missing: {', '.join(missing)} (needed: {_allowed(kind)})"
        raise InputError(path, "columns", _names(table), allowed)
    return {column: found[column] for column in wanted}


def _names(table: pd.DataFrame) -> str:
    return ", ".join(map(str, table))


def _allowed(kind: type[Record]) -> str:
    columns = (" or ".join(column_names(column.name)) for column in kind.columns.values())
    return "; ".join([*_axes(kind), *columns])


def _require_known(
    given: Mapping[str, object] | list[str],
    known: Mapping[str, object] | list[str],
    key: str,
    where: str,
) -> None:
    for name in given:
        if name not in known:
            raise InputError(where, key, name, f"{nearest(name, known)}allowed: {', '.join(known)}")
