"""The study of faults: its table, reduced, and how a prediction is judged."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet, Prediction
from virtual_lab.errors import InputError
from virtual_lab.studies.faults import PROCEDURES, Bias, faults

FEW = ("gate-moved", "wrong-lot", "encoder-slip", "ball-out-of-round")
LABORATORIES = 4
TABLE = Path(__file__).with_name("faults-2026-11-22.csv")


def test_a_few_faults_come_out_as_predicted(tmp_path: Path) -> None:
    """The reduced form of ``virtual-lab faults`` (60 laboratories a fault, table beside this).

    Caught is caught in all 4; the biases lie within three standard uncertainties of those
    predicted; no sound day is flagged, which 1 % a day leaves 94 % likely.
    """
    rows = faults(FEW, procedures=("astm-f1881",), laboratories=LABORATORIES, seed=600)
    assert [row.fault for row in rows] == ["none", *FEW]
    for row in rows:
        print(row)
        assert row.as_predicted, row.fault
        assert 0 <= row.low <= row.caught <= row.high <= 1
    assert rows[0].caught == 0
    assert rows[3].by.startswith(f"encoder-fit {LABORATORIES}")
    assert rows[1].e_A.bias == pytest.approx(-0.0040, abs=0.0002)
    rows.save(tmp_path / "new")
    assert (tmp_path / "new" / "faults.csv").read_text().count("\n") == len(rows) + 1


def _number(text: str) -> float | None:
    return float(text) if text else None


def test_the_table_on_file_is_of_this_catalog() -> None:
    """Every fault and procedure with a prediction, the numbers predicted being those of the data.

    Each is caught in 95 % of the laboratories, or leaves the bias predicted within three standard
    uncertainties; a sound day is flagged no oftener than 1 % allows.
    """
    with TABLE.open(encoding="utf-8") as file:
        rows = {(row["procedure"], row["fault"]): row for row in csv.DictReader(file)}
    predictions = {
        (each.procedure, name): each
        for name in catalog.names("faults")
        for each in catalog.load("faults", name, FaultSheet).spec.predictions
    }
    sound = {(procedure, "none") for procedure in PROCEDURES}
    assert rows.keys() == predictions.keys() | sound
    for key in sound:
        assert float(rows[key]["low"]) <= 0.01
    for key, prediction in predictions.items():
        row = rows[key]
        assert row["prediction"] == (prediction.caught_by or "a bias"), key
        assert _number(row["e_A_predicted"]) == prediction.efficiency_bias, key
        assert _number(row["metric_predicted"]) == prediction.metric_bias, key
        known = [_number(row[f"{what}_z"]) for what in ("e_A", "metric")]
        met = all(z is not None and abs(z) <= 3 for z in known)
        assert float(row["caught"]) >= 0.95 or met, key
        assert row["as_predicted"] == "True", key


def test_a_wrong_prediction_shows() -> None:
    """A bias ten Monte Carlo errors from the predicted one, and one that is met."""
    differences = np.array([0.9, 1.1] * 50)  # 1 ± 0.1005/10
    error = float(differences.std(ddof=1)) / 10
    assert Bias.of(differences, 1.0, 0.0).z == pytest.approx(0.0, abs=1e-9)
    assert Bias.of(differences, 1 - 10 * error, 0.0).z == pytest.approx(10.0)


def test_a_prediction_is_one_of_two_kinds() -> None:
    with pytest.raises(ValueError, match="leaves no bias"):
        Prediction(procedure="bbcor", caught_by="aim", metric_bias=0.1)
    with pytest.raises(ValueError, match="needs caught_by"):
        Prediction(procedure="bbcor", metric_bias=0.1, metric_bias_u=0.1)


def test_bad_words() -> None:
    with pytest.raises(InputError, match="2 and more"):
        faults(laboratories=1)
    with pytest.raises(InputError, match="did you mean gate-moved"):
        faults(("gate-move",), laboratories=2)
