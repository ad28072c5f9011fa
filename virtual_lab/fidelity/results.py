"""Results of the studies of models: charts of accuracy against run time, and stability maps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

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
}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SpeedChart(StudyResult):
    """Error and run time of each model, one row per model and setting, with a figure."""

    name: str
    title: str
    rows: list[Row]
    figure: Callable[[list[Row], str], PageFigure]  # function of rows and title

    @property
    def text(self) -> str:
        """Table of the rows; missing values are blank."""
        columns = {key: COLUMNS.get(key, Column(key.replace("_", " "))) for key in self.rows[0]}
        return table_text(self.rows, columns)

    def draw(self) -> PageFigure:
        """Draw the chart."""
        return self.figure(self.rows, self.title)


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
