"""The chart of methods to propagate uncertainty: its stored table and its picture."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from tests.fidelity.charts import require_files
from tests.uncertainty import models
from virtual_lab import api
from virtual_lab.errors import InputError
from virtual_lab.fidelity.uncertainty_chart import MARKERS, PANELS
from virtual_lab.uncertainty.propagating import propagate_inputs


def test_more_draws_take_longer_and_reduce_the_error(tmp_path: Path) -> None:
    """With 8 times the draws an error falls by √8, within the scatter of a few seeds."""
    chart = api.chart("uncertainty")
    assert {row["method"] for row in chart.rows} == set(MARKERS)
    for model in {row["model"] for row in chart.rows}:
        part_rows = [row for row in chart.rows if row["model"] == model and row["draws"]]
        for few, many in pairwise(part_rows):
            assert many["ms"] > 3 * few["ms"]
            for key in PANELS:
                assert 1.0 < few[key] / many[key] < 8.0, (model, key)
    require_files(chart, tmp_path / "chart")


def test_the_table_has_the_errors_of_the_methods() -> None:
    """The first order of squares has a wrong u and a low end below 0, the largest errors."""
    rows = {(row["model"], row["method"]): row for row in api.chart("uncertainty").rows}
    first_order = propagate_inputs(models.squares, models.SQUARES)
    u = 1.118e-4  # exact u: √(4 x² u² + 4 u⁴), JCGM 101 9.4
    first = rows["JCGM 101 9.4, squares", "first-order"]
    assert first["u_error"] == pytest.approx(1 - first_order.u / u, abs=0.01)
    assert rows["JCGM 101 9.4, squares", "second-order"]["u_error"] < 0.01
    assert first["low_error"] > 0.9


def test_uncertainty_has_no_map() -> None:
    with pytest.raises(InputError, match=r"allowed: collision or camera$"):
        api.stability("uncertainty")
