"""Columns of numbers from CSV files that people write or correct by hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd


def numbers_in(
    table: pd.DataFrame, name: str, path: Path, most: float, otherwise: float | None = None
) -> Array:
    """Return the numbers in the column `name` of a table, (row,).

    An empty cell becomes `otherwise`. If the column is missing, every number is `otherwise`. `path`
    only appears in error messages.

    Raises
    ------
    InputError
        A cell is not a number, or its absolute value is above `most`. The column is missing or a
        cell is empty, and `otherwise` is None. The message has the row of the cell. The header is
        row 1, and empty rows are not counted.
    """
    import pandas as pd

    if name not in table:
        if otherwise is None:
            raise InputError(str(path), "columns", ", ".join(map(str, table)), f"needs {name!r}")
        return np.full(len(table), otherwise)
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
    empty = table[name].isna().to_numpy() if otherwise is not None else np.zeros(len(table), bool)
    if (bad := np.flatnonzero(~(np.abs(values) <= most) & ~empty)).size:
        value, allowed = table[name].iloc[bad[0]], f"expected a number, up to {most:g}"
        raise InputError(str(path), f"row {table.index[bad[0]] + 2}: {name}", str(value), allowed)
    return np.where(empty, np.nan if otherwise is None else otherwise, values)
