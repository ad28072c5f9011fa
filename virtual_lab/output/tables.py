"""Rows and numbers as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["number", "table_text"]


def table_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows of one shape as a table with a header, columns as wide as they need."""
    if not rows:
        return "nothing"
    cells = [[_cell(value) for value in row.values()] for row in rows]
    lines = [list(rows[0]), *cells]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def number(value: float | None, form: str = ".6f") -> str:
    return "" if value is None else f"{value:{form}}"


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{item:g}" for item in value)
    return str(value)
