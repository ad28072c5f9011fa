"""Forgeries in which all digests and forms agree: `score` finds those that change more than texts.

These are some of `tests.certificate.forging`, whose command tries all.
"""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest

from tests.certificate.forging import RECORDS, SIGNED, TRUTHS, forge, sealed_test
from virtual_lab import score as score_folder
from virtual_lab.certificate.verify import verify

pytestmark = pytest.mark.usefixtures("each_form_is_made_once")


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a test with a sealed seed."""
    return sealed_test(tmp_path_factory.mktemp("forging") / "made")


@pytest.mark.parametrize(
    ("forgery", "file", "key"),
    [
        ("name of the bat", "records/session.json", "bat"),
        ("limit that passes", "records/procedure.toml", "line"),
        ("gate of a shot", "records/impact/gates.csv", "row"),
        ("count of the encoder", "records/impact/encoder.csv", "row"),
        ("u of impact.gates.distance_0", "records/session.json", "calibration.impact.gates"),
    ],
)
def test_a_forged_record_passes_verify_but_not_score(
    sealed: Path, tmp_path: Path, forgery: str, file: str, key: str
) -> None:
    folder = forge(sealed, tmp_path / "forged", RECORDS[forgery])
    assert verify(folder).state == "whole"
    scored = score_folder(folder)
    assert (scored.seal, scored.state, scored.code) == ("whole", "altered", 3)
    assert [row for row in scored.different if row.file == file and row.key.startswith(key)]
    assert file in scored.text


@pytest.mark.parametrize(
    ("forgery", "key"),
    [
        ("true metric set to the measured one", "measurand.metric"),
        ("true constant", "constants.impact.gates.clock"),
        ("a fault in both", "constants.impact.gates.distance_1"),
    ],
)
def test_a_forged_truth_passes_verify_but_not_score(
    sealed: Path, tmp_path: Path, forgery: str, key: str
) -> None:
    folder = forge(sealed, tmp_path / "forged", TRUTHS[forgery])
    found = verify(folder)
    assert found.state == "whole"
    assert "truth: only `score` can check it" in found.text
    scored = score_folder(folder)
    assert (scored.state, scored.code) == ("altered", 3)
    assert scored.different[0].key.startswith(key)


def test_another_seed_contradicts_the_commitment(sealed: Path, tmp_path: Path) -> None:
    """Only `score` finds another chosen seed, which has no commitment."""
    folder = forge(sealed, tmp_path / "forged", TRUTHS["both seeds"])
    (row,) = verify(folder).rows
    assert (row.file, row.key) == ("truth/truth.json", "seed")
    stated = json.loads((sealed / "certificate.json").read_text())["simulation"]["seed_commitment"]
    assert row.expected == stated
    assert score_folder(folder).code == 3


def test_the_truth_of_another_test_is_found(sealed: Path, tmp_path: Path) -> None:
    """The bat, the rules and the rig are the same; only the seeds differ."""
    other = sealed_test(tmp_path / "other", seed=5) / "truth/truth.json"
    truth = json.loads(other.read_text("utf-8"))
    folder = forge(sealed, tmp_path / "forged", lambda session, _: (session, truth))
    assert score_folder(folder).code == 3


def test_a_rig_that_is_not_installed_leaves_the_truth_unchecked(
    sealed: Path, tmp_path: Path
) -> None:
    folder = forge(sealed, tmp_path / "forged", TRUTHS["an unknown rig in the recipe"])
    scored = score_folder(folder)
    assert (scored.state, scored.code) == ("not checked", 4)
    assert "not checked: impact rig = 'mine'; installed:" in scored.text


@pytest.mark.parametrize("forgery", ["date", "limit, also in the recipe"])
def test_texts_and_the_recipe_itself_need_a_signature(
    sealed: Path, tmp_path: Path, forgery: str
) -> None:
    """The README lists them. A changed sheet is named."""
    scored = score_folder(forge(sealed, tmp_path / "forged", SIGNED[forgery]))
    assert (scored.state, scored.code) == ("whole", 0)
    assert ("not those of the catalog: procedures/astm-f1881" in scored.text) == (
        "limit" in forgery
    )


def test_a_seal_kept_elsewhere_shows_also_a_text(sealed: Path, tmp_path: Path) -> None:
    folder = forge(sealed, tmp_path / "forged", SIGNED["date"])
    shutil.copy(sealed / "truth/seal.json", folder / "truth/seal.json")
    scored = score_folder(folder)
    assert (scored.seal, scored.code) == ("broken", 3)
    assert {"certificate.json", "records/session.json"} <= {row.file for row in scored.different}


def test_the_stored_table_says_the_same_of_every_forgery() -> None:
    """`score` passes only what README.md and limits.md list; exit code 4 is *not checked*."""
    (path,) = Path(__file__).parent.glob("forging-*.csv")
    rows = list(csv.DictReader(path.read_text("utf-8").splitlines()))
    assert len(rows) > 200
    for kind, forgeries in (("records", RECORDS), ("truth", TRUTHS), ("signed", SIGNED)):
        found = {row["change"]: int(row["score"]) for row in rows if row["kind"] == kind}
        assert found.keys() == forgeries.keys()
        assert {*found.values()} <= ({0} if kind == "signed" else {3, 4})
    by_hand = [int(row["score"]) for row in rows if row["kind"] == "by hand"]
    assert len(by_hand) > 80
    assert 0 not in by_hand
