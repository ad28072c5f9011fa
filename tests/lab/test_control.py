"""The control bat: e of the tested bat over e of a bat of known e with the same balls."""

from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from tests.laboratories import certified, certify
from virtual_lab import api, catalog, lab
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.text import certificate_text
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import CHOICE, Procedure
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Reality

CYLINDER, STANDARD = "check-cylinder", 0.5
BBCOR = catalog.load("procedures", "bbcor", Procedure).text
CONTROLLED = BBCOR.replace('method = "trampoline"', 'method = "control-bat"')


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the text of `bbcor` with a control bat."""
    path = tmp_path_factory.mktemp("rules") / "controlled.toml"
    path.write_text(CONTROLLED)
    return str(path)


@cache
def controlled(rules: str, reality: Reality = Reality.REAL, seed: int = 7) -> lab.BatTest:
    return certify("r161", procedure=rules, control_bat=CYLINDER, reality=reality, seed=seed)


def test_without_errors_the_constant_is_the_ratio_of_two_tests(rules: str) -> None:
    """Each bat is certified alone by `bbcor`; the metric is the ratio of both e."""
    bat, cylinder = (
        certified(name, procedure="bbcor", reality=Reality.IDEAL) for name in ("r161", CYLINDER)
    )
    by_hand = [test.certification.quantities["restitution"].value for test in (bat, cylinder)]
    found = controlled(rules, Reality.IDEAL)
    assert found.certification.metric is not None
    expected = STANDARD * by_hand[0] / by_hand[1]
    assert found.certification.metric.value == pytest.approx(expected, rel=1e-9)
    assert found.sealed.measurand["metric"] == pytest.approx(expected, rel=1e-9)
    assert found.certification.quantities["restitution"].value == pytest.approx(by_hand[0])


def test_the_control_bat_is_hit_anew_in_every_test_of_a_laboratory(rules: str) -> None:
    """The random marks on its aim paper differ between test 1, test 2 and a single test."""
    marks = [
        certify(
            "r161",
            procedure=rules,
            control_bat=CYLINDER,
            seed=7,
            test=number,
            detail=RecordDetail.SUMMED,
        )
        .control.certification.session.records["impact"]["aim"]
        .along
        for number in (None, 1, 2)
    ]
    for one, other in combinations(marks, 2):
        assert not np.array_equal(one, other)


def test_the_two_tests_share_balls_and_calibrations_and_nothing_else(rules: str) -> None:
    found = controlled(rules)
    assert found.control is not None
    assert np.array_equal(found.control.sealed.balls.mass, found.sealed.balls.mass)
    own, of_control = found.certification.session, found.control.certification.session
    assert of_control.bat == CYLINDER
    shared = own.calibration.keys() - {CONTROL}
    assert {key: own.calibration[key] for key in shared} == {
        key: of_control.calibration[key] for key in shared
    }
    for channel in ("log", "gates"):
        first, second = (session.records["balls"][channel] for session in (own, of_control))
        assert first.table().equals(second.table()) == (channel == "log")


def test_the_constant_is_the_control_bats_e_with_its_uncertainty(rules: str) -> None:
    found = controlled(rules)
    assert found.control is not None
    e = found.control.certification.quantities["restitution"]
    ratio = found.certification.session.calibration[CONTROL]
    assert (ratio.value, ratio.u, ratio.dof) == (e.value / STANDARD, e.u / STANDARD, e.dof)
    metric, alone = found.certification.metric, found.certification.quantities["restitution"]
    assert metric is not None
    parts = {each.name: each for each in metric.components}
    fresh = metric.value - parts[CHOICE].value
    assert parts[CONTROL].contribution == pytest.approx(fresh * ratio.u / ratio.value, rel=1e-4)
    assert fresh == pytest.approx(alone.value / ratio.value, rel=1e-9)
    true = found.control.sealed.measurand["restitution"] / STANDARD
    assert found.sealed.constants[CONTROL] == true
    assert abs(ratio.value - true) < 4 * ratio.u


def test_the_intervals_hold_the_truth(rules: str) -> None:
    """Eight laboratories; fewer than 5 of 8 intervals of 95 % hold the truth once in 2500 times."""
    held = 0
    for seed in range(60_000, 60_008):
        found = controlled(rules, seed=seed)
        assert found.certification.metric is not None
        low, high = found.certification.metric.interval_95
        held += low <= found.sealed.measurand["metric"] <= high
    assert held >= 5


def test_the_ratio_to_the_control_bat_removes_most_of_a_livelier_lot(
    rules: str, tmp_path: Path
) -> None:
    """If e0 rises by 0.004, e rises by about as much, and the ratio by a tenth of this."""
    ball = catalog.text("balls", "baseball-2003").replace(
        "value = 0.55, unit", "value = 0.554, unit"
    )
    (tmp_path / "lively.toml").write_text(ball)
    lively = tmp_path / "rules.toml"
    text = Path(rules).read_text()
    lively.write_text(
        text.replace('ball = "baseball-2003"', f'ball = "{tmp_path / "lively.toml"}"')
    )
    usual, other = (controlled(str(each), Reality.IDEAL) for each in (rules, lively))
    gains = [
        other.sealed.measurand[name] - usual.sealed.measurand[name]
        for name in ("restitution", "metric")
    ]
    assert 0.0028 < gains[0] < 0.0044
    assert abs(gains[1]) < 0.1 * gains[0]


def test_the_control_test_is_stored_and_can_be_reduced_again(rules: str, tmp_path: Path) -> None:
    tested = api.certify("r161", procedure=rules, control_bat=CYLINDER, seed=7)
    folder = tested.save(tmp_path / "out")
    again = api.reduce(folder / "records")
    assert again.document["metric"] == tested.document["metric"]
    control = api.reduce(folder / "control" / "records").document
    ratio = tested.document["ball_correction"]["control"]
    assert control["restitution"]["value"] / STANDARD == pytest.approx(ratio["value"], rel=1e-12)
    assert (folder / "control" / "truth" / "truth.json").exists()


def test_the_certificate_states_the_ratio_of_the_control_bat(rules: str) -> None:
    found = controlled(rules).certification
    document = certificate(found)
    assert document.ball_correction is not None
    ratio = document.ball_correction.control
    assert ratio is not None
    assert f"divided by {ratio.value:.4f} (u = {ratio.u:.4f}), the ratio of the control" in (
        certificate_text(document)
    )
    assert f"divided by {ratio.value:.4f}" in certificate_page(document)
    plain = certified(seed=7).certification
    assert certificate(plain).ball_correction is None


def test_wrong_input_on_control_bats_is_refused(rules: str) -> None:
    with pytest.raises(InputError, match="control bat; is missing: bbcor corrects its balls"):
        certify("r161", procedure=rules, seed=1)
    with pytest.raises(InputError, match="bbcor does not correct by a control bat"):
        certify("r161", procedure="bbcor", control_bat=CYLINDER, seed=1)
    with pytest.raises(InputError, match="did you mean"):
        certify("r161", procedure=rules, control_bat="check-cylindre", seed=1)
    with pytest.raises(InputError, match="its own test gives no result: "):
        certify(
            "r161",
            procedure=rules,
            control_bat=CYLINDER,
            seed=1,
            faults=("ounces-as-grams",),
            reality=Reality.REAL,
        )
