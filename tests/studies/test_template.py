"""Forms of every procedure: empty, they name what is missing; filled in, they reduce."""

from __future__ import annotations

import io
import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.cli.test_cli import Run, run  # noqa: F401 a fixture
from virtual_lab import catalog
from virtual_lab.api import reduce
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.foreign.laboratory import load_laboratory
from virtual_lab.records.particulars import read_particulars
from virtual_lab.records.session import Session
from virtual_lab.studies import foreign
from virtual_lab.studies import template as forms
from virtual_lab.studies.plan.prices import Prices
from virtual_lab.studies.template import template

PROCEDURES = catalog.names("procedures")
HAS_TO_BE_FILLED = re.compile(r"""^"?([\w.]+)"? = .*"\?\"""", re.MULTILINE)

our_session = cache(foreign.our_session)


@pytest.fixture(autouse=True)
def _each_procedure_played_once(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (foreign, forms):
        monkeypatch.setattr(module, "our_session", our_session)


def fill_in(folder: Path, session: Session) -> None:
    """Fill in a form from a session, as with an editor."""
    path = folder / "laboratory.toml"
    text = path.read_text("utf-8").replace("\r\n", "\n")
    for key, known in session.calibration.items():
        old = f'"{key}" = {{ value = "?"'
        assert text.count(old) == 1
        text = text.replace(old, f'"{key}" = {{ value = {known.value!r}')
        text = re.sub(
            f'^("{re.escape(key)}".*) u = "\\?"', f"\\1 u = {known.u!r}", text, flags=re.M
        )
    path.write_text(text.replace('"?"', '"x"').replace('bat = "x"', f'bat = "{session.bat}"'))
    for stage, records in session.records.items():
        for channel, record in records.items():
            sheet = folder / stage / f"{channel}.csv"
            header = sheet.read_text().splitlines()[0].split(",")
            record.table()[header].to_csv(sheet, index=False)


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_an_empty_form_lists_what_it_lacks(procedure: str, tmp_path: Path) -> None:
    """All lines with a question mark, by number and key, and then none."""
    path = template(procedure, tmp_path / "form") / "laboratory.toml"
    text = path.read_text("utf-8")
    due = set(HAS_TO_BE_FILLED.findall(text))
    assert {"bat", *our_session(procedure).calibration} < due
    with pytest.raises(InputError, match="not filled in") as caught:
        load_laboratory(path.parent)
    found = re.findall(r"line (\d+): (?:rigs\.|calibration\.)?([\w.]+)", str(caught.value))
    assert {key for _, key in found} == due
    assert len(found) == len(due)
    for number, key in found:
        assert text.splitlines()[int(number) - 1].removeprefix('"').startswith(key)
    path.write_text(text.replace('"?"', "1"), "utf-8")
    with pytest.raises(InputError) as caught:
        load_laboratory(path.parent)
    assert "not filled in" not in str(caught.value)


def test_all_tables_without_numbers_are_listed_at_once(tmp_path: Path) -> None:
    folder = template("astm-f1881", tmp_path / "form")
    session = our_session("astm-f1881")
    fill_in(folder, session)
    for name in ("bench/bat-mass.csv", "impact/gates.csv"):
        table = folder / name
        table.write_text(table.read_text("utf-8").splitlines()[0] + "\n", "utf-8")
    with pytest.raises(InputError, match="2 tables; cannot be used:") as caught:
        load_laboratory(folder)
    assert "bat-mass.csv" in str(caught.value)
    assert "gates.csv" in str(caught.value)


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_a_form_filled_in_gives_the_same_numbers(procedure: str, tmp_path: Path) -> None:
    """Values of a simulated session, written into the form, give the same numbers."""
    session = our_session(procedure)
    expected = certify_session(session)
    folder = template(procedure, tmp_path / "form")
    fill_in(folder, session)
    found = reduce(folder).certification
    assert found.verdict is expected.verdict
    assert found.quantities.keys() == expected.quantities.keys()
    for name, budget in expected.quantities.items():
        assert found.quantities[name].value == budget.value
        assert found.quantities[name].u == budget.u


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_the_tables_have_their_index_columns(procedure: str, tmp_path: Path) -> None:
    """Tables have one row per shot, gate and reading (long ones the first row), without values."""
    folder = template(procedure, tmp_path / "form")
    for stage, records in our_session(procedure).records.items():
        for channel, record in records.items():
            form = pd.read_csv(io.StringIO((folder / stage / f"{channel}.csv").read_text()))
            full = record.table()
            assert list(form.columns) == list(full.columns)
            assert len(form) == (1 if len(full) > 1000 else len(full))
            for name in form.columns:
                if form[name].notna().any():
                    np.testing.assert_array_equal(form[name], full[name].head(len(form)))
            assert set(record.sizes()) <= set(form.columns[form.notna().all()])
            assert form.columns[form.isna().all()].size


def test_the_first_empty_table_of_a_form_is_named(tmp_path: Path) -> None:
    """If only the form is filled in, the first table is named."""
    folder = template("astm-f1881", tmp_path / "form")
    tables = {path: path.read_text() for path in folder.glob("*/*.csv")}
    fill_in(folder, our_session("astm-f1881"))
    load_laboratory(folder)
    for path, text in tables.items():
        filled = path.read_text()
        path.write_text(text)
        with pytest.raises(InputError, match="no numbers yet") as caught:
            load_laboratory(folder)
        assert caught.value.where == str(path)
        path.write_text(filled)


def left_out(folder: Path, channel: str, constants: str = "") -> None:
    """Delete a channel's block and file, and the constants that begin with a name, as advised."""
    path = folder / "laboratory.toml"
    block = rf"^\[channels\.bench\.{channel}\]\nrecord = .*\nfile = .*\n"
    text, blocks = re.subn(block, "", path.read_text(), flags=re.M)
    assert blocks == 1
    if constants:
        text, lines = re.subn(rf'^"{re.escape(constants)}.*\n', "", text, flags=re.M)
        assert lines > 0
    path.write_text(text)
    (folder / "bench" / f"{channel}.csv").unlink()


def test_optional_tables_and_lines_are_left_out_as_the_form_says(tmp_path: Path) -> None:
    """The logger's constants are needed until neither climate nor store is left."""
    folder = template("astm-f1881", tmp_path / "form")
    text = (folder / "laboratory.toml").read_text("utf-8")
    assert text.count("To leave it out") == 3
    assert len(re.findall(r"optional: delete this line", text)) == 2
    assert text.count("place_m has no effect") == 1
    fill_in(folder, our_session("astm-f1881"))
    path = folder / "laboratory.toml"
    path.write_text(re.sub(r"^(customer|date) = .*\n", "", path.read_text(), flags=re.M))
    left_out(folder, "reference-mass")
    left_out(folder, "climate")
    reduce(folder)
    logged = path.read_text()
    path.write_text(re.sub(r'^"bench\.climate.*\n', "", logged, flags=re.M))
    with pytest.raises(InputError, match=r"missing: bench\.climate\.temperature"):
        reduce(folder)
    path.write_text(logged)
    left_out(folder, "store", "bench.climate.")
    reduce(folder)


def test_a_place_of_a_wall_shot_has_no_effect(tmp_path: Path) -> None:
    session = our_session("astm-f1881")
    expected = certify_session(session)
    folder = template("astm-f1881", tmp_path / "form")
    fill_in(folder, session)
    log = pd.read_csv(folder / "balls" / "log.csv")
    log.assign(place_m=0).to_csv(folder / "balls" / "log.csv", index=False)
    found = reduce(folder).certification
    assert {name: (each.value, each.u) for name, each in found.quantities.items()} == {
        name: (each.value, each.u) for name, each in expected.quantities.items()
    }


def uncomment(text: str) -> tuple[str, int]:
    """Remove the # before each table and each key with a value, and count these lines."""
    return re.subn(r'^# (?=\[|[\w."-]+ = )', "", text, flags=re.M)


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_each_optional_line_of_a_form_can_be_used(procedure: str, tmp_path: Path) -> None:
    """Each line that a # sign hides is accepted without it, and the records are reduced."""
    session = our_session(procedure)
    folder = template(procedure, tmp_path / "form")
    fill_in(folder, session)
    path = folder / "laboratory.toml"
    text, lines = uncomment(path.read_text("utf-8"))
    used = 'value = 1.2, unit = "mm", u = 0.1'
    text = text.replace('bat_construction = ""', 'bat_construction = "composite wood"')
    path.write_text(text.replace('value = "x", unit = "m", u = "x"', used), "utf-8")
    added = load_laboratory(folder).calibration.keys() - session.calibration.keys()
    assert added == {"balls.gates.thickness", "impact.gates.thickness"}
    assert lines == len(added)
    found = reduce(folder).certification
    assert found.session.calibration["impact.gates.thickness"].value == pytest.approx(1.2e-3)
    assert found.session.bat_construction == "composite wood"
    assert found.quantities.keys() == certify_session(session).quantities.keys()


def test_each_optional_line_of_the_other_forms_can_be_used(tmp_path: Path) -> None:
    for name, tables in (("laboratory", {"authorised_by", "instruments"}), ("prices", set())):
        path = template(name, tmp_path / f"{name}.toml")
        before = parse_toml(path.read_text("utf-8"), name)
        text, lines = uncomment(path.read_text("utf-8"))
        text = text.replace('name = ""\nrole = ""', 'name = "A"\nrole = "B"')
        text = text.replace("value = 0", "value = 1").replace('source = ""', 'source = "x"')
        path.write_text(text, "utf-8")
        assert parse_toml(text, name).keys() - before.keys() == tables
        assert lines > 0
    assert read_particulars(tmp_path / "laboratory.toml").instruments.keys() == {"gates"}
    offers = Prices.read(path).offers(path, ["bench", "ball-wall", "astm-pivot"])
    assert offers.keys() == {"pivot-gates"}


def test_a_procedure_file_is_copied_to_the_form(tmp_path: Path) -> None:
    rules = tmp_path / "mine.toml"
    text = catalog.text("procedures", "astm-f1881").replace(
        "\nballs = { value = 12", "\nballs = { value = 7"
    )
    rules.write_text(text)
    folder = template(str(rules), tmp_path / "form")
    assert (folder / "procedure.toml").read_text() == text
    assert 'procedure = "procedure.toml"' in (folder / "laboratory.toml").read_text()
    assert len((folder / "bench" / "ball-mass.csv").read_text().splitlines()) == 1 + 7 * 5


def test_the_command_writes_a_form_that_lists_its_gaps(run: Run, tmp_path: Path) -> None:  # noqa: F811
    assert run("template", "astm-f1881", "form")[:2] == (0, "empty, to fill in: form\n")
    assert (tmp_path / "form" / "laboratory.toml").is_file()
    assert json.loads(run("template", "astm-f1881", "json", "--json")[1]) == {"folder": "json"}
    code, out, err = run("template", "astm-f1881", "form")
    assert (code, out) == (2, "")
    assert "is a folder of records" in err
    assert "allowed: a new folder" in err
    code, out, err = run("template", "astm-f1882", "other")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "did you mean astm-f1881" in err
    assert {path.name for path in tmp_path.iterdir()} == {"form", "json"}
    code, _, err = run("reduce", "form")
    assert code == 2
    first, second, *others = err.splitlines()
    assert first == "virtual-lab: form/laboratory.toml: 40 lines; not filled in yet ('?'):"
    assert (second, len(others)) == ("  line 5: laboratory", 39)
