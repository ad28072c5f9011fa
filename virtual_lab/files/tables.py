"""Tables as CSV files that spreadsheets read without change."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import pandas as pd


def quote(cell: object) -> str:
    """Return a table cell as text that no spreadsheet interprets as a formula.

    If the text begins with ``= + - @``, a tab or a line end, an apostrophe is added before it.
    Numbers, and strings that state a number, such as ``-1.5``, are not changed.
    """
    text = str(cell)
    if not text.startswith(("=", "+", "-", "@", "\t", "\r", "\n")):
        return text
    try:
        float(text)
    except ValueError:
        return "'" + text
    return text


def write_csv(columns: pd.DataFrame | Mapping[str, ArrayLike], path: Path) -> None:
    """Write a table into a CSV file, as `csv_text` formats it. An existing file is replaced."""
    path.write_text(csv_text(columns), encoding="utf-8", newline="")


def csv_text(columns: pd.DataFrame | Mapping[str, ArrayLike]) -> str:
    """Return a table as CSV text with a header.

    `columns` are keyed by name. A string that a spreadsheet would interpret as a formula gets an
    apostrophe before it. A missing value, None or NaN, gives an empty cell. Numbers are not
    rounded. Raises `ValueError` for columns of different lengths.
    """
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([quote(name) for name, _ in columns.items()])
    rows.writerows(zip(*(_cells(values) for _, values in columns.items()), strict=True))
    return text.getvalue()


def _cells(values: ArrayLike) -> list[object]:
    """Return the values of a column, strings quoted, missing values as None."""
    cells: list[object] = np.asarray(values).tolist()
    return [
        quote(cell) if isinstance(cell, str) else None if cell != cell else cell  # noqa: PLR0124
        for cell in cells
    ]
