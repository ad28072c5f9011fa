"""The chart of the methods that locate a ball: its errors, text and files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.fidelity.charts import require_files
from virtual_lab.fidelity import camera_chart as chart
from virtual_lab.fidelity.camera_estimators import EDGE, ESTIMATORS
from virtual_lab.fidelity.results import SpeedChart

Row = dict[str, Any]
SOME = ("contour moments", "matchTemplate, parabola", EDGE)
LEFT_OUT = ("back light", "hard side light")


@pytest.fixture(scope="module")
def drawn() -> SpeedChart:
    scenes = {
        name: replace(case, phases=2, repeats=3)
        for name, case in chart.SCENES.items()
        if name[1] not in LEFT_OUT
    }
    return chart.camera_chart(scenes=scenes, estimators={name: ESTIMATORS[name] for name in SOME})


@pytest.fixture(scope="module")
def rows(drawn: SpeedChart) -> list[Row]:
    return drawn.rows


def test_the_chart_has_every_estimator_in_every_scene(rows: list[Row]) -> None:
    assert len(rows) == 3 * len(SOME)
    assert all(row["ms_a_frame"] > 0 for row in rows)


def test_the_edge_fit_is_near_the_limit_and_outlines_are_not(rows: list[Row]) -> None:
    """On a plain ball the edge fit is within 3 limits, and contour moments exceed 5 limits."""
    for row in rows:
        if row["ball"] != "plain ball":
            assert row["bias_over_limit"] is None
        elif row["estimator"] == EDGE:
            assert 0.6 < row["rms_px"] / row["limit_px"] < 3
            assert row["bias_over_limit"] < 1
        elif row["estimator"] == "contour moments":
            assert row["rms_px"] > 5 * row["limit_px"]
            assert row["bias_over_limit"] > 5


def test_the_text_and_the_files_have_every_row(drawn: SpeedChart, tmp_path: Path) -> None:
    require_files(drawn, tmp_path / "chart")
