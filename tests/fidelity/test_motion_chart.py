"""The chart of the motion rungs: what planning said of pymunk alone, ours beside it, its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.fidelity.charts import require_files
from virtual_lab.fidelity import motion_chart as chart
from virtual_lab.fidelity.naive_pymunk import missed

Row = dict[str, Any]


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chart, "BATCH", 10)
        patch.setattr(chart, "FEW_SHOTS", 2)
        patch.setattr(chart, "STEPS", (1e-2, 1e-3, 1e-4, 1e-5))
        patch.setattr(chart, "LOSSES", chart.LOSSES[:3])
        return chart.motion_rows()


def of(rows: list[Row], series: str, **own: str) -> list[Row]:
    wanted = {"series": series} | own
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def test_what_planning_reckoned_of_pymunk_alone_is_found_again(rows: list[Row]) -> None:
    """Shares to 0.02; errors to a third, as the starts over which they were taken are ours."""
    planned = [row for row in of(rows, chart.NAIVE) if row["planned"] is not None]
    assert len(planned) == 3 + 2 + 3 + 3
    for row in planned:
        if row["scene"].startswith("missed"):
            assert row["share"] == pytest.approx(row["planned"], abs=0.02)
        elif row["scene"].startswith("energy"):
            assert row["share"] == pytest.approx(row["planned"], rel=0.05)
        elif row["scene"] == chart.ROUND:
            assert row["ball_m_s"] == pytest.approx(row["planned"], rel=1 / 3)
        elif row["planned"] < 1e-9:
            assert row["e_A"] < 1e-14
        else:
            assert row["e_A"] == pytest.approx(row["planned"], rel=1 / 3)


def test_our_rungs_are_exact_or_refuse(rows: list[Row]) -> None:
    for series in (chart.OURS, chart.CLOSED):
        for scene in chart.STARTS:
            for row in of(rows, series, scene=scene):
                if "refused" in row["setting"]:
                    assert row["setting"].startswith("1e-02")
                    continue
                assert row["e_A"] < 1e-12
                assert row["ball_m_s"] < 1e-11
                assert row["bat_rad_s"] < 1e-11
    assert [row["share"] for row in of(rows, chart.OURS) if row["share"] is not None] == [0, 0, 0]
    assert sum("refused" in row["setting"] for row in rows) == 4 + 2 + 1


def test_pymunk_alone_errs_by_its_step(rows: list[Row]) -> None:
    """Order 1 off a round barrel and at the tip; no step mends what its iterations leave."""
    for scene in (chart.ROUND, chart.TIP):
        errors = [row["ball_m_s"] for row in of(rows, chart.NAIVE, scene=scene)][1:]
        orders = -np.diff(np.log10(errors))
        assert orders == pytest.approx(np.ones(2), abs=0.25)
    square = [row["ball_m_s"] for row in of(rows, chart.NAIVE, scene=chart.SQUARE)]
    assert square[0] > 1
    assert max(square[1:]) < 1e-12


@pytest.mark.parametrize(("speed", "step"), [(40.0, 4e-3), (80.0, 1e-3), (100.0, 5e-3)])
def test_the_share_missed_is_what_is_jumped(speed: float, step: float) -> None:
    """1 - (R + r) / (v dt), to one shot in the hundred that are evenly spread."""
    bat = chart.rod()
    reach = bat.radius + bat.ball_radius
    share = missed(bat, speed, step, 100)
    assert share == pytest.approx(max(0.0, 1 - reach / (speed * step)), abs=0.0101)


def test_text_and_files(rows: list[Row], tmp_path: Path) -> None:
    require_files(chart._chart(rows), tmp_path / "chart")
