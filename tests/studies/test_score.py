"""The score of a result folder: the test is played again, and any alteration is reported."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import virtual_lab as vl
from tests.certificate.altering import in_all_forms
from virtual_lab import score as score_folder
from virtual_lab.certificate.seal import write_seal
from virtual_lab.certificate.signing import digest_of_file as sha256
from virtual_lab.certificate.signing import write_sums
from virtual_lab.errors import InputError
from virtual_lab.output.tables import table_text
from virtual_lab.studies.score import CertificateScore, QuantityScore

ROWS = {"metric", "collision_efficiency", "restitution", "recoil_factor", "ball_restitution"}
FIELDS = {"seal", "state", "altered", "differs", "unchecked", "sealing"}
FIELDS |= {"faults", "sheets", "ignored"}


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a test with a random seed."""
    return vl.certify("r161").save(tmp_path_factory.mktemp("score") / "r161")


@pytest.fixture
def folder(sealed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sealed, tmp_path / "copy"))


def rewrite(path: Path, **changes: Any) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_test_that_was_played_again_is_scored(folder: Path) -> None:
    scored = score_folder(folder)
    document = scored.document
    shots = pd.read_csv(folder / "readings.csv").query("used")
    names = "collision_efficiency", "bat_performance_factor"
    hits = {f"{name}_shot_{shot + 1}" for shot in shots["shot"] for name in names}
    assert set(document) == FIELDS | ROWS | hits
    assert (document["seal"], document["state"], scored.code) == ("whole", "whole", 0)
    assert (document["altered"], document["differs"], document["sheets"]) == ([], [], ())
    metric = document["metric"]
    error = metric["value"] - metric["true_value"]
    assert metric["z"] == pytest.approx(error / metric["u"])
    answer, *_, seal, replay, sealing = scored.text.splitlines()
    inside = "inside" if metric["held"] else "outside"
    stated = f"BPF {metric['value']:.4f}, true {metric['true_value']:.4f}: the error {error:+.4f}"
    assert answer.startswith(f"{stated} is {abs(metric['z']):.2f} times the standard uncertainty")
    assert f"the true value is {inside} the 95 % interval" in answer
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    true, bat = pd.DataFrame(truth["shots"]), truth["bat_properties"]
    axis = bat["length"] - 0.1524  # pivot 6 in from the knob
    inertia = bat["inertia_cm"] + bat["mass"] * (axis - bat["z_cm"]) ** 2
    (scatter,) = vl.load(folder).budget.query("component == 'hits'")["contribution"]
    shared = metric["u"] ** 2 - scatter**2
    for shot, ball, e_A, bpf in shots[["shot", "ball", *names]].itertuples(index=False):
        hit, of_metric = (document[f"{name}_shot_{shot + 1}"] for name in names)
        assert hit["value"] == pytest.approx(e_A)
        assert hit["true_value"] == true["collision_efficiency"][shot]
        assert hit["error"] == pytest.approx(hit["value"] - hit["true_value"])
        assert of_metric["value"] == pytest.approx(bpf)
        u = (shared + shots["bat_performance_factor"].var()) ** 0.5
        assert (of_metric["metric"], of_metric["u"]) == ("BPF", pytest.approx(u))
        assert of_metric["z"] == pytest.approx((bpf - of_metric["true_value"]) / u)
        place, out, e0 = true.loc[shot, ["place", "collision_efficiency", "ball_restitution"]]
        impulse = truth["balls"]["mass"][ball] * (1 + out)  # impulse on a ball of 1 m/s
        e = out + impulse * (axis - place) ** 2 / inertia
        assert of_metric["true_value"] == pytest.approx(e / e0)
    assert (seal, replay) == ("The seal is intact.", "Played again: truth and records agree.")
    assert sealing == "sealed: random seed of 128 bits, stored only with the truth"


@pytest.mark.parametrize(
    ("bat", "procedure", "metric"),
    [
        ("r161", "astm-f1881", "bat_performance_factor"),
        # converted to a standard ball; at the center of percussion the recoil would not matter
        ("ea70", vl.procedure("bbcor").with_(recoil="free"), "restitution"),
        ("ea70", "ncaa-modified", "batted_speed"),
    ],
)
def test_without_errors_the_true_metric_of_each_hit_is_the_measured_one(
    bat: str, procedure: Any, metric: str, tmp_path: Path
) -> None:
    test = vl.certify(bat, procedure=procedure, reality="ideal")
    rows = score_folder(test.save(tmp_path / "ideal")).document
    hits = [row for name, row in rows.items() if name.startswith(f"{metric}_shot_")]
    assert len(hits) == test.shots["used"].sum()
    assert [row["true_value"] for row in hits] == pytest.approx([row["value"] for row in hits])


