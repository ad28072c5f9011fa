"""The chart of the models of the motion, and its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.fidelity.charts import require_files
from virtual_lab.fidelity import motion_chart as chart
from virtual_lab.fidelity.results import SpeedChart

Row = dict[str, Any]


@pytest.fixture(scope="module")
def drawn() -> SpeedChart:
    """Return the chart, with each point played once, because no test reads a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chart, "least_time", lambda work: (work(), 1.0))
        return chart.motion_chart(steps=(1e-2, 1e-3, 1e-4, 1e-5), batch=10)


@pytest.fixture(scope="module")
def rows(drawn: SpeedChart) -> list[Row]:
    return drawn.rows


def of(rows: list[Row], series: str, **conditions: str) -> list[Row]:
    wanted = {"series": series} | conditions
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def test_our_models_are_exact_or_refuse(rows: list[Row]) -> None:
    for series in chart.Carrier:
        for scene in chart.STARTS:
            for row in of(rows, series, scene=scene):
                if "refused" in row["setting"]:
                    assert row["setting"].startswith("1e-02")
                    continue
                assert row["e_A"] < 1e-12
                assert row["ball_m_s"] < 1e-11
                assert row["bat_rad_s"] < 1e-11
    assert sum("refused" in row["setting"] for row in rows) == len(chart.STARTS)


def test_the_text_and_the_files_have_every_row(drawn: SpeedChart, tmp_path: Path) -> None:
    require_files(drawn, tmp_path / "chart")
