"""Results of the studies of models: charts of accuracy against run time, and stability maps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from virtual_lab.files.tables import write_csv
from virtual_lab.output.chart_page import chart_page
from virtual_lab.output.result import StudyResult
from virtual_lab.output.tables import Column, table_text

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]
T = TypeVar("T")
COLUMNS = {  # columns of all charts by key; any other column is titled by its key
    "series": Column("model"),
    "held_against": Column("reference"),
    "estimator": Column("method"),
    "worst_error": Column("largest error of e_A", form=".1e"),
    "rms_error": Column("rms error", form=".1e"),
    "us_a_shot": Column("time per shot", "µs", ".2g"),
    "off_along_the_bat": Column("share with an error above u, whole bat", form=".0%"),
    "refused_along_the_bat": Column("share refused, whole bat", form=".0%"),
    "e_A": Column("rms error of e_A", form=".1e"),
    "ball_m_s": Column("rms error of the ball's velocity", "m/s", ".1e"),
    "bat_rad_s": Column("rms error of the bat's rate", "rad/s", ".1e"),
    "rms_px": Column("rms error", "px", ".2g"),
    "limit_px": Column("smallest possible error", "px", ".2g"),
    "bias_over_limit": Column("largest bias / smallest possible error", form=".2g"),
    "ms_a_frame": Column("time per frame", "ms", ".2g"),
    "lost": Column("share not found", form=".0%"),
    "flagged": Column("share flagged", form=".0%"),
    "wrong_unsaid": Column("share wrong without a flag", form=".0%"),
    "rung": Column("model"),
    "shipped": Column("used in studies", form=lambda row: "yes" if row["shipped"] else "no"),
    "effect": Column("effect on the metric", "u", ".3g"),
    "se": Column("standard error of the effect", "u", ".2g"),
    "rms": Column("rms effect", "u", ".3g"),
    "ms": Column("time, one core", "ms", ".3g"),
    "draws": Column("number of draws"),
    "u_error": Column("error of u", "u", ".1e"),
    "low_error": Column("error of the lower end", "u", ".1e"),
    "high_error": Column("error of the upper end", "u", ".1e"),
}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SpeedChart(StudyResult):
    """Error and run time of each model, one row per model and setting, with a figure and a page."""

    name: str
    title: str
    words: str  # description of the figure on the page
    rows: list[Row]
    figure: Callable[[list[Row], str], PageFigure]  # function of rows and title

    @property
    def text(self) -> str:
        """Table of the rows; missing values are blank."""
        return table_text(self.rows, self._columns)

    @property
    def _columns(self) -> dict[str, Column]:
        """The columns of the rows by key."""
        return {key: COLUMNS.get(key, Column(key.replace("_", " "))) for key in self.rows[0]}

    def draw(self) -> PageFigure:
        """Draw the chart."""
        return self.figure(self.rows, self.title)

    def fill(self, folder: Path) -> None:
        """Write the rows as CSV, the figure as PNG, and a page with both as HTML."""
        figure = self.figure(self.rows, self.title)
        write_csv(self.table, folder / f"{self.name}.csv")
        figure.savefig(folder / f"{self.name}.png")
        heads = {key: each.head for key, each in self._columns.items()}
        rows = [{heads[key]: _in_words(value) for key, value in row.items()} for row in self.rows]
        page = chart_page(self.title, self.words, figure, rows)
        (folder / f"{self.name}.html").write_text(page, encoding="utf-8")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StabilityMap(StudyResult):
    """Maps of the conditions under which a numerical method is accurate, one row per cell."""

    title: str
    text: str
    rows: list[Row]
    picture: Callable[[list[Row]], PageFigure]
    name: str = "stability"

    def draw(self) -> PageFigure:
        """Draw the maps."""
        return self.picture(self.rows)


def _in_words(value: Any) -> Any:
    """Return "yes" or "no" for a boolean, and any other value unchanged."""
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else value


def least_time(work: Callable[[], T]) -> tuple[T, float]:
    """Return the result of `work`, and the shortest processor time of its runs [s].

    `work` is run one to five times. It is not run again after the runs have taken half a second in
    total.
    """
    times: list[float] = []
    while not times or (len(times) < 5 and sum(times) < 0.5):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
    return result, min(times)