@pytest.mark.parametrize(
    ("name", "metric", "label"),
    [
        ("metric", "BPF", "BPF (result)"),
        ("metric_as_found", "e", "e as found"),
        ("restitution", "", "e"),
        ("besr_shot_12", "BESR", "BESR of hit 12"),
        ("width_m", "", "width_m"),
    ],
)
def test_a_quantity_is_printed_by_its_symbol(name: str, metric: str, label: str) -> None:
    row = QuantityScore(
        quantity=name,
        metric=metric,
        unit="",
        value=1.0,
        u=0.1,
        true_value=1.3,
        error=-0.3,
        z=-3.0,
        held=False,
    )
    assert table_text([row]).splitlines()[1].startswith(f"{label} ")
    said = (
        f"{metric or label} 1.00, true 1.30: the error -0.30 is 3.00 times the standard uncertainty"
    )
    often = "and the true value is outside the 95 % interval, as in 5 % of all tests."
    assert row.words == f"{said}, {often}"
    inside = replace(row, z=2.4, held=True)  # with few degrees of freedom
    (axes,) = CertificateScore(broken=False, different=(), rows=(row, inside)).plot().axes
    marks = [line for line in axes.lines if line.get_marker() == "o"][:2]
    fills = {line.get_xdata()[0]: line.get_markerfacecolor() for line in marks}
    assert fills == {-3.0: "white", 2.4: "black"}


def test_litter_is_ignored_and_named(folder: Path) -> None:
    (folder / ".DS_Store").write_bytes(b"litter")
    (folder / "truth" / "Thumbs.db").write_bytes(b"litter")
    scored = score_folder(folder)
    assert scored.code == 0
    assert "ignored: .DS_Store, truth/Thumbs.db" in scored.text


@pytest.mark.parametrize(
    "changes",
    [
        {"metric": None},
        {"metric": {"value": "0.9", "u": 0.01}},
        {"metric": {"value": 10**400, "u": 0.01}},
        {"metric": {"value": float("nan"), "u": 0.01}},  # allowed in Python, not in JSON
        {"simulation": []},
        {"restitution": {"value": 0.5}},
    ],
)
def test_an_unscorable_value_is_reported_as_altered(changes: dict[str, Any], folder: Path) -> None:
    """The score then has no rows."""
    rewrite(folder / "certificate.json", **changes)
    scored = score_folder(folder)
    document = scored.document
    assert (document["seal"], scored.code) == ("broken", 3)
    assert {each["file"] for each in document["altered"]} == {"certificate.json"}
    json.dumps(document, allow_nan=False)
    assert not set(document) & ROWS
    assert "no score" in scored.text


def test_a_truncated_certificate_and_an_altered_truth_are_named(folder: Path) -> None:
    certificate, truth = folder / "certificate.json", folder / "truth" / "truth.json"
    certificate.write_text(certificate.read_text()[:90])
    truth.write_text("{}")
    files = [each["file"] for each in score_folder(folder).document["altered"]]
    assert files == ["certificate.json", "truth/truth.json"]


@pytest.mark.parametrize("name", ["certificate.json", "truth/truth.json", "truth/seal.json"])
def test_a_missing_file_is_named(name: str, folder: Path) -> None:
    (folder / name).unlink()
    with pytest.raises(InputError, match=name):
        score_folder(folder)


def test_a_certificate_without_a_result_is_bad_input(folder: Path) -> None:
    rewrite(folder / "certificate.json", metric={})
    write_seal(folder)
    with pytest.raises(InputError, match="value; this key is missing"):
        score_folder(folder)


def test_a_truth_of_another_version_is_not_checked(folder: Path) -> None:
    """Nothing says whether this version or the other one is right."""
    truth = folder / "truth" / "truth.json"
    rewrite(truth, measurand={**json.loads(truth.read_text())["measurand"], "metric": 0.9})
    in_all_forms(**{"versions__virtual-lab": "0.0.1", "simulation__truth_digest": sha256(truth)})(
        folder
    )
    write_seal(folder)
    write_sums(folder)
    scored = score_folder(folder)
    assert (scored.state, scored.code) == ("not checked", 4)
    assert "not checked: made by version 0.0.1" in scored.text


@pytest.mark.parametrize(
    ("recipe", "version", "state"),
    [
        ({}, None, "altered"),
        ({"seed": "7"}, None, "altered"),
        ({}, "0.0.1", "not checked"),
    ],
)
def test_this_version_writes_a_recipe_into_every_truth(
    recipe: dict[str, Any], version: str | None, state: str, folder: Path
) -> None:
    """Without it the test cannot be played again, so whoever removes it is not believed."""
    truth = folder / "truth" / "truth.json"
    rewrite(truth, recipe=recipe)
    changes = {"versions__virtual-lab": version} if version else {}
    in_all_forms(**changes, simulation__truth_digest=sha256(truth))(folder)
    write_seal(folder)
    write_sums(folder)
    assert vl.verify(folder).state != "altered"
    scored = score_folder(folder)
    assert scored.state == state
    named = {row.file for row in scored.different if row.state == "altered"}
    assert named == ({"truth/truth.json"} if state == "altered" else set())


def test_records_that_are_gone_are_altered(folder: Path) -> None:
    """`verify` names them, although there is nothing to compare with the replay."""
    shutil.rmtree(folder / "records")
    write_seal(folder)
    write_sums(folder)
    scored = score_folder(folder)
    assert scored.code == 3
    assert "records/session.json" in {row.file for row in scored.different}
