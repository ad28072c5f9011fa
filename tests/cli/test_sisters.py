"""A result folder that one command writes, every sister command reads."""

from __future__ import annotations

import hashlib
import json
import shlex
import shutil
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

import pytest

import virtual_lab as vl
from tests.cli.test_cli import MEASURED
from tests.cli.test_examples import STUDY
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.result_folder import close_result, write_result
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.origin import DAY_FILES
from virtual_lab.records.session import HitDecision, load_session, pack, save_session

PROCEDURE = (Path(__file__).parents[2] / "data/procedures/bbcor.toml").read_text("utf-8")
WRITTEN = {  # folder: command that writes it
    "certify": "certify r161 --seed 7 --out certify",
    "reduce": "reduce certify/records --out reduce",
    "sweep/r161-bbcor-00000": "sweep r161 --procedure bbcor --laboratories 1 --certificates sweep",
    "book": "rehearse --operator book --seed 3 --out book",
    "cheating": "rehearse --operator cheating --seed 3 --out cheating",
    "careless": "rehearse --operator careless --scenario tuesday --seed 6 --out careless",
    "bad-hits": "rehearse --script bad-hits.json --seed 3 --out bad-hits",
    "control": "certify r161 --procedure rules.toml --control-bat check-cylinder --seed 7 "
    "--out control",
}
# folders and files without a certificate: one of each way to save
OTHERS = {
    "campaign": "campaign run study.toml --out campaign",
    "daily": "daily --days 9 --baseline 6 --out daily",
    "fitted.toml": "fit-bat measured.toml --members 2 --out fitted.toml",
    "profile": "profile r161 --out profile",
    "report": "report certify book --out report",
}
SISTERS = ("verify", "score", "report", "show", "twin")


def run(words: str) -> int:
    return int(cli.main(shlex.split(words), standalone_mode=False))


def write_script(folder: Path) -> None:
    """Write a day that rejects every sound hit but two, and accepts the others."""
    actions = json.loads((folder / "cheating" / "actions.json").read_text("utf-8"))["actions"]
    swapped = {"accept": "reject", "reject": "accept"}
    for action in actions:
        if action["do"] in swapped:
            action["do"], action["because"] = swapped[action["do"]], "the other way"
    (folder / "bad-hits.json").write_text(json.dumps({"actions": actions}), "utf-8")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    with chdir(folder):
        for name, command in WRITTEN.items():
            if name == "bad-hits":
                write_script(folder)
            if name == "control":
                rules = PROCEDURE.replace('"trampoline"', '"control-bat"')
                Path("rules.toml").write_text(rules, "utf-8")
            assert run(command) == 0, command
    return folder


@pytest.fixture(scope="module")
def others(written: Path) -> Path:
    (written / "study.toml").write_text(STUDY)
    (written / "measured.toml").write_text(MEASURED)
    with chdir(written):
        for command in OTHERS.values():
            assert run(command) == 0, command
    return written


@pytest.mark.parametrize("name", [*WRITTEN, "control/control"])
def test_every_sister_command_reads_the_folder(name: str, written: Path) -> None:
    folder = written / name
    assert vl.verify(folder).state == "whole"
    stated = json.loads((folder / "certificate.json").read_text("utf-8"))
    assert vl.load(folder).document == stated
    again = vl.reduce(folder / "records").document
    assert {key: again[key] for key in ("verdict", "shots", "deviations")} == {
        key: stated[key] for key in ("verdict", "shots", "deviations")
    }
    assert run(f"show {folder}") == 0
    # one of the same bat or procedure, so that the two differ in one respect
    other = written / ("book" if "control" not in name and name != "book" else "certify")
    other = written / "sweep/r161-bbcor-00000" if "control" in name else other
    assert len(vl.report([folder, other]).rows) == 2
    if (folder / "truth").exists():
        assert vl.score(folder).code == 0
    else:
        with pytest.raises(InputError, match=r"truth\.json: .* only a simulated test"):
            vl.score(folder)


@pytest.mark.parametrize("name", OTHERS)
def test_a_folder_without_a_certificate_is_refused_in_one_line(
    name: str, others: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line names the path; `show` also prints the sheet of a file."""
    monkeypatch.chdir(others)
    for command in SISTERS:
        if (command, name) == ("show", "fitted.toml"):
            assert run(f"show {name}") == 0
            continue
        with pytest.raises(InputError, match=name) as fault:
            run(f"{command} {name}")
        assert "\n" not in str(fault.value)


def test_a_decision_against_the_rules_is_a_deviation(written: Path) -> None:
    """Each accepted bad hit and each rejected sound one, with the person and the reason."""
    deviations = vl.load(written / "bad-hits").document["deviations"]
    assert all(each.startswith("the script ") for each in deviations)
    assert any("accepted shot" in each for each in deviations)
    assert all(each.endswith("stated reason: the other way") for each in deviations)
    page = (written / "bad-hits" / "certificate.html").read_text("utf-8")
    assert page.count(">Deviation<") == len(deviations)
    assert "deviations from the procedure" not in page.split("Not stated: ")[1].split("</p>")[0]
    assert "deviations" not in vl.load(written / "bad-hits").text.partition("Not stated: ")[2]
    assert vl.load(written / "book").document["deviations"] == []
    assert "deviations from the procedure" in (written / "book/certificate.html").read_text("utf-8")


def test_decisions_in_records_of_a_laboratory_are_reported_and_not_obeyed(
    written: Path, tmp_path: Path
) -> None:
    session = vl.load(written / "certify").certification.session
    decision = HitDecision(shot=0, accepted=False, because="no", by="me")
    (tmp_path / "records").mkdir()
    save_session(replace(session, decisions=(decision,)), tmp_path / "records")
    reduced = vl.reduce(tmp_path / "records")
    assert reduced.value == vl.load(written / "certify").value
    (flag,) = reduced.document["flags"]
    assert "1 decisions of a person" in flag["sentence"]
    assert reduced.document["deviations"] == []


@pytest.mark.parametrize("change", ["decisions", "constant"])
def test_a_rehearsed_folder_made_again_by_our_own_functions_is_altered(
    change: str, written: Path, tmp_path: Path
) -> None:
    """`verify` finds nothing, but the day played again has other decisions and constants."""
    source, forged = written / "cheating", tmp_path / "forged"
    session = load_session(source / "records")
    if change == "decisions":
        accepted = tuple(replace(each, accepted=True) for each in session.decisions)
        session = replace(session, decisions=accepted)
    else:
        key = "impact.encoder.scale"
        larger = replace(session.calibration[key], value=1.002 * session.calibration[key].value)
        session = replace(session, calibration={**session.calibration, key: larger})
    truth = (source / "truth" / "truth.json").read_bytes()
    certification, records = certify_session(session), pack(session)
    digest = hashlib.sha256(truth).hexdigest()
    document = certificate(certification, truth_digest=digest, session_digest=records.digest)
    forged.mkdir()
    write_result(forged, document, certification, records, truth)
    (forged / "certificate.html").write_text(certificate_page(document), "utf-8")
    for name in ("settings.toml", *DAY_FILES):
        shutil.copy(source / name, forged / name)
    close_result(forged, document, certification)
    assert vl.verify(forged).state == "whole"
    scored = vl.score(forged)
    assert scored.code == 3
    assert {row.file for row in scored.different} >= {"records/session.json"}
