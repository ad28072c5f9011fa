"""The chart of the models of the motion: plain pymunk beside our models, and its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.fidelity.charts import require_files
from virtual_lab.fidelity import motion_chart as chart
from virtual_lab.fidelity.naive_pymunk import missed_share, rod
from virtual_lab.fidelity.results import SpeedChart

Row = dict[str, Any]


@pytest.fixture(scope="module")
def drawn() -> SpeedChart:
    """Return the chart, with each point played once, because no test reads a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chart, "least_time", lambda work: (work(), 1.0))
        return chart.motion_chart(
            steps=(1e-2, 1e-3, 1e-4, 1e-5), losses=(1e-2, 1e-3, 1e-4), batch=10
        )


@pytest.fixture(scope="module")
def rows(drawn: SpeedChart) -> list[Row]:
    return drawn.rows


def of(rows: list[Row], series: str, **conditions: str) -> list[Row]:
    wanted = {"series": series} | conditions
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def test_plain_pymunk_misses_and_loses_the_measured_shares(rows: list[Row]) -> None:
    """The shares were measured on pymunk before our models were written."""
    misses = {("26.8", "1e-02"): 0.74, ("62.6", "2e-03"): 0.45, ("62.6", "1e-03"): 0.0}
    losses = {"1e-02": 0.41, "1e-03": 0.07, "1e-04": 0.0075}
    shares = [row for row in of(rows, chart.Carrier.ALONE) if row["share"] is not None]
    assert len(shares) == len(misses) + len(losses)
    for row in shares:
        step = row["setting"].split()[0]
        if row["scene"].startswith("missed"):
            assert row["share"] == pytest.approx(misses[row["scene"].split()[2], step], abs=0.02)
        else:
            assert row["share"] == pytest.approx(losses[step], rel=0.05)


def test_our_models_are_exact_or_refuse(rows: list[Row]) -> None:
    for series in (chart.Carrier.OURS, chart.Carrier.CLOSED):
        for scene in chart.STARTS:
            for row in of(rows, series, scene=scene):
                if "refused" in row["setting"]:
                    assert row["setting"].startswith("1e-02")
                    continue
                assert row["e_A"] < 1e-12
                assert row["ball_m_s"] < 1e-11
                assert row["bat_rad_s"] < 1e-11
    assert [row["share"] for row in of(rows, chart.Carrier.OURS) if row["share"] is not None] == [
        0,
        0,
        0,
    ]
    assert sum("refused" in row["setting"] for row in rows) == 4 + 2 + 1


def test_the_error_of_plain_pymunk_is_proportional_to_its_step(rows: list[Row]) -> None:
    """The order is 1 on a round barrel and at the tip."""
    for scene in (chart.Start.ROUND, chart.Start.TIP):
        errors = [row["ball_m_s"] for row in of(rows, chart.Carrier.ALONE, scene=scene)][1:]
        orders = -np.diff(np.log10(errors))
        assert orders == pytest.approx(np.ones(2), abs=0.25)
    square = [row["ball_m_s"] for row in of(rows, chart.Carrier.ALONE, scene=chart.Start.SQUARE)]
    assert square[0] > 1
    assert max(square[1:]) < 1e-12


@pytest.mark.parametrize(("speed", "step"), [(40.0, 4e-3), (80.0, 1e-3), (100.0, 5e-3)])
def test_the_share_of_missed_balls_follows_from_the_length_of_a_step(
    speed: float, step: float
) -> None:
    """1 - (R + r) / (v dt), to one of a hundred evenly spaced shots."""
    share = missed_share(rod(), speed, step, 100)
    assert share == pytest.approx(max(0.0, 1 - rod().contact_distance / (speed * step)), abs=0.0101)


def test_the_text_and_the_files_have_every_row(drawn: SpeedChart, tmp_path: Path) -> None:
    require_files(drawn, tmp_path / "chart")
