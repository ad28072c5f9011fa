"""The stored tables of the gallery: models of the whole test, and methods of propagation."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.uncertainty import models
from virtual_lab.simulation.collision.ladder import SHARE
from virtual_lab.uncertainty.propagating import METHODS, propagate_inputs

TABLES = Path(__file__).parents[2] / "virtual_lab" / "docs" / "tables"
PARTS = ("collision", "motion", "gates", "encoder", "camera", "uncertainty")
# parts that do not use the fastest model with an effect below u / 10: a single test films the
# windows that it tracks, because the clip is its record; with few hits the interval by Monte Carlo
# is longer, and that by first order has the stated coverage
DEARER = ("camera", "uncertainty")


def rows_of(name: str) -> list[dict[str, Any]]:
    with (TABLES / name).open(encoding="utf-8", newline="") as table:
        words = ("part", "rung", "model", "method")
        return [
            {key: text if key in words else float(text or "nan") for key, text in row.items()}
            for row in csv.DictReader(table)
        ]


def test_every_part_uses_the_cheapest_sufficient_model_with_named_exceptions() -> None:
    """A model suffices if its effect is below u/10, within two standard errors."""
    rows = rows_of("models.csv")
    assert {row["part"] for row in rows} == set(PARTS)
    for part in PARTS:
        part_rows = [row for row in rows if row["part"] == part]
        assert part_rows[-1]["effect"] == part_rows[-1]["se"] == 0
        (shipped,) = (row for row in part_rows if row["shipped"])
        good = [row for row in part_rows if abs(row["effect"]) < SHARE + 2 * row["se"]]
        cheapest = min(good, key=lambda row: row["ms"])
        assert (shipped is not cheapest) == (part in DEARER), part


def test_more_draws_take_longer_and_reduce_the_error() -> None:
    """With 8 times the draws an error falls by √8, within the scatter of a few seeds."""
    rows = rows_of("methods.csv")
    assert {row["method"] for row in rows} <= set(METHODS)
    for model in {row["model"] for row in rows}:
        part_rows = [row for row in rows if row["model"] == model and row["draws"] > 0]
        assert len(part_rows) > 2
        for few, many in pairwise(part_rows):
            assert many["ms"] > 3 * few["ms"]
            for key in ("u_error", "low_error", "high_error"):
                assert 1.0 < few[key] / many[key] < 8.0, (model, key)


def test_the_table_has_the_errors_of_the_methods() -> None:
    """The first order of squares has a wrong u and a low end below 0, the largest errors."""
    rows = {(row["model"], row["method"]): row for row in rows_of("methods.csv")}
    first_order = propagate_inputs(models.squares, models.SQUARES)
    u = 1.118e-4  # exact u: √(4 x² u² + 4 u⁴), JCGM 101 9.4
    first = rows["JCGM 101 9.4, squares", "first-order"]
    assert first["u_error"] == pytest.approx(1 - first_order.u / u, abs=0.01)
    assert rows["JCGM 101 9.4, squares", "second-order"]["u_error"] < 0.01
    assert first["low_error"] > 0.9
