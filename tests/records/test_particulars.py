"""Particulars of a report are read, checked, stored with the records, and printed."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.conftest import PROCEDURE
from tests.laboratories import certified
from virtual_lab import lab
from virtual_lab.catalog.reading import DATA
from virtual_lab.certificate.document import document_of
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.text import certificate_text
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.records.particulars import (
    NOTHING_STATED,
    Particulars,
    particulars_of,
    read_particulars,
)
from virtual_lab.records.session import load_session, save_session

FILE = """
[laboratory]
name = "Bat Laboratory"
address = "1 Test Road"
[bat]
serial = "SN 2"
received = 2026-11-20
[customer]
name = "Müller & Søn <x>"
[test]
begun = "2026-11-24"
[authorised_by]
name = "A. Nonymous"
role = "manager"
[instruments.gates]
identity = "G-12"
due = 2026-11-23
"""


@pytest.fixture
def stated(tmp_path: Path) -> Particulars:
    path = tmp_path / "lab.toml"
    path.write_text(FILE, encoding="utf-8")
    return read_particulars(path)


def with_particulars(stated: Particulars) -> Certification:
    session = certified().certification.session
    return certify_session(replace(session, particulars=stated))


def test_particulars_are_read_from_a_file(stated: Particulars) -> None:
    assert stated.bat.serial == "SN 2"
    assert stated.bat.received == "2026-11-20"
    assert stated.customer.name == "Müller & Søn <x>"
    assert read_particulars(None) == NOTHING_STATED


def test_the_empty_form_has_every_key_and_states_nothing() -> None:
    """Keys in comments count, too: authoriser and instruments may not be empty."""
    text = (DATA / "forms" / "laboratory.toml").read_text("utf-8")
    assert particulars_of(parse_toml(text, "form"), "form") == NOTHING_STATED
    filled = re.sub(r'^#? ?(\w+) = ""', r'\1 = "2026-11-25"', text, flags=re.MULTILINE)
    filled = filled.replace('logo = "2026-11-25"', 'logo = ""')  # a picture, no words
    every = particulars_of(parse_toml(filled.replace("# [", "["), "form"), "form")
    assert every.list_missing() == []
    (instrument,) = every.instruments.values()
    assert "" not in (instrument.identity, instrument.due, instrument.traceability)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"bat": {"serail": "1"}}, "lab: bat.serail; unknown key, did you mean serial"),
        ({"bats": {}}, "lab: bats; unknown key, did you mean bat"),
        ({"bat": {"received": "tomorrow"}}, "bat.received = 'tomorrow'; must be a day such as"),
        ({"bat": {"received": 20261120}}, "bat.received = 20261120"),
        ({"customer": {"name": "x" * 500}}, "must be one line of up to 200 printable"),
        ({"customer": {"name": "a\x07b"}}, "must be one line of up to 200 printable"),
        ({"customer": {"name": "a\N{SOFT HYPHEN}b"}}, "must be one line of up to 200 printable"),
        ({"customer": {"name": "a\N{ZERO WIDTH SPACE}b"}}, "must be one line of up to 200"),
        ({"customer": {"name": "a\N{LINE SEPARATOR}b"}}, "must be one line of up to 200 printable"),
        ({"authorised_by": {"name": "", "role": "x"}}, "authorised_by; needs a name and a role"),
        ({"authorised_by": {"name": "x"}}, "authorised_by.role; this key is missing"),
        ({"instruments": {"gates": {"due": "2026-01-01"}}}, "instruments.gates.identity"),
        (
            {"bat": {"received": "2026-11-25"}, "test": {"issued": "2026-11-24"}},
            "test.issued = '2026-11-24'; allowed: 2026-11-25 (bat.received) or later",
        ),
        (
            {"test": {"begun": "2026-11-25", "ended": "2026-11-24"}},
            "test.ended = '2026-11-24'; allowed: 2026-11-25 (test.begun) or later",
        ),
    ],
)
def test_an_invalid_statement_is_refused_in_one_line(
    document: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError) as refused:
        particulars_of(document, "lab")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_zero_width_characters_in_a_name_are_kept() -> None:
    """A Persian company with U+200C, a family of emoji with U+200D."""
    for name in ("شرکت نمونه\u200cسازی", "👩\u200d👧 Bats"):
        assert particulars_of({"customer": {"name": name}}, "lab").customer.name == name


def test_particulars_stay_with_the_records(stated: Particulars, tmp_path: Path) -> None:
    """Records without particulars have no such key."""
    session = certified().certification.session
    for particulars in (stated, NOTHING_STATED):
        folder = tmp_path / str(bool(particulars.stated))
        folder.mkdir()
        save_session(replace(session, particulars=particulars), folder)
        assert load_session(folder).particulars == particulars
        written = json.loads((folder / "session.json").read_text(encoding="utf-8"))
        assert ("particulars" in written) == bool(particulars.stated)


def test_page_and_text_name_stated_and_missing_particulars(stated: Particulars) -> None:
    document = certificate(with_particulars(stated))
    assert document_of(json.loads(document.text), "certificate.json") == document
    text, page = certificate_text(document), certificate_page(document)
    for value in ("Bat Laboratory", "1 Test Road", "SN 2", "2026-11-20", "2026-11-24", "G-12"):
        assert value in text
        assert value in page
    assert "Müller & Søn <x>" in text
    assert "Müller &amp; Søn &lt;x&gt;" in page
    for shown in (text, page):
        assert "A. Nonymous, manager (SIMULATED)" in shown
        assert "address of the customer, maker of the bat" in shown.split("Not stated: ")[1]
        assert "PG-1" not in shown  # of the data sheets
        assert "SN 1" not in shown
    nothing = certificate(certified().certification)
    assert "Not stated: laboratory, address of the laboratory" in certificate_page(nothing)
    assert "Not stated" not in certificate_text(nothing)


def test_instruments_of_a_file_are_added_to_those_of_the_data_sheets(stated: Particulars) -> None:
    """An instrument with the name of a data sheet replaces it."""

    def named(particulars: Particulars) -> dict[str, str]:
        setup = lab.TestSetup.of("r161", procedure=PROCEDURE, particulars=particulars)
        return {name: each.identity for name, each in setup.particulars.instruments.items()}

    built_in = named(NOTHING_STATED)
    assert len(built_in) > 5
    assert named(stated) == built_in | {"gates": "G-12"}
    own = replace(stated, instruments={"pivot-gates": stated.instruments["gates"]})
    assert named(own) == built_in | {"pivot-gates": "G-12"}


@pytest.mark.parametrize(("due", "flagged"), [("2026-11-23", True), ("2026-11-24", False)])
def test_a_calibration_that_was_due_before_the_test_is_a_flag(
    stated: Particulars, due: str, flagged: bool
) -> None:
    """The flag is a remark; the verdict does not change."""
    gates = replace(stated.instruments["gates"], due=due)
    found = with_particulars(replace(stated, instruments={"gates": gates}))
    flags = {flag.name: flag for flag in found.flags}
    assert ("calibration-due" in flags) == flagged
    assert found.verdict == certified().certification.verdict
    if flagged:
        assert flags["calibration-due"].sentence == (
            "the calibration of gates (G-12) was due on 2026-11-23, but the test was on 2026-11-24"
        )
    page = certificate_page(certificate(found))
    assert ("was overdue for calibration may have drifted" in page) == flagged
    assert ("records are inconsistent" in page) == bool(flags.keys() - {"calibration-due"})
