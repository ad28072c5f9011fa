"""Rows and numbers as plain text for a terminal: every column with its title and unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, is_dataclass
from itertools import chain, zip_longest
from textwrap import wrap
from typing import Any, NamedTuple

INLINE = "inline"
WIDEST = 110  # largest width of a table [characters]
NARROWEST = 20  # smallest width to which the widest column is narrowed [characters]


class Column(NamedTuple):
    """Title, unit and format of the values of one key; the format may be a function of the row."""

    title: str
    unit: str = ""
    form: str | Callable[[Any], str] = ".4g"

    @property
    def head(self) -> str:
        """The title with its unit."""
        from virtual_lab.output.rounding import both_units  # numpy loads with it

        return f"{self.title} [{both_units(self.unit)}]" if self.unit else self.title


def column(title: str, unit: str = "", form: str | Callable[[Any], str] = ".4g") -> Any:
    """Return a dataclass field that becomes a column of printed tables.

    A field without this function appears only in CSV and JSON.

    Parameters
    ----------
    title, unit
        Head of the column.
    form
        Format of the numbers, or a function of the row that returns the text of the cell.
    """
    return field(metadata={Column.__name__: Column(title, unit, form)})


def inline() -> Any:
    """Return a dataclass field that becomes several columns of a table.

    The value of the field is a dataclass or a mapping. Its fields or keys become columns under
    their own names, without the name of the field in front.
    """
    return field(metadata={INLINE: True})


def columns_of(row: Any) -> dict[str, Column]:
    """Return the printed columns of a row, which is a dataclass, keyed by field name.

    If a field ``outer`` holds a dataclass with a field ``inner``, the key is ``outer_inner`` and
    the title begins with "outer: ". If the outer field is `inline`, key and title have no prefix.
    Fields that are not printed are left out.
    """
    columns: dict[str, Column] = {}
    for each in fields(row):
        value = getattr(row, each.name)
        if Column.__name__ in each.metadata:
            columns[each.name] = each.metadata[Column.__name__]
        elif is_dataclass(value):
            for key, within in columns_of(value).items():
                part = _of_part(each.name, within)
                if INLINE in each.metadata:
                    columns[key] = part._replace(title=within.title)
                else:
                    columns[f"{each.name}_{key}"] = part
    return columns


def _of_part(name: str, column: Column) -> Column:
    form, title = column.form, f"{name}: {column.title}"
    if isinstance(form, str):
        return column._replace(title=title)
    return column._replace(title=title, form=lambda row: form(getattr(row, name)))


def record(row: Any) -> Mapping[str, Any]:
    """Return the values of a row, keyed by column. The row is a dataclass or a mapping.

    A mapping is returned unchanged. If a field of a dataclass holds a dataclass or a mapping, each
    of the inner values becomes a column. The key of this column is the field's name and the inner
    key, joined by ``_``, such as ``recoil_rms``. If the field has the mark `INLINE` in its
    metadata, the key is the inner key alone. Dataclasses within the inner dataclass are treated in
    the same way. The inner values of a mapping are kept as they are.
    """
    if isinstance(row, Mapping):
        return row
    flat: dict[str, Any] = {}
    for each in fields(row):
        value = getattr(row, each.name)
        if isinstance(value, Mapping) or is_dataclass(value):
            name = "" if INLINE in each.metadata else f"{each.name}_"
            flat |= {f"{name}{key}": one for key, one in record(value).items()}
        else:
            flat[each.name] = value
    return flat


def table_text(
    rows: Sequence[Any],
    columns: Mapping[str, Column] | None = None,
    *,
    across: str = "",
) -> str:
    """Return rows as a text table with a header. The columns are as wide as their longest cell.

    A table wider than `WIDEST` has heads of several lines, and cells of several lines in its widest
    column. If it is still too wide, its columns are printed in blocks beneath each other. Each
    block begins with the first columns that together distinguish the rows, or with the first column
    if none do.

    Without rows the text is the word ``nothing``. The value None gives an empty cell. A column is
    left out if all its cells are empty.

    Parameters
    ----------
    rows
        Dataclasses or mappings, all of one type.
    columns
        Columns to print, in this order, keyed by column key. By default the printed columns of the
        dataclass, or one column per key of a mapping.
    across
        Key of the value that is printed as the head of a column. The table is then transposed: each
        element of `rows` is a column. By default each element is a line.
    """
    if not rows:
        return "nothing"
    if columns is None:
        first = rows[0]
        named = isinstance(first, Mapping)
        columns = {key: Column(key) for key in first} if named else columns_of(first)
    records = [record(row) for row in rows]
    texts = [
        [each.head, *(_cell(*row, key, each) for row in zip(rows, records, strict=True))]
        for key, each in columns.items()
    ]
    texts = [cells for cells in texts if any(cells[1:])]
    if across:
        heads = ["", *(str(values[across]) for values in records)]
        texts = [list(cells) for cells in zip(heads, *texts, strict=True)]
    lines = len(texts[0]) - 1
    if _width(texts) > WIDEST:
        for cells in texts:
            room = max(8, *map(len, cells[1:]))
            cells[:1] = wrap(cells[0], room, break_long_words=False)
        tallest = max(map(len, texts))
        texts = [[""] * (tallest - len(cells)) + cells for cells in texts]
    labels = _labels(texts, lines)
    blocks = [texts[:1]]
    for cells in texts[1:]:
        wider = [*blocks[-1], cells]
        if len(wider) > 2 and _width(wider) > WIDEST and _room(wider) < NARROWEST:
            blocks.append(labels[:])
        blocks[-1].append(cells)
    return "\n\n".join(_block_text(block).lstrip("\n") for block in blocks)


def _labels(texts: list[list[str]], lines: int) -> list[list[str]]:
    """Return the first columns that distinguish the last `lines` lines, or the first column.

    Lines that are equal in the first four columns need not be distinguished.
    """
    labels: list[list[str]] = []
    different = set(zip(*(cells[-lines:] for cells in texts[:4]), strict=True))
    for cells in texts[:4]:
        if len(set(cells[-lines:])) > 1:
            labels.append(cells)
        rows = set(zip(*(label[-lines:] for label in labels), strict=True))
        if len(rows) == len(different) and _width(labels) < WIDEST / 2:
            return labels
    return texts[:1]


def _width(texts: Sequence[Sequence[str]]) -> int:
    """Return the width of columns beside each other."""
    return sum(max(map(len, cells)) + 2 for cells in texts) - 2


def _room(texts: Sequence[Sequence[str]]) -> int:
    """Return the width that the columns leave for the widest of them. The first is not narrowed."""
    widest = max((max(map(len, cells)) for cells in texts[1:]), default=0)
    return WIDEST - _width(texts) + widest


def _block_text(texts: Sequence[Sequence[str]]) -> str:
    """Return columns beside each other. A cell too wide for the table has several lines."""
    room = max(_room(texts), NARROWEST)
    others = [
        [wrap(cell, room) if len(cell) > room else [cell] for cell in cells] for cells in texts[1:]
    ]
    parts = [[[cell] for cell in texts[0]], *others]
    cells = chain.from_iterable(zip_longest(*row, fillvalue="") for row in zip(*parts, strict=True))
    columns = [
        [cell.ljust(max(map(len, each))) for cell in each] for each in zip(*cells, strict=True)
    ]
    return "\n".join("  ".join(line).rstrip() for line in zip(*columns, strict=True))


def number(value: float | None, form: str = ".6f") -> str:
    """Return a number as text in the format `form`; None gives an empty string."""
    return "" if value is None else f"{value:{form}}"


def _cell(row: Any, values: Mapping[str, Any], key: str, printed: Column) -> str:
    if not isinstance(printed.form, str):
        return printed.form(row)
    value = values[key]
    if value is None:
        return ""
    if isinstance(value, float):
        from virtual_lab.output.rounding import in_both_units

        return in_both_units(value, printed.unit, printed.form)
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{item:g}" for item in value)
    return str(value)
