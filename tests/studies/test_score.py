"""The score of an output folder: alterations of any kind are reported."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from virtual_lab.certificate.seal import write_seal
from virtual_lab.errors import InputError
from virtual_lab.studies.score import score_folder

ROWS = {"metric", "collision_efficiency", "restitution", "recoil_factor", "ball_restitution"}
SEALING = "sealed: random seed of 128 bits, stored only with the truth"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a sealed test with only the files that a score needs."""
    truth = {"measurand": dict.fromkeys(ROWS, 0.5), "reality": "real"}
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "truth.json").write_text(json.dumps(truth))
    digest = hashlib.sha256(json.dumps(truth).encode()).hexdigest()
    certificate: dict[str, Any] = {name: {"value": 0.501, "u": 0.001} for name in sorted(ROWS)}
    certificate["simulation"] = {"sealing": SEALING, "truth_digest": digest}
    (tmp_path / "certificate.json").write_text(json.dumps(certificate))
    write_seal(tmp_path)
    return tmp_path


def test_the_fault_that_was_played_is_named(folder: Path) -> None:
    truth = folder / "truth" / "truth.json"
    rewrite(truth, faults=["gate-moved", "clamp-forgotten"])
    write_seal(folder)
    scored = score_folder(folder)
    assert scored.document["faults"] == ["gate-moved", "clamp-forgotten"]
    assert "faults of the test day: gate-moved, clamp-forgotten" in scored.text


def rewrite(path: Path, **changes: Any) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_whole_seal_is_scored(folder: Path) -> None:
    scored = score_folder(folder)
    document = scored.document
    assert set(document) == {"seal", "altered", "sealing", "faults"} | ROWS
    assert (document["seal"], document["altered"]) == ("whole", [])
    assert document["metric"]["z"] == pytest.approx(1)
    assert scored.text.splitlines()[-2:] == ["The seal is intact.", SEALING]


@pytest.mark.parametrize(
    "changes",
    [
        {"metric": None},
        {"metric": {"value": "0.9", "u": 0.01}},
        {"metric": {"value": 10**400, "u": 0.01}},
        {"simulation": []},
        {"simulation": {}},
        {"restitution": {"value": 0.5}},
    ],
)
def test_an_unscorable_value_is_reported_as_altered(changes: dict[str, Any], folder: Path) -> None:
    """The score then has no rows; without a seal it is bad input."""
    rewrite(folder / "certificate.json", **changes)
    scored = score_folder(folder)
    document = scored.document
    (top,) = changes
    keys = {each["key"].split(".")[0] for each in document["altered"]}
    assert (document["seal"], keys) == ("broken", {top})
    json.dumps(document, allow_nan=False)
    rows = set(document) & ROWS
    text = scored.text
    assert rows == (ROWS if top == "simulation" and changes[top] == {} else set())
    assert ("no score" in text) == (not rows)
    assert f"  certificate.json, {top}" in text


def test_a_certificate_that_is_no_json_is_altered_as_a_file(folder: Path) -> None:
    """NaN is allowed in Python, but not in JSON."""
    rewrite(folder / "certificate.json", metric={"value": float("nan"), "u": 0.01})
    (one,) = score_folder(folder).document["altered"]
    assert (one["file"], one["key"]) == ("certificate.json", "")


def test_a_truncated_certificate_and_an_altered_truth_are_named(folder: Path) -> None:
    certificate, truth = folder / "certificate.json", folder / "truth" / "truth.json"
    certificate.write_text(certificate.read_text()[:90])
    truth.write_text("{}")
    found = score_folder(folder).document["altered"]
    assert [each["file"] for each in found] == ["certificate.json", "truth/truth.json"]


def test_a_truth_sealed_again_does_not_belong_to_the_certificate(folder: Path) -> None:
    """The certificate has the truth's digest, too; if that is altered as well, nothing can tell."""
    truth = folder / "truth" / "truth.json"
    rewrite(truth, reality="ideal")
    write_seal(folder)
    scored = score_folder(folder)
    document = scored.document
    assert document["altered"] == [{"file": "truth/truth.json", "key": "", "change": "altered"}]
    certificate = folder / "certificate.json"
    simulation = json.loads(certificate.read_text())["simulation"]
    simulation["truth_digest"] = hashlib.sha256(truth.read_bytes()).hexdigest()
    rewrite(certificate, simulation=simulation)
    found = score_folder(folder).document["altered"]
    assert [each["key"] for each in found] == ["simulation.truth_digest"]
    write_seal(folder)
    assert score_folder(folder).document["seal"] == "whole"


@pytest.mark.parametrize("name", ["certificate.json", "truth/truth.json", "truth/seal.json"])
def test_a_missing_file_is_named(name: str, folder: Path) -> None:
    (folder / name).unlink()
    with pytest.raises(InputError, match=name):
        score_folder(folder)


def test_a_test_without_a_result_has_no_score(folder: Path) -> None:
    """A sealed test without a result has no score: bad input."""
    rewrite(folder / "certificate.json", metric={})
    write_seal(folder)
    with pytest.raises(InputError, match="value; this key is missing"):
        score_folder(folder)
