"""The stored table of planned and simulated u, and a row of it made again."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tests.studies.plan import CASES, PLANS, rows_of

(STORED,) = Path(__file__).parent.glob("plan-*.csv")
ROWS = list(csv.DictReader(STORED.read_text(encoding="utf-8").splitlines()))


def test_planned_u_is_within_five_per_cent_of_simulated_u():
    assert [(row["procedure"], row["bat"]) for row in ROWS[::PLANS]] == list(CASES)
    ratios = np.array([float(row["simulated_u"]) / float(row["planned_u"]) for row in ROWS])
    assert ratios.size == 20
    assert np.sum((ratios >= 0.95) & (ratios <= 1.05)) >= 18
    assert {int(row["tests"]) for row in ROWS} == {5000}


def test_first_row_is_that_of_the_program():
    (stored, other), tests = ROWS[:PLANS], 500
    first, second = rows_of(*CASES[0], tests, np.random.default_rng(11))
    for key in ("exchanged", "hits", "balls", "wall_hits"):
        assert str(first[key]) == stored[key]
        assert str(second[key]) == other[key]
    planned = float(str(first["planned_u"]))
    assert planned == pytest.approx(float(stored["planned_u"]), rel=1e-4)
    error = float(str(first["simulated_u_se"]))
    assert float(str(first["simulated_u"])) == pytest.approx(
        float(stored["simulated_u"]), abs=4 * error
    )
