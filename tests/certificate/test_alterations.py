"""Ways to alter or exchange a result folder: `verify` calls none of them whole.

Each alteration also renews the list of digests; otherwise the list alone would reveal it.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

import virtual_lab as vl
from tests.certificate.altering import (
    Change,
    all_of,
    another_attachment,
    another_logo,
    constant,
    digit,
    edit,
    edit_json,
    forms_again,
    heavier,
    in_all_forms,
    in_document,
    in_record,
    in_session,
    number_by_hand,
    pdf_of,
    records_told_again,
    removed,
    sums_again,
    supplied,
    swapped,
    with_risk,
)
from virtual_lab.certificate.signing import SUMS, compared_sums
from virtual_lab.certificate.verify import verify

pytestmark = pytest.mark.usefixtures("each_form_is_made_once")

CALIBRATION = "impact.gates.distance_0"
OTHER = {"versions__virtual-lab": "0.0.1"}  # the stated version, which the number depends on
BETTER = {"metric__value": 0.94, "metric__interval_95": [0.93, 0.95]}


def renumbered(**values: object) -> Change:
    """Change certificate.json, and write its new number into the page and the name of the PDF."""

    def change(folder: Path) -> None:
        number = (folder / "certificate.html").read_text("utf-8")
        (old,) = set(re.findall(r"<code>([0-9a-f]{12})</code>", number))
        in_document(**values)(folder)
        edit_json(folder / "certificate.json", with_risk, indent=2)
        parsed = json.loads((folder / "certificate.json").read_text("utf-8"))
        new = number_by_hand(json.dumps(parsed))
        page = folder / "certificate.html"
        page.write_text(page.read_text("utf-8").replace(old, new), "utf-8")
        for pdf in folder.glob("*.pdf"):
            pdf.rename(folder / pdf.name.replace(old, new))

    return change


def on_page(old: str, new: str) -> Change:
    return edit("certificate.html", old, new)


def without_records(folder: Path) -> None:
    shutil.rmtree(folder / "records")


def empty_folder(name: str) -> Change:
    return lambda folder: (folder / name).mkdir(parents=True)


def every(name: str, old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        path = folder / name
        assert old in path.read_text("utf-8")
        path.write_text(path.read_text("utf-8").replace(old, new), "utf-8", newline="")

    return change


def settings(line: str) -> Change:
    """Put a line before the settings, and take away the line with the same key."""

    def change(folder: Path) -> None:
        path = folder / "settings.toml"
        lines = path.read_text("utf-8").splitlines()
        key = line.split(" = ", maxsplit=1)[0]
        kept = [each for each in lines if not each.startswith(f"{key} = ")]
        path.write_text("\n".join([*kept, line, ""]), "utf-8")

    return change


ALTERED: dict[
    str, tuple[Change, str, str]
] = {  # change, and the row (file and key) that `verify` must name
    # alterations of one form alone
    "the value in the document": (
        in_document(metric__value=0.9),
        "certificate.json",
        "metric.value",
    ),
    "its u": (in_document(metric__u=0.001), "certificate.json", "metric.u"),
    "a key removed": (
        lambda folder: edit_json(folder / "certificate.json", lambda d: d.pop("flags")),
        "certificate.json",
        "flags",
    ),
    "a key added": (in_document(logo="gold"), "certificate.json", "logo"),
    "the verdict": (in_document(verdict="FAIL"), "certificate.json", "verdict"),
    "a number as text": (in_document(valid_hits="6"), "certificate.json", "valid_hits"),
    "a number without end": (
        in_document(valid_hits=10**400),
        "certificate.json",
        "valid_hits",
    ),
    "the layout of the document": (
        lambda folder: edit_json(folder / "certificate.json", lambda d: None),
        "certificate.json",
        "line",
    ),
    "the value on the page": (on_page("± ", "± 0"), "certificate.html", "line"),
    "SIMULATED gone from the page": (
        on_page("SIMULATED", "CERTIFIED"),
        "certificate.html",
        "line",
    ),
    "the page cut short": (
        lambda folder: (folder / "certificate.html").write_text("<html>"),
        "certificate.html",
        "line",
    ),
    "the page removed": (removed("certificate.html"), "certificate.html", ""),
    "line ends of another kind on the page": (
        every("certificate.html", "\n", "\u2028"),
        "certificate.html",
        "line",
    ),
    "form feeds for line ends on the page": (
        every("certificate.html", "\n", "\f"),
        "certificate.html",
        "line",
    ),
    "a form feed in the table": (edit("readings.csv", "\n", "\f\n"), "readings.csv", "columns"),
    "a blank in the table": (edit("readings.csv", "\n0,", "\n 0,"), "readings.csv", "row 0"),
    "a reading in the table": (edit("readings.csv", ",60.", ",61."), "readings.csv", "row"),
    "a row of the table gone": (
        lambda folder: (folder / "readings.csv").write_text(
            "\n".join((folder / "readings.csv").read_text().splitlines()[:-1]) + "\n"
        ),
        "readings.csv",
        "",
    ),
    "the table removed": (removed("readings.csv"), "readings.csv", "file"),
    "a PDF of another document": (another_attachment, "pdf", ""),
    "a byte of the PDF": (
        lambda folder: pdf_of(folder).write_bytes(pdf_of(folder).read_bytes() + b"\n"),
        "pdf",
        "",
    ),
    "a PDF renamed": (
        lambda folder: pdf_of(folder).rename(folder / "certificate-000000000000-SIMULATED.pdf"),
        "pdf",
        "name",
    ),
    "the PDF removed": (
        lambda folder: pdf_of(folder).unlink(),
        "ro-crate-metadata.json",
        "@graph",
    ),
    "the unit of a column": (
        edit("datapackage.json", "[oz_av]", "kg"),
        "datapackage.json",
        "resources[0].schema.fields[2].unit",
    ),
    "a file left out of the crate": (
        lambda folder: edit_json(
            folder / "ro-crate-metadata.json", lambda crate: crate["@graph"][1]["hasPart"].pop()
        ),
        "ro-crate-metadata.json",
        "@graph[1].hasPart",
    ),
    # alterations of files and folders
    "a file added": (
        lambda folder: (folder / "approved.txt").write_text("yes"),
        "approved.txt",
        "",
    ),
    "an empty folder": (empty_folder("approved"), "approved", ""),
    "an empty folder in one": (empty_folder("approved/by/nobody"), "approved/by/nobody", ""),
    "an empty folder among the records": (
        empty_folder("records/more"),
        "records/more",
        "file",
    ),
    "a control test of nothing": (
        lambda folder: shutil.copytree(
            folder, folder / "control", ignore=shutil.ignore_patterns("control")
        ),
        "control",
        "",
    ),
    "a record added": (
        lambda folder: (folder / "records/impact/more.csv").write_text("a\n1\n"),
        "records/impact/more.csv",
        "file",
    ),
    "a record removed": (removed("records/impact/aim.csv"), "records/impact/aim.csv", "file"),
    "all records removed": (without_records, "records/session.json", "file"),
    "a record edited": (
        edit("records/impact/gates.csv", "1", "2"),
        "records/impact/gates.csv",
        "sha256",
    ),
    "the rules edited": (
        edit("records/procedure.toml", "valid_hits", "valid_hits "),
        "records/procedure.toml",
        "sha256",
    ),
    # the same alteration of several forms, so that only the records reveal it
    "u halved in all forms": (in_all_forms(metric__u=0.002), "certificate.json", "metric.u"),
    "the value and its interval in all forms": (
        in_all_forms(**BETTER),
        "certificate.json",
        "metric.value",
    ),
    "another customer in all forms": (
        in_all_forms(particulars__customer__name="Nobody"),
        "certificate.json",
        "particulars.customer.name",
    ),
    "another serial number in all forms": (
        in_all_forms(particulars__bat__serial="S-2"),
        "certificate.json",
        "particulars.bat.serial",
    ),
    "another date in all forms": (in_all_forms(date="2020-01-01"), "certificate.json", "date"),
    "another bat in all forms": (in_all_forms(bat__name="ea70"), "certificate.json", "bat.name"),
    "rejected hits gone in all forms": (
        in_all_forms(rejected_hits=[], valid_hits=12),
        "certificate.json",
        "valid_hits",
    ),
    # alterations of the records, with matching digests in session.json
    "a digit of a reading": (
        in_record("bench/bat-mass", digit(1, "8", "9")),
        "certificate.json",
        "bat.mass_kg.value",
    ),
    "a bat 50 g heavier, told again": (
        all_of(in_record("bench/bat-mass", heavier), records_told_again),
        "certificate.json",
        "bat.mass_kg.value",
    ),
    "a row gone": (
        in_record("bench/bat-mass", lambda lines: lines[:-1]),
        "certificate.json",
        "bat.mass_kg",
    ),
    "records of two shots exchanged": (
        in_record("impact/gates", swapped),
        "certificate.json",
        "shots[0]",
    ),
    "a calibration": (
        in_session(constant(CALIBRATION, value=0.56)),
        "certificate.json",
        "metric.value",
    ),
    "the u of a calibration": (
        in_session(constant(CALIBRATION, u=1e-5)),
        "certificate.json",
        "metric.u",
    ),
    "another logo": (
        in_session(another_logo),
        "certificate.json",
        "particulars.laboratory.logo",
    ),
    "the due date of an instrument": (
        in_session(
            lambda session: session["particulars"]["instruments"]["pivot-gates"].update(
                due="2031-01-01"
            )
        ),
        "certificate.json",
        "particulars.instruments",
    ),
    "a word of the records that no result uses": (
        in_session(constant(CALIBRATION, source="recalibrated")),
        "certificate.json",
        "session_digest",
    ),
    "the sealing": (
        in_session(lambda session: session["simulation"].update(sealing="sealed")),
        "records/",
        "sha256",
    ),
    "another laboratory's records": (
        all_of(
            in_session(supplied),
            in_document(
                origin="supplied",
                laboratory="Crosstown Bat Laboratory",
                statement="Computed by this program from records supplied by Crosstown Bat "
                "Laboratory; not verified.",
                simulation=None,
            ),
            records_told_again,
        ),
        "records/",
        "sha256",
    ),
    "a control test that the records do not name": (
        in_session(lambda session: session.update(control_sha256="0" * 64)),
        "certificate.json",
        "session_digest",
    ),
    # alterations of the settings
    "another bat in the settings": (settings('bat = "ea70"'), "settings.toml", "bat"),
    "a procedure in the settings": (settings('procedure = "bbcor"'), "settings.toml", "procedure"),
    "another ball in the settings": (settings('ball = "other"'), "settings.toml", "ball"),
    "an option in the settings": (settings('motion = "pymunk"'), "settings.toml", "motion"),
    "settings that are no TOML": (settings("motion"), "settings.toml", "TOML"),
    # alterations of the truth
    "a file beside the truth": (
        lambda folder: (folder / "truth/more.json").write_text("{}"),
        "truth/more.json",
        "",
    ),
    "the truth exchanged": (
        lambda folder: (folder / "truth/truth.json").write_text("no JSON"),
        "truth/truth.json",
        "sha256",
    ),
    "the truth gone from its folder": (removed("truth/truth.json"), "truth/truth.json", ""),
    # folders of another program, as stated in the certificate
    "another version's number alone": (
        in_document(**OTHER),
        "certificate.html",
        "number",
    ),
    "a better value of another version": (
        in_all_forms(**OTHER, **BETTER),
        "certificate.json",
        "metric.value",
    ),
    "a smaller u of another version": (
        in_all_forms(**OTHER, metric__u=0.002),
        "certificate.json",
        "metric.u",
    ),
    "a better value of another version, its number on the page": (
        renumbered(**OTHER, **BETTER),
        "certificate.html",
        "metric",
    ),
    "e_A of a hit of another version": (
        in_all_forms(**OTHER, shots__3__recoil_efficiency=0.2),
        "certificate.json",
        "shots[3].recoil_efficiency",
    ),
    "a hit of another version that does not count": (
        in_all_forms(**OTHER, shots__3__used=False, shots__3__reason="too slow"),
        "certificate.json",
        "shots[3].used",
    ),
    "a flag of another version": (
        in_all_forms(
            **OTHER, flags=[{"name": "fog", "sentence": "Fog in the hall.", "invalidates": False}]
        ),
        "certificate.json",
        "flags",
    ),
    "another version's customer": (
        in_all_forms(**OTHER, particulars__customer__name="Nobody"),
        "certificate.json",
        "particulars.customer.name",
    ),
    "another version's bat": (
        in_all_forms(**OTHER, bat__name="ea70"),
        "certificate.json",
        "bat.name",
    ),
    "another version's ball": (
        in_all_forms(**OTHER, ball__name="softball-12"),
        "certificate.json",
        "ball.name",
    ),
    "another version's words": (
        in_all_forms(**OTHER, decision_rule="The bat is good."),
        "certificate.json",
        "decision_rule",
    ),
    "a bat 50 g heavier of another version": (
        all_of(
            in_record("bench/bat-mass", heavier),
            in_document(**OTHER),
            records_told_again,
        ),
        "certificate.json",
        "metric.value",
    ),
    "no records of another version": (
        all_of(in_all_forms(**OTHER), without_records),
        "records/session.json",
        "file",
    ),
    "a record edited of another version": (
        all_of(in_all_forms(**OTHER), edit("records/impact/gates.csv", "1", "2")),
        "records/impact/gates.csv",
        "sha256",
    ),
    "other records of another version": (
        all_of(in_all_forms(**OTHER), in_session(constant(CALIBRATION, source="anew"))),
        "certificate.json",
        "session_digest",
    ),
    "another version without SIMULATED": (
        all_of(
            renumbered(**OTHER, decision_rule="The bat is good."),
            every("certificate.html", "SIMULATED", "CERTIFIED"),
        ),
        "certificate.html",
        "statement",
    ),
    "another version without SIMULATED on its page alone": (
        all_of(in_all_forms(**OTHER), every("certificate.html", "SIMULATED", "CERTIFIED")),
        "certificate.html",
        "statement",
    ),
    "another version without the number": (
        in_document(**OTHER, decision_rule="The bat is good."),
        "certificate.html",
        "number",
    ),
    "another version of another verdict": (
        renumbered(**OTHER, verdict="FAIL", marginal=False, reasons=["too lively"]),
        "certificate.json",
        "verdict",
    ),
    "another version without verdict on the page": (
        all_of(
            renumbered(**OTHER, decision_rule="The bat is good."),
            every("certificate.html", "PASS", "GOOD"),
        ),
        "certificate.html",
        "verdict",
    ),
    "another version's PDF under another name": (
        all_of(
            renumbered(**OTHER, decision_rule="The bat is good."),
            lambda folder: pdf_of(folder).rename(folder / "certificate-0-SIMULATED.pdf"),
        ),
        "certificate-0-SIMULATED.pdf",
        "name",
    ),
    "no version": (
        in_document(versions={}),
        "certificate.html",
        "number",
    ),
    "a commit that is no text": (
        in_document(commit={"id": 5, "changes": []}),
        "certificate.json",
        "commit",
    ),
    "another commit alone": (
        in_document(commit={"id": "0" * 40, "changes": ""}),
        "certificate.html",
        "line",
    ),
    "a better value of another commit": (
        in_all_forms(commit={"id": "0" * 40, "changes": ""}, **BETTER),
        "certificate.json",
        "metric.value",
    ),
    "no list of digests": (removed(SUMS), SUMS, ""),
}


DIFFERS = {  # differences that another, possibly right, program may cause
    "a better value of another version",
    "a smaller u of another version",
    "e_A of a hit of another version",
    "a hit of another version that does not count",
    "a flag of another version",
    "another version's words",
    "a bat 50 g heavier of another version",
    "another commit alone",
    "a better value of another commit",
}


def test_at_least_sixty_alterations_are_tested() -> None:
    assert len(ALTERED) >= 60


FIRST = {
    file: alteration for alteration, (_, file, _) in reversed(ALTERED.items())
}  # alteration of each file


@pytest.mark.parametrize("alteration", ALTERED)
def test_every_alteration_is_named(made: Path, tmp_path: Path, alteration: str) -> None:
    """`verify` names file, key and both values, if any, also in a folder without the truth."""
    change, file, key = ALTERED[alteration]
    folder = shutil.copytree(made, tmp_path / "copy")
    change(folder)
    for truth in ("with", "without"):
        if truth == "without":
            if "truth" in alteration or alteration not in (*FIRST.values(), *DIFFERS):
                return
            shutil.rmtree(folder / "truth")
        sums_again(folder)
        found = verify(folder)
        expected = ("differs", 4) if alteration in DIFFERS else ("altered", 3)
        assert (found.state, found.code) == expected, found.text
        named = [row for row in found.rows if file in row.file and row.key.startswith(key)]
        assert named, found.text
        for row in named:
            assert row.stated != row.expected
        assert found.state in found.text


def test_the_checksums_reveal_any_altered_file(made: Path, tmp_path: Path) -> None:
    """The list reveals one byte more in any file, a missing file and an additional file."""
    folder = shutil.copytree(made, tmp_path / "copy")
    assert list(compared_sums(folder, ("truth",))) == []
    for path in [each for each in folder.rglob("*") if each.is_file() and each.name != SUMS]:
        name, content = path.relative_to(folder).as_posix(), path.read_bytes()
        path.write_bytes(content + b" ")
        assert [row.file for row in compared_sums(folder, ("truth",))] == [name]
        path.unlink()
        assert [row.file for row in compared_sums(folder, ("truth",))] == [name]
        path.write_bytes(content)
    (folder / "truth/more.json").write_text("{}")
    (row,) = compared_sums(folder, ("truth",))
    assert (row.file, row.stated) == ("truth/more.json", "is not listed in SHA256SUMS")


def better_ratio(session: dict[str, Any]) -> None:
    session["calibration"]["control.restitution_ratio"]["value"] *= 1.01


CONTROL: dict[
    str, tuple[Change, str, str]
] = {  # change, and the row (file and key) that `verify` must name
    "its page": (
        edit("control/certificate.html", "± ", "± 0"),
        "control/certificate.html",
        "line",
    ),
    "its value": (
        lambda folder: in_document(metric__value=0.4)(folder / "control"),
        "control/certificate.json",
        "metric.value",
    ),
    "its records gone": (
        lambda folder: without_records(folder / "control"),
        "control/records/session.json",
        "file",
    ),
    "its certificate gone": (
        removed("control/certificate.json"),
        "control/certificate.json",
        "file",
    ),
    "a record of it, told again": (
        lambda folder: all_of(in_record("bench/bat-mass", heavier), records_told_again)(
            folder / "control"
        ),
        "control/records/session.json",
        "sha256",
    ),
    "its truth exchanged": (
        lambda folder: (folder / "control/truth/truth.json").write_text("{}"),
        "control/truth/truth.json",
        "sha256",
    ),
    "the ratio that it gave, told again": (
        all_of(in_session(better_ratio), records_told_again),
        "records/session.json",
        "calibration.control.restitution_ratio.value",
    ),
    "not named by the records, told again": (
        all_of(in_session(lambda session: session.pop("control_sha256")), records_told_again),
        "control",
        "",
    ),
    "an empty folder": (
        all_of(lambda folder: shutil.rmtree(folder / "control"), empty_folder("control")),
        "control",
        "",
    ),
}


@pytest.mark.parametrize("alteration", [*CONTROL, "another's"])
def test_an_altered_or_exchanged_control_test_is_detected(
    controlled: Path, made: Path, tmp_path: Path, alteration: str
) -> None:
    folder = shutil.copytree(controlled, tmp_path / "copy")
    if alteration == "another's":
        shutil.rmtree(folder / "control")
        shutil.copytree(made, folder / "control")
        file, key = "control/records/session.json", "sha256"
    else:
        change, file, key = CONTROL[alteration]
        change(folder)
    sums_again(folder)
    found = verify(folder)
    assert (found.state, found.code) == ("altered", 3)
    assert [row for row in found.rows if row.file == file and row.key.startswith(key)], found.text


def test_a_control_bats_test_that_is_missing_was_not_checked(
    controlled: Path, tmp_path: Path
) -> None:
    """A renewed list does not name the control test, and a repeated reduction lacks it."""
    assert verify(controlled).state == "whole"
    folder = shutil.copytree(controlled, tmp_path / "copy")
    shutil.rmtree(folder / "control")
    for _ in range(2):
        found = verify(folder)
        assert (found.rows, found.code) == ((), 4), found.text
        assert found.unchecked == ("control: the folder is missing",)
        sums_again(folder)
    change = all_of(in_session(lambda session: session.pop("control_sha256")), records_told_again)
    change(folder)
    sums_again(folder)
    assert verify(folder).unchecked == ("control: the folder is missing",)


def in_second(change: Change) -> Change:
    return lambda folder: change(folder / "second")


def replaced_by(**values: object) -> Change:
    """Change what the second report states about the first, in its records and all forms."""

    def change(folder: Path) -> None:
        told = {f"particulars__replaces__{key}": value for key, value in values.items()}
        in_session(lambda session: session["particulars"]["replaces"].update(values))(folder)
        session = hashlib.sha256((folder / "records/session.json").read_bytes()).hexdigest()
        renumbered(**told, session_digest=session)(folder)

    return change


def other_report(folders: Path, bat: str, choices: dict[str, Any]) -> None:
    """Put another valid report in place of the first, and state it in the second."""
    shutil.rmtree(folders / "first")
    vl.certify(bat, seed=7, **choices).save(folders / "first")
    text = (folders / "first/certificate.json").read_text("utf-8")
    digest = hashlib.sha256(text.encode()).hexdigest()
    replaced_by(digest=digest, number=number_by_hand(text))(folders / "second")
    forms_again(folders / "second")


CHAINED: dict[
    str, tuple[Change, str, str]
] = {  # change, and the row (file and key) that `verify` must name
    "a folder above": (in_second(replaced_by(folder="../x")), "records", "replaces"),
    "the folder above": (in_second(replaced_by(folder="..")), "records", "replaces"),
    "this folder": (in_second(replaced_by(folder=".")), "records", "replaces"),
    "a folder above in the certificate alone": (
        in_second(renumbered(particulars__replaces__folder="../x")),
        "certificate.json",
        "particulars.replaces",
    ),
    "another digest": (
        in_second(replaced_by(digest="0" * 64)),
        "../first/certificate.json",
        "sha256",
    ),
    "another number": (in_second(replaced_by(number="0" * 12)), "../first", "number"),
    "a report on another bat": (
        lambda folder: other_report(folder, "ea70", {}),
        "../first/certificate.json",
        "bat.name",
    ),
    "a report by another procedure": (
        lambda folder: other_report(folder, "r161", {"procedure": "ncaa-besr"}),
        "../first/certificate.json",
        "procedure.name",
    ),
    "no report replaced": (
        in_second(renumbered(particulars__replaces=None)),
        "certificate.json",
        "particulars.replaces",
    ),
    "a record of the first": (
        edit("first/records/impact/gates.csv", "1", "2"),
        "../first/records/impact/gates.csv",
        "sha256",
    ),
    "the certificate of the first": (
        lambda folder: in_document(metric__u=0.001)(folder / "first"),
        "../first/certificate.json",
        "sha256",
    ),
    "another report in its place": (
        all_of(
            lambda folder: shutil.rmtree(folder / "first"),
            lambda folder: shutil.copytree(folder / "third", folder / "first"),
        ),
        "../first/certificate.json",
        "sha256",
    ),
}


@pytest.mark.parametrize("alteration", CHAINED)
def test_the_chain_of_replaced_reports_is_followed(
    chain: Path, tmp_path: Path, alteration: str
) -> None:
    change, file, key = CHAINED[alteration]
    folders = shutil.copytree(chain, tmp_path / "chain")
    change(folders)
    for each in folders.iterdir():
        sums_again(each)
    found = verify(folders / "second")
    assert (found.state, found.code) == ("altered", 3)
    assert [row for row in found.rows if row.file.startswith(file) and key in row.key], found.text


def test_a_replaced_report_of_another_program_differs_in_the_chain_too(
    chain: Path, tmp_path: Path
) -> None:
    folders = shutil.copytree(chain, tmp_path / "chain")
    in_all_forms(**OTHER, **BETTER)(folders / "first")
    text = (folders / "first/certificate.json").read_text("utf-8")
    digest = hashlib.sha256(text.encode()).hexdigest()
    replaced_by(digest=digest, number=number_by_hand(text))(folders / "second")
    forms_again(folders / "second")
    for each in folders.iterdir():
        sums_again(each)
    found = verify(folders / "second")
    assert (found.state, found.code) == ("differs", 4), found.text
    assert {row.file for row in found.rows} == {"../first/certificate.json"}
    assert "made by version 0.0.1" in found.note
