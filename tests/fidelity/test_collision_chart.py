"""The chart of the collision models: the order of its points, failures and picture."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.fidelity.charts import require_files
from virtual_lab.errors import InputError
from virtual_lab.fidelity import collision_chart as chart
from virtual_lab.fidelity.collision_chart import Question, Series, draw_collision
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.units import INCH

SHIPPED = Path(__file__).parents[2] / "data" / "figures" / "collision.csv"
Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def drawn() -> SpeedChart:
    """Return the chart, with each point computed once, because no test reads a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chart, "least_time", lambda work: (work(), 1.0))
        return chart.collision_chart(
            extent=chart.Extent(mode_counts=(4, 10, 20, 40), scenes=24, few=4, fewest=1, batch=40)
        )


@pytest.fixture(scope="module")
def rows(drawn: SpeedChart) -> Rows:
    return drawn.rows


def of(rows: Rows, series: str) -> Rows:
    return [row for row in rows if row["series"] == series]


def test_more_modes_and_smaller_steps_reduce_the_error(rows: Rows) -> None:
    """Only errors are tested; times are for the reader."""
    for series in (Series.MODES, Series.STEPS):
        errors = np.array([row["worst_error"] for row in of(rows, series)])
        assert errors[-1] < errors[0] / 50
        assert (np.diff(errors) < 0).all()


def test_each_question_has_a_reference_of_its_own(rows: Rows) -> None:
    """The error of all equations is against more modes, that of a solver against the same modes."""
    references = {series: {row["held_against"] for row in of(rows, series)} for series in Series}
    solving = {Series.STEPS, Series.SCIPY}
    assert references == {
        one: {Question.SOLVING if one in solving else Question.IN_ALL} for one in references
    }
    (reference,) = of(rows, Series.REFERENCE)
    assert 1e-7 < reference["worst_error"] < 2e-5
    assert min(row["worst_error"] for row in of(rows, Series.SCIPY)) < 1e-6
    assert max(row["worst_error"] for row in of(rows, Series.SCIPY)) < 5e-3


def test_the_error_of_a_surrogate_is_that_of_its_modes_within_its_tolerance(rows: Rows) -> None:
    default = next(row for row in of(rows, Series.MODES) if row["setting"] == "20 modes")
    for row, tolerance in zip(of(rows, Series.SURROGATE), (1e-3, 1e-4, 1e-5), strict=True):
        assert abs(row["worst_error"] - default["worst_error"]) <= 2 * tolerance


def test_failures_are_counted_along_the_whole_bat(rows: Rows) -> None:
    whole = chart._scenes(chart.WHOLE_IN, 24).impact_position / INCH
    outside = np.mean((whole < 1.5) | (whole > 12.5))
    assert 0.4 < outside < 0.9
    assert {row["refused_along_the_bat"] for row in of(rows, Series.SURROGATE)} == {outside}
    assert of(rows, Series.RIGID)[0]["off_along_the_bat"] > 0.8
    few, *_, many = of(rows, Series.MODES)
    assert few["off_along_the_bat"] > 0.3
    assert many["off_along_the_bat"] == many["refused_along_the_bat"] == 0


def test_errors_and_refusals_are_counted_separately(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far from the barrel the error is just above or just below the u of a certificate."""

    def poor(scenes: Scenes) -> np.ndarray:
        z = scenes.impact_position / INCH
        if np.any(z > 30):
            raise InputError("poor", "z", float(z.max()), "allowed: up to 30 in")
        return np.where(z > 25, 0.00201, np.where(z > 20, 0.00199, 1e-5))

    def exact(ends_in: tuple[float, float], count: int) -> np.ndarray:
        return np.zeros(count)

    point = chart.Point(
        panel=Question.IN_ALL,
        series=Series.RIGID,
        setting="y",
        efficiency=poor,
        exact=exact,
        scenes=400,
    )
    monkeypatch.setattr(chart, "_points", lambda body, extent: iter([point]))
    (row,) = chart.collision_chart().rows
    whole = chart._scenes(chart.WHOLE_IN, 400).impact_position / INCH
    assert row["refused_along_the_bat"] == np.mean(whole > 30) > 0
    assert row["off_along_the_bat"] == np.mean((whole > 25) & (whole <= 30)) > 0
    assert row["worst_error"] == pytest.approx(1e-5)


def test_the_labels_of_the_picture_do_not_overlap() -> None:
    """The picture has the rows of the README, and marks the limit u/10."""
    rows = pd.read_csv(SHIPPED).to_dict("records")
    figure: Any = draw_collision(rows, "Collision")  # type: ignore[arg-type]
    renderer = figure.canvas.get_renderer()
    assert len(figure.axes) == 2
    for axes in figure.axes:
        assert {2e-4} in [
            set(line.get_ydata()) for line in axes.lines if len(line.get_xdata()) == 2
        ]
        boxes = {one.get_text(): one.get_window_extent(renderer) for one in axes.texts}
        assert any("u / 10" in words for words in boxes)
        for (one, box), (other, another) in combinations(boxes.items(), 2):
            assert not box.overlaps(another), (one, other)
        panel = axes.get_window_extent(renderer)
        assert all(panel.contains(*end) for box in boxes.values() for end in box.get_points())
    settings = [one.get_text() for axes in figure.axes for one in axes.texts]
    assert set(settings) >= {row["setting"] for row in rows}


def test_the_chart_writes_its_files(drawn: SpeedChart, tmp_path: Path) -> None:
    require_files(drawn, tmp_path / "chart")
