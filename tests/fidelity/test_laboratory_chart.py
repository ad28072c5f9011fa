"""The chart of the whole test: its stored table, its picture, and the reasons for each choice."""

from __future__ import annotations

from pathlib import Path

from tests.fidelity.charts import require_files
from virtual_lab import api
from virtual_lab.fidelity.laboratory_chart import EXPLAINED
from virtual_lab.simulation.collision.ladder import SHARE

PARTS = ("collision", "motion", "gates", "encoder", "camera", "uncertainty")


def test_every_part_uses_the_cheapest_sufficient_model_or_states_a_reason(tmp_path: Path) -> None:
    """A model suffices if its effect is below u/10, within two standard errors."""
    chart = api.chart("laboratory")
    assert {row["part"] for row in chart.rows} == set(PARTS)
    for part in PARTS:
        part_rows = [row for row in chart.rows if row["part"] == part]
        assert part_rows[-1]["effect"] == part_rows[-1]["se"] == 0
        (shipped,) = (row for row in part_rows if row["shipped"])
        good = [row for row in part_rows if abs(row["effect"]) < SHARE + 2 * row["se"]]
        cheapest = min(good, key=lambda row: row["ms"])
        assert (shipped is not cheapest) == (part in EXPLAINED), part
    require_files(chart, tmp_path / "chart")
