"""From a table of another laboratory to a record: columns, units, index origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from virtual_lab.catalog.specs import Spec, Whole
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import inside, read_table
from virtual_lab.records import Record, record_types
from virtual_lab.records.record import RecordColumn, require_numbers
from virtual_lab.units import DIMENSIONS, from_si, suffix, to_si

if TYPE_CHECKING:
    import pandas as pd

FirstIndex = Literal[0, 1]


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelForm(Spec):
    """Description of one channel's file by another laboratory.

    * `columns` maps our column name, ending in the laboratory's unit, to the header in the file.
    * `fixed` maps an index column that the file does not have to its value in all rows.
    * `rows` names an index column that the file does not have and that equals the row number.
    * `wide` maps a value column that is spread over several columns of the file to their headers,
      each with its indices.
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
    """Meaning of a header: our column, and the unit of its values with its dimension."""

    column: str
    unit: str
    dimension: str


def column_names(column: RecordColumn) -> dict[str, tuple[str, str]]:
    """Return the allowed names of a column, each with the unit of its values and its dimension.

    For ``mass_kg`` the result is ``{"mass_kg": ("kg", "mass"), "mass_oz": ("oz", "mass"), …}``.

    The name of a count or an index does not end in an SI unit. Its unit is ``1``, and its dimension
    is ``number``. A share (0 to 1) is also allowed in percent, such as ``humidity_percent``.
    """
    fitting = [
        (dimension, ending)
        for dimension, units in DIMENSIONS.items()
        for unit, factor in units.items()
        if factor == 1
        and column.name.endswith(ending := f"_{suffix(unit)}")
        # "_per_s" ends a rate, not a time
        and not column.name.removesuffix(ending).endswith("_per")
    ]
    if not fitting:
        percent = {f"{column.name}_percent": ("%", "number")} if column.is_share else {}
        return {column.name: ("1", "number"), **percent}
    dimension, ending = max(fitting, key=lambda each: len(each[1]))
    stem = column.name.removesuffix(ending)
    return {f"{stem}_{suffix(unit)}": (unit, dimension) for unit in DIMENSIONS[dimension]}


def read_channel(form: ChannelForm, folder: Path, index_from: FirstIndex, where: str) -> Record:
    """Return the record in a laboratory's file of one channel, in SI and with indices from 0.

    Parameters
    ----------
    form
        Description of the file by the laboratory.
    folder
        Folder of the file. The name of the file in `form` is relative to it.
    index_from
        First index in the file, 0 or 1. It is used if `form` does not state one.
    where
        Name of the form, for error messages.

    Raises
    ------
    InputError
        The form does not fit the record or the file, or the file does not contain this kind of
        record.
    """
    kinds = record_types()
    if form.record not in kinds:
        hint = nearest(form.record, kinds)
        raise InputError(where, "record", form.record, f"{hint}allowed: {', '.join(kinds)}")
    kind = kinds[form.record]
    meanings = _meanings(kind)
    first = _first(kind, form, index_from, where)
    path = inside(folder, form.file, where, "file")
    table = read_table(path, delimiter=form.delimiter, decimal=form.decimal)
    table, headers = _rename(table, form, meanings, str(path), where)
    _require_known(form.wide, meanings, "wide", where)
    table = _spread(table, form, kind.axes(), first, str(path), where)
    names = _find_columns(table, kind, meanings, str(path))
    require_numbers(table.rename(columns=headers), str(path))
    values = [names[column.name] for column in kind.columns.values() if not column.is_index]
    if table[values].isna().all(axis=None):
        raise InputError(str(path), ", ".join(values), None, "contain no numbers yet")
    record = table[list(names.values())].set_axis(list(names), axis="columns")
    for column in kind.columns.values():
        # A value that is constant along an axis needs to be entered only once.
        if column.axes != tuple(kind.axes()):
            once = record.groupby(list(column.axes))[column.name].transform("first")
            record = record.assign(**{column.name: record[column.name].fillna(once)})
    units = {key: (meanings[name].unit, meanings[name].dimension) for key, name in names.items()}
    values_si = {
        key: to_si(record[key].to_numpy(float), *unit)
        for key, unit in units.items()
        if unit[0] != "1"
    }
    record = record.assign(**values_si)
    try:
        return kind.from_table(record, str(path), first)
    except InputError as fault:
        name = names.get(fault.key, fault.key)
        value = fault.value
        if isinstance(value, float):
            value = from_si(value, *units.get(fault.key, ("1", "number")))
        raise InputError(fault.where, headers.get(name, name), value, fault.allowed) from fault


