"""What every chart of speed against accuracy hands out: its files, and its table as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.files import new_folder
from virtual_lab.output.chart_page import chart_page
from virtual_lab.output.tables import table_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["chart_text", "save_chart"]

Rows = Sequence[Mapping[str, Any]]


def save_chart(
    name: str, rows: Rows, folder: Path, *, title: str, words: str, figure: Figure
) -> None:
    """Write rows and what was drawn of them as CSV, PNG and an HTML page into a new folder."""
    import pandas as pd

    with new_folder(folder) as draft:
        pd.DataFrame(rows).to_csv(draft / f"{name}.csv", index=False)
        figure.savefig(draft / f"{name}.png")
        page = chart_page(title, words, figure, rows)
        (draft / f"{name}.html").write_text(page, encoding="utf-8")


def chart_text(rows: Rows) -> str:
    """Return the rows as a table for a terminal, blank where there is none."""
    return table_text([{k: "" if v is None else v for k, v in row.items()} for row in rows])
