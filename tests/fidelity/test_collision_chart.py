"""The chart of the collision rungs: the order of its points, and its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.fidelity.charts import require_files
from virtual_lab.fidelity import collision_chart


@pytest.fixture(scope="module")
def rows() -> list[dict[str, object]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collision_chart, "BATCH", 40)
        patch.setattr(collision_chart, "REPEATS", 1)
        patch.setattr(collision_chart, "PLACES_IN", (3.5, 6.5))
        patch.setattr(collision_chart, "SPEEDS_MPH", (60.0,))
        return collision_chart.measure()


def test_more_modes_and_smaller_steps_err_less(rows: list[dict[str, object]]) -> None:
    """Errors only: times are for the reader, never for a test."""
    for series in (collision_chart.MODES, collision_chart.STEPS):
        errors = np.array([float(str(r["worst_error"])) for r in rows if r["series"] == series])
        assert errors[-1] < errors[0] / 50
        assert (np.diff(errors) < 0).all()


def test_a_surrogate_keeps_its_tolerance(rows: list[dict[str, object]]) -> None:
    errors = [
        float(str(r["worst_error"])) for r in rows if r["series"] == collision_chart.SURROGATE
    ]
    for error, tolerance in zip(errors, collision_chart.TOLERANCES, strict=True):
        assert error <= 2 * tolerance


def test_scipy_is_held_against_the_same_modes(rows: list[dict[str, object]]) -> None:
    own = [float(str(r["worst_error"])) for r in rows if r["series"] == collision_chart.SCIPY]
    assert max(own) < 5e-3
    assert min(own) < 1e-6


def test_files(rows: list[dict[str, object]], tmp_path: Path) -> None:
    page = require_files(collision_chart, "collision", rows, tmp_path / "chart")
    assert page.count("<svg") == 1
    assert "http" not in page.replace("http://www.w3.org", "").split("</metadata>")[-1]