def _meanings(kind: type[Record]) -> dict[str, _Meaning]:
    """Return the allowed names of all columns of a record's file, in our order."""
    indices = {axis: _Meaning(axis, "1", "number") for axis in kind.axes()}
    return indices | {
        name: _Meaning(column.name, *unit)
        for column in kind.columns.values()
        for name, unit in column_names(column).items()
    }


def _first(
    kind: type[Record], form: ChannelForm, index_from: FirstIndex, where: str
) -> dict[str, int]:
    numbered = [column.name for column in kind.columns.values() if column.is_index]
    indices = [*kind.axes(), *numbered]
    first = index_from if form.index_from is None else form.index_from
    if not isinstance(first, Mapping):
        return dict.fromkeys(indices, first)
    _require_known(first, indices, "index_from", where)
    return {index: first.get(index, index_from) for index in indices}


def _rename(
    table: pd.DataFrame, form: ChannelForm, meanings: Mapping[str, _Meaning], path: str, where: str
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return the table with our names, and the header of each name in the file."""
    _require_known(form.columns, meanings, "columns", where)
    for header in [*form.columns.values(), *form.ignore]:
        if header not in table:
            allowed = f"lacks {header!r}, which {where} names"
            raise InputError(path, "columns", _names(table), allowed)
    theirs = {header: name for name, header in form.columns.items()}
    table = table.drop(columns=list(form.ignore)).rename(columns=theirs)
    for name in table:
        if list(table).count(name) > 1:
            raise InputError(path, "columns", str(name), f"this column occurs twice; see {where}")
    return table, dict(form.columns)


def _spread(
    table: pd.DataFrame,
    form: ChannelForm,
    axes: list[str],
    first: Mapping[str, int],
    path: str,
    where: str,
) -> pd.DataFrame:
    """Return the table with the missing index columns added, and one value per row."""
    import pandas as pd

    for key, axes_given in (("fixed", form.fixed), ("rows", [form.rows] if form.rows else [])):
        _require_known(axes_given, axes, key, where)
        for axis in axes_given:
            if axis in table:
                raise InputError(where, key, axis, f"is also a column of {path}")
    table = table.assign(**form.fixed)
    if form.rows:
        others = [axis for axis in axes if axis in table]
        number = table.groupby(others).cumcount() if others else np.arange(len(table))
        table = table.assign(**{form.rows: number + first[form.rows]})
    if not form.wide:
        return table
    if len(form.wide) > 1:
        raise InputError(where, "wide", ", ".join(form.wide), "only one value column may be wide")
    (name, cells), *_ = form.wide.items()
    for header, indices in cells.items():
        _require_known(indices, axes, f"wide.{name}.{header}", where)
        if header not in table:
            allowed = f"lacks {header!r}, which {where} names"
            raise InputError(path, "columns", _names(table), allowed)
    rest = table.drop(columns=list(cells))
    if name in rest:
        raise InputError(where, "wide", name, f"is also a column of {path}")
    return pd.concat(
        [rest.assign(**indices, **{name: table[header]}) for header, indices in cells.items()],
        ignore_index=True,
    )


def _find_columns(
    table: pd.DataFrame, kind: type[Record], meanings: Mapping[str, _Meaning], path: str
) -> dict[str, str]:
    """Return the name in the table of each column of the record, in the record's order."""
    unknown = [str(name) for name in table if name not in meanings]
    if unknown:
        allowed = f"allowed: {_allowed_columns(kind)}; list other columns under ignore"
        raise InputError(path, "columns", ", ".join(unknown), allowed)
    names: dict[str, str] = {}
    for name in map(str, table):
        column = meanings[name].column
        if column in names:
            raise InputError(
                path, "columns", f"{names[column]}, {name}", "are two names of the same column"
            )
        names[column] = name
    required = [*kind.axes(), *(column.name for column in kind.columns.values())]
    missing = [column for column in required if column not in names]
    if missing:
        allowed = f"missing: {', '.join(missing)} (needed: {_allowed_columns(kind)})"
        raise InputError(path, "columns", _names(table), allowed)
    return {column: names[column] for column in required}


def _names(table: pd.DataFrame) -> str:
    return ", ".join(map(str, table))


def _allowed_columns(kind: type[Record]) -> str:
    columns = (" or ".join(column_names(column)) for column in kind.columns.values())
    return "; ".join([*kind.axes(), *columns])


def _require_known(
    names: Mapping[str, object] | list[str],
    allowed: Mapping[str, object] | list[str],
    key: str,
    where: str,
) -> None:
    for name in names:
        if name not in allowed:
            hint = nearest(name, allowed)
            raise InputError(where, key, name, f"{hint}allowed: {', '.join(allowed)}")
