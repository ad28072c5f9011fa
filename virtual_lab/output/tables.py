"""Rows and numbers as plain text for a terminal: every column with its title and unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

__all__ = ["Column", "number", "quoted", "table_text"]


class Column(NamedTuple):
    """How the values of one key are printed; a function makes the text of its whole row."""

    title: str
    unit: str = ""
    form: str | Callable[[Mapping[str, Any]], str] = ".4g"

    @property
    def head(self) -> str:
        """The title with its unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def table_text(
    rows: Sequence[Mapping[str, Any]],
    columns: Mapping[str, Column] | None = None,
    *,
    across: str = "",
) -> str:
    """Return rows of one shape as a table with a header, columns as wide as they need.

    Parameters
    ----------
    rows
        The values by key.
    columns
        What is printed, in this order, by key; by default every key under its own name.
    across
        The key whose values head the columns of a table turned on its side: few rows of many
        columns. By default the table stands upright.
    """
    if not rows:
        return "nothing"
    columns = columns or {key: Column(key) for key in rows[0]}
    lines = [
        [column.head for column in columns.values()],
        *([_cell(row, key, column) for key, column in columns.items()] for row in rows),
    ]
    if across:
        heads = ["", *(str(row[across]) for row in rows)]
        lines = [heads, *(list(line) for line in zip(*lines, strict=True))]
    widths = [max(len(line[place]) for line in lines) for place in range(len(lines[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def quoted(cell: object) -> str:
    """Return a cell of a table that is sent out: no spreadsheet takes what was typed for a formula.

    What begins with ``= + - @``, a tab or a line's end gets an apostrophe, but for numbers.
    """
    text = str(cell)
    if not text.startswith(("=", "+", "-", "@", "\t", "\r", "\n")):
        return text
    try:
        float(text)
    except ValueError:
        return "'" + text
    return text


def number(value: float | None, form: str = ".6f") -> str:
    return "" if value is None else f"{value:{form}}"


def _cell(row: Mapping[str, Any], key: str, column: Column) -> str:
    if not isinstance(column.form, str):
        return column.form(row)
    value = row[key]
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:{column.form}}"
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{item:g}" for item in value)
    return str(value)
