"""The seal of an output folder: each altered file and key is named, and no other."""

import hashlib
import json
import os
import re
import shutil
from math import nextafter
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Play
from tests.records.digests import channel_digest
from virtual_lab.api import Certificate
from virtual_lab.certificate.seal import alterations, write_seal
from virtual_lab.errors import InputError

EDITS: dict[str, Any] = {
    "schema": 9,
    "statement": "",
    "procedure.edition": "ASTM F1881-23",
    "bat.mass_kg.value": 0.8,
    "metric.value": 0.846,
    "metric.interval_95[1]": 0.9,
    "verdict": "FAIL",
    "marginal": 0,  # a value that equals False in Python
    "restitution.value": None,
    "recoil_factor.value": "0.2",
    "ball_correction": {},
    "v_rel_mph": 60,
    "flags": "",
    "ring.frequencies_hz[1]": 379.0,
    "budget[0].u": 0.001,
    "unverified[2].source": "the standard",
    "simulation.sealing": "sealed",
}


@pytest.fixture(scope="module")
def issued(played: Play, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of one test as it was written."""
    tested = played()
    folder = tmp_path_factory.mktemp("seal") / "r161"
    return Certificate(certification=tested.certification, sealed=tested.sealed).save(folder)


@pytest.fixture
def folder(issued: Path, tmp_path: Path) -> Path:
    """Return a copy of the folder to alter."""
    shutil.copytree(issued, tmp_path / "r161")
    return tmp_path / "r161"


def named(folder: Path) -> list[str]:
    return [str(each) for each in alterations(folder)]


def put(document: Any, key: str, value: Any) -> None:
    """Set the value under a key such as ``budget[3].u``."""
    *steps, last = re.findall(r"[^.\[\]]+", key)
    for step in steps:
        document = document[int(step) if isinstance(document, list) else step]
    document[int(last) if isinstance(document, list) else last] = value


def edit(path: Path, key: str, value: Any) -> None:
    document = json.loads(path.read_text())
    put(document, key, value)
    path.write_text(json.dumps(document, indent=2))


def test_an_unaltered_folder_is_whole(folder: Path) -> None:
    """Other files may lie beside it: notes, a printed page."""
    (folder / "notes.txt").write_text("seen by me")
    assert alterations(folder) == []


@pytest.mark.parametrize("key", EDITS)
def test_an_edited_value_of_the_certificate_is_named(key: str, folder: Path) -> None:
    edit(folder / "certificate.json", key, EDITS[key])
    assert named(folder) == [f"certificate.json, {key}: altered since it was sealed"]


def test_the_last_digits_of_a_value_are_held(folder: Path) -> None:
    """A change of 1e-12 of the metric, or of the last bit of its u, is detected."""
    path = folder / "certificate.json"
    metric = json.loads(path.read_text())["metric"]
    for key, value in (("value", metric["value"] * (1 + 1e-12)), ("u", nextafter(metric["u"], 1))):
        edit(path, f"metric.{key}", value)
        assert named(folder) == [f"certificate.json, metric.{key}: altered since it was sealed"]
        edit(path, f"metric.{key}", metric[key])


def test_every_key_of_the_certificate_is_held(folder: Path) -> None:
    """Each key, altered alone, is named, and no other."""
    path = folder / "certificate.json"
    text = path.read_text()
    for top in json.loads(text):
        edit(path, top, "forged")
        found = named(folder)
        assert found, top
        assert all(re.match(rf"certificate\.json, {top}[:.[]", line) for line in found), found
        path.write_text(text)


def test_a_certificate_laid_out_otherwise_is_the_same(folder: Path) -> None:
    """Other white space, another order of keys, and 60 for 60.0 change no value."""
    path = folder / "certificate.json"
    document = json.loads(path.read_text())
    assert document["nominal_speed_mph"] == 60
    document["nominal_speed_mph"] = 60
    path.write_text(json.dumps(dict(reversed(document.items())), indent=7))
    assert alterations(folder) == []


def test_removed_and_added_keys_are_named(folder: Path) -> None:
    path = folder / "certificate.json"
    document = json.loads(path.read_text())
    del document["metric"]["limit"]
    document["metric.u"] = document["metric"]["u"]  # value that must not count as the other one
    document["metric"]["u"] = 0.001
    path.write_text(json.dumps(document))
    assert named(folder) == [
        "certificate.json, metric.u: altered since it was sealed",
        "certificate.json, metric.limit: removed since it was sealed",
        'certificate.json, "metric.u": added since it was sealed',
    ]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"metric": {"value": 0.94', "[" * 100_000])
def test_an_unreadable_certificate_counts_as_altered(text: str, folder: Path) -> None:
    (folder / "certificate.json").write_text(text)
    found = alterations(folder)
    assert {each.file for each in found} == {"certificate.json"}


def test_a_truncated_record_is_named(folder: Path) -> None:
    path = folder / "records" / "impact" / "encoder.csv"
    path.write_bytes(path.read_bytes()[:4000])
    assert named(folder) == ["records/impact/encoder.csv: altered since it was sealed"]


def test_an_altered_sample_with_its_digest_is_named(folder: Path) -> None:
    """The seal detects it, although `reduce` accepts the record."""
    session = folder / "records" / "session.json"
    path = folder / "records" / "balls" / "gates.csv"
    text = path.read_text()
    digit = text[-3]
    path.write_text(f"{text[:-3]}{(int(digit) + 1) % 10}{text[-2:]}")
    digest = channel_digest(json.loads(session.read_text()), path)
    edit(session, "channels.balls.gates.sha256", digest)
    assert named(folder) == [
        "records/balls/gates.csv: altered since it was sealed",
        "records/session.json, channels.balls.gates.sha256: altered since it was sealed",
    ]


def test_removed_and_added_records_are_named(folder: Path) -> None:
    (folder / "records" / "bench" / "balance.csv").rename(folder / "records" / "balance.csv")
    assert named(folder) == [
        "records/bench/balance.csv: removed since it was sealed",
        "records/balance.csv: added since it was sealed",
    ]


def test_links_and_pipes_among_records_are_named(folder: Path, tmp_path: Path) -> None:
    """Links and pipes that replace or accompany files and folders are named, and none is opened."""
    records = folder / "records"
    gates = (records / "impact" / "gates.csv").rename(tmp_path / "gates.csv")
    (records / "impact" / "gates.csv").symlink_to(gates)
    (records / "impact" / "log.csv").unlink()
    os.mkfifo(records / "impact" / "log.csv")
    os.mkfifo(records / "more.csv")
    (folder / "truth" / "other.json").symlink_to(gates)
    (records / "balls").rename(tmp_path / "balls")
    (records / "balls").symlink_to(tmp_path / "balls")
    assert sorted(named(folder)) == [
        "records/balls/gates.csv: removed since it was sealed",
        "records/balls/log.csv: removed since it was sealed",
        "records/balls: added, a link, since it was sealed",
        "records/impact/gates.csv: replaced by a link since it was sealed",
        "records/impact/log.csv: replaced by a pipe since it was sealed",
        "records/more.csv: added, a pipe, since it was sealed",
        "truth/other.json: added, a link, since it was sealed",
    ]


def test_a_seal_that_is_a_link_is_named(folder: Path, tmp_path: Path) -> None:
    seal = (folder / "truth" / "seal.json").rename(tmp_path / "seal.json")
    (folder / "truth" / "seal.json").symlink_to(seal)
    assert named(folder) == ["truth/seal.json: replaced by a link since it was sealed"]


def test_altered_rules_and_calibration_are_named(folder: Path) -> None:
    rules = folder / "records" / "procedure.toml"
    text = rules.read_text()
    assert "value = 1.2," in text
    rules.write_text("# mine\n" + text.replace("value = 1.2,", "value = 1.3,"))
    session = folder / "records" / "session.json"
    assert '"impact.encoder.scale": {' in session.read_text()
    document = json.loads(session.read_text())
    document["calibration"]["impact.encoder.scale"]["u"] /= 2
    session.write_text(json.dumps(document))
    first, second = named(folder)
    assert re.fullmatch(r"records/procedure.toml, [\w.]+\.value: altered since .*", first)
    assert second.startswith('records/session.json, calibration."impact.encoder.scale".u: altered')


@pytest.mark.parametrize("name", ["certificate.html", "readings.csv", "truth/truth.json"])
def test_an_altered_or_removed_file_is_named(name: str, folder: Path) -> None:
    """Other files are altered by a byte, or removed."""
    path = folder / name
    path.write_bytes(path.read_bytes() + b" ")
    assert named(folder) == [f"{name}: altered since it was sealed"]
    path.unlink()
    assert named(folder) == [f"{name}: removed since it was sealed"]


@pytest.mark.parametrize(
    ("old", "new"), [('"metric.value": "', '"metric.value": "0'), ('": ', ": "), ("{", "")]
)
def test_an_edited_seal_is_reported(old: str, new: str, folder: Path) -> None:
    """An altered digest, or invalid JSON, is named; white space does not matter."""
    path = folder / "truth" / "seal.json"
    text = path.read_text()
    path.write_text(json.dumps(json.loads(text)))
    assert alterations(folder) == []
    path.write_text(text.replace(old, new, 1))
    assert named(folder) == ["truth/seal.json: altered since it was sealed"]


def test_no_other_value_passes_for_a_sealed_one(tmp_path: Path) -> None:
    """Digests have at least 64 bits, and those of 5 000 values are all different."""
    (tmp_path / "truth").mkdir()
    values = {f"key {number}": number for number in range(5000)}
    (tmp_path / "values.json").write_text(json.dumps(values))
    write_seal(tmp_path)
    sealed = json.loads((tmp_path / "truth" / "seal.json").read_text())["content"]["values.json"]
    assert len({*sealed.values()}) == len(values)
    assert min(map(len, sealed.values())) >= 16


def test_a_missing_seal_is_refused(folder: Path) -> None:
    (folder / "truth" / "seal.json").unlink()
    with pytest.raises(InputError, match=r"truth/seal.json: seal; is missing"):
        alterations(folder)


def test_the_seal_gives_nothing_of_the_truth_away(folder: Path) -> None:
    """The seal has one digest of the truth, which includes a salt."""
    content = json.loads((folder / "truth" / "seal.json").read_text())["content"]
    data = (folder / "truth" / "truth.json").read_bytes()
    assert content["truth/truth.json"] == hashlib.sha256(data).hexdigest()
    assert len(bytes.fromhex(json.loads(data)["salt"])) == 16


def test_a_control_bats_folder_is_sealed_too(folder: Path, tmp_path: Path) -> None:
    """The test of a control bat is sealed with the test that used it, and alone."""
    shutil.copytree(folder, folder / "control")
    write_seal(folder)
    edit(folder / "control" / "certificate.json", "verdict", "FAIL")
    assert named(folder) == ["control/certificate.json, verdict: altered since it was sealed"]
    (folder / "control" / "records" / "more.csv").write_text("")
    assert "control/records/more.csv: added since it was sealed" in named(folder)
    (folder / "control" / "records" / "more.csv").unlink()
    assert named(folder / "control") == ["certificate.json, verdict: altered since it was sealed"]
