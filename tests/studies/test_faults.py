"""The study of faults: a short version of its table, and the judgment of a prediction."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import virtual_lab as vl
from tests.pictures import lines_of
from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet, Prediction
from virtual_lab.errors import InputError
from virtual_lab.studies import faults as study
from virtual_lab.studies.faults import PROCEDURES, Bias, FaultOutcome, faults

FEW = ("gate-moved", "wrong-lot", "encoder-slip", "ball-out-of-round")
LABORATORIES = 4
TABLE = Path(__file__).with_name("faults-2026-11-28.csv")


def test_a_few_faults_come_out_as_predicted(tmp_path: Path) -> None:
    """A short version of ``virtual-lab faults`` (60 laboratories per fault, table beside this).

    A fault that should be caught is caught in all 4; biases lie within three u of the
    predicted ones; no sound day is flagged (probability 94 % at 1 % per day).
    """
    rows = faults(FEW, procedures=("astm-f1881",), laboratories=LABORATORIES, seed=600)
    assert [row.fault for row in rows] == ["none", *FEW]
    for row in rows:
        print(row)
        assert row.as_predicted, row.fault
        assert 0 <= row.detected_low <= row.detected <= row.detected_high <= 1
    assert rows[0].detected == 0
    assert rows[3].detected_by.startswith(f"encoder-fit {LABORATORIES}")
    assert rows[1].collision_efficiency.bias == pytest.approx(-0.0040, abs=0.0002)
    ends = [(row.detected_low, row.detected, row.detected_high) for row in rows]
    assert lines_of(rows.plot()) == ends
    rows.save(tmp_path / "new")
    assert (tmp_path / "new" / "faults.csv").read_text().count("\n") == len(rows) + 1


def _number(text: str) -> float | None:
    return float(text) if text else None


def test_the_table_on_file_is_of_this_catalog() -> None:
    """The table has every fault and procedure with a prediction, and the predicted numbers.

    Each is caught in 95 % of the laboratories, or has the predicted bias within three standard
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
        assert float(rows[key]["detected_low"]) <= 0.01
    for key, prediction in predictions.items():
        row = rows[key]
        assert row["prediction"] == (prediction.caught_by or "a bias"), key
        assert _number(row["collision_efficiency_predicted"]) == prediction.efficiency_bias, key
        assert _number(row["metric_predicted"]) == prediction.metric_bias, key
        known = [_number(row[f"{what}_z"]) for what in ("collision_efficiency", "metric")]
        met = all(z is not None and abs(z) <= 3 for z in known)
        assert float(row["detected"]) >= 0.95 or met, key
        assert row["as_predicted"] == "True", key


def test_a_wrong_prediction_shows() -> None:
    """One bias is ten Monte Carlo errors from its prediction, another one agrees."""
    differences = np.array([0.9, 1.1] * 50)  # 1 ± 0.1005/10
    error = float(differences.std(ddof=1)) / 10
    assert Bias.of(differences, 1.0, 0.0).z == pytest.approx(0.0, abs=1e-9)
    assert Bias.of(differences, 1 - 10 * error, 0.0).z == pytest.approx(10.0)


def test_z_is_over_the_errors_of_the_mean_and_of_the_prediction() -> None:
    """Mean 1 ± .05 of (.95, 1.05), prediction .87 ± .12: .13 over √(.05² + .12²) = .13."""
    found = Bias.of(np.array([0.95, 1.05]), 0.87, 0.12)
    assert (found.bias, found.bias_se) == (pytest.approx(1), pytest.approx(0.05))
    assert found.z == pytest.approx(1)


def outcome(
    catches: list[tuple[str, ...]], prediction: Prediction | None, off: float = 0.0
) -> FaultOutcome:
    """Return the outcome in laboratories with these flags; e_A and metric differ by `off`."""
    seen, sound = (
        [
            study._Detection(each, 0.25 + by + 1e-3 * (i % 2), 0.9 + by)
            for i, each in enumerate(catches)
        ]
        for by in (off, 0.0)
    )
    return study._row("a fault", "bbcor", prediction, seen, sound)


@pytest.mark.parametrize(("caught", "right"), [(19, True), (18, False)])
def test_a_fault_is_detected_if_flagged_in_19_of_20_days(caught: int, right: bool) -> None:
    """A flag that was not predicted counts as seen, but not as caught.

    19 of 20: .7513 to .9987 by the tables of exact binomial limits.
    """
    prediction = Prediction(procedure="bbcor", caught_by="encoder-fit, INVALID")
    named = [("INVALID",), *[("aim", "encoder-fit")] * (caught - 1), *[("aim",)] * (19 - caught)]
    found = outcome([*named, ()], prediction)
    assert (found.as_predicted, found.detected) == (right, 0.95)
    assert (found.detected_low, found.detected_high) == (
        pytest.approx(0.7513, abs=5e-5),
        pytest.approx(0.9987, abs=5e-5),
    )
    assert found.detected_by.split(", ")[0] == f"aim {18}"


@pytest.mark.parametrize(("flagged", "right"), [(2, True), (3, False)])
def test_a_sound_day_is_flagged_no_oftener_than_one_percent_allows(
    flagged: int, right: bool
) -> None:
    """Of 60 days: P(2 or more | 1 %) = .121, P(3 or more | 1 %) = .0224 < .025."""
    assert outcome([("aim",)] * flagged + [()] * (60 - flagged), None).as_predicted == right


@pytest.mark.parametrize(("off", "right"), [(0.0029, True), (0.0031, False), (-0.0029, False)])
def test_a_bias_is_met_within_three_standard_uncertainties(off: float, right: bool) -> None:
    """The prediction is 0 ± .001; every laboratory has the same error."""
    known = {"efficiency_bias_u": 0.001, "metric_bias_u": 0.001}
    prediction = Prediction(
        procedure="bbcor", efficiency_bias=0.0, metric_bias=0.0 if off > 0 else 0.001, **known
    )
    assert outcome([()] * 4, prediction, off).as_predicted == right


def test_a_prediction_is_one_of_two_kinds() -> None:
    with pytest.raises(ValueError, match="leaves no bias"):
        Prediction(procedure="bbcor", caught_by="aim", metric_bias=0.1)
    with pytest.raises(ValueError, match="needs caught_by"):
        Prediction(procedure="bbcor", metric_bias=0.1, metric_bias_u=0.1)


def test_wrong_options_are_refused() -> None:
    with pytest.raises(InputError, match="from 2"):
        vl.faults(laboratories=1)
    with pytest.raises(InputError, match="did you mean gate-moved"):
        faults(("gate-move",), laboratories=2)
