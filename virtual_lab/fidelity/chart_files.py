"""What every chart of speed against accuracy hands out: its files, and its table as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.files import new_folder
from virtual_lab.output.chart_page import chart_page
from virtual_lab.output.tables import Column, table_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["chart_text", "save_chart"]

Rows = Sequence[Mapping[str, Any]]
COLUMNS = {  # of all charts, by key; one that is not here stands under its own name
    "series": Column("model"),
    "held_against": Column("held against"),
    "estimator": Column("way of locating"),
    "worst_error": Column("worst error in e_A", form=".1e"),
    "rms_error": Column("rms error", form=".1e"),
    "us_a_shot": Column("time per shot", "µs", ".2g"),
    "off_along_the_bat": Column("off along the bat", form=".0%"),
    "refused_along_the_bat": Column("refused there", form=".0%"),
    "e_A": Column("rms error in e_A", form=".1e"),
    "ball_m_s": Column("of the ball's velocity", "m/s", ".1e"),
    "bat_rad_s": Column("of the bat's rate", "rad/s", ".1e"),
    "share": Column("missed or lost", form=".1%"),
    "planned": Column("planned"),
    "rms_px": Column("rms error", "px", ".2g"),
    "limit_px": Column("least scatter possible", "px", ".2g"),
    "bias_over_limit": Column("bias over that", form=".2g"),
    "ms_a_frame": Column("time per frame", "ms", ".2g"),
    "lost": Column("not found", form=".0%"),
    "flagged": Column("flagged", form=".0%"),
    "wrong_unsaid": Column("wrong without a flag", form=".0%"),
}


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
    return table_text(rows, {key: COLUMNS.get(key, Column(key)) for key in rows[0]})
