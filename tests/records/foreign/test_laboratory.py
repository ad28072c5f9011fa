"""Records of another laboratory reduce to the known answer; each fault gives one line."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.cli.test_cli import Run, run  # noqa: F401 a fixture
from tests.foreign_laboratory.make import ANSWER, RECORDS
from virtual_lab.api import reduce
from virtual_lab.certificate.filling import certificate
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records import EncoderRecord
from virtual_lab.records.foreign.laboratory import LaboratoryForm, load_laboratory
from virtual_lab.records.foreign.table import ChannelForm
from virtual_lab.records.origin import Supplied

KNOWN = json.loads(ANSWER.read_text())
QUANTITIES = [name for name in KNOWN if name != "verdict"]


@pytest.mark.parametrize("name", QUANTITIES)
def test_foreign_records_reduce_to_the_known_answer(name: str) -> None:
    """The rounding of the recorders changes the result by u/50; the truth lies within 2 u."""
    budget = reduce(RECORDS).certification.quantities[name]
    known = KNOWN[name]
    assert abs(budget.value - known["value"]) < 0.02 * known["u"]
    assert budget.u == pytest.approx(known["u"], rel=0.02)
    assert abs(budget.value - known["true"]) < 2 * budget.u


def test_names_and_sources_are_kept() -> None:
    session = load_laboratory(RECORDS)
    assert session.origin == Supplied(
        laboratory="Crosstown Bat Laboratory", customer="Ashwood & Sons"
    )
    assert (session.bat, session.ball, session.date) == ("r161", "baseball-2003", "2026-11-20")
    assert session.rigs == {"bench": "bench", "balls": "ball-wall", "impact": "astm-pivot"}
    assert session.calibration["bench.scale.span"].source == "certificate 4411"


def test_the_command_reduces_and_saves_foreign_records(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """The saved records are in our format and SI, and reduce to the same numbers."""
    code, out, _ = run("reduce", str(RECORDS), "--out", "theirs", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["verdict"] == KNOWN["verdict"]
    said = "Computed by this program from records supplied by Crosstown Bat Laboratory"
    assert document["statement"] == f"{said}; not verified."
    assert (document["origin"], document["simulation"]) == ("supplied", None)
    assert document["laboratory"] == "Crosstown Bat Laboratory"
    page = (tmp_path / "theirs/certificate.html").read_text("utf-8")
    assert "<dd>Virtual laboratory, from the records supplied</dd>" in page
    assert "<dt>Laboratory</dt><dd>Crosstown Bat Laboratory</dd>" in page
    assert page.count(said) == 1
    assert "Computed from supplied records, not verified" in page  # at the foot of each page
    assert "<dt>Customer</dt><dd>Ashwood &amp; Sons</dd>" in page
    known = KNOWN["bat_performance_factor"]
    assert abs(document["metric"]["value"] - known["value"]) < 0.02 * known["u"]
    again = json.loads(run("reduce", "theirs/records", "--json")[1])
    assert document.pop("folder") == "theirs"
    assert again == document
    kept = json.loads((tmp_path / "theirs/records/session.json").read_text())
    assert kept["laboratory"] == "Crosstown Bat Laboratory"
    assert kept["calibration"]["bench.scale.span"]["source"] == "certificate 4411"
    assert not (tmp_path / "theirs/truth").exists()


def test_recorders_that_stamp_with_unix_time_change_nothing(tmp_path: Path) -> None:
    """Times of 1.8e9 s have steps of 2.4e-7 s in a computer, 1/400 of a step of the encoder."""
    shutil.copytree(RECORDS, tmp_path, dirs_exist_ok=True)
    expected = reduce(tmp_path).certification.metric
    for name, header, digits, unit in (
        ("gates.csv", "time_us", 0, 1e-6),
        ("encoder.csv", "t [ms]", 1, 1e-3),
    ):
        table = pd.read_csv(tmp_path / name, encoding="utf-8-sig")
        stamps = [f"{time + 1_764_300_000 / unit:.{digits}f}" for time in table[header]]
        stamps = [stamp if stamp != "nan" else "" for stamp in stamps]
        table.assign(**{header: stamps}).to_csv(tmp_path / name, index=False)
    found = reduce(tmp_path).certification.metric
    assert abs(found.value - expected.value) < 0.01 * expected.u
    assert found.u == pytest.approx(expected.u, rel=0.01)
    lines = (tmp_path / "encoder.csv").read_text("utf-8").splitlines()
    (tmp_path / "encoder.csv").write_text("\n".join(lines[:300] + lines[340:]), "utf-8")
    with pytest.raises(InputError, match=r"step after sample 298 = 0\.0041; must be 0\.0001 s"):
        reduce(tmp_path)


def test_a_signed_counter_that_starts_again_changes_nothing() -> None:
    """A 16-bit counter steps from 32767 to -32768 in every record; the plot is unchanged, too."""
    session = load_laboratory(RECORDS)
    encoder = session.records["impact"]["encoder"]
    assert isinstance(encoder, EncoderRecord)
    counts = (encoder.counts + 32_700 + 32_768) % 65_536 - 32_768
    impact = {**session.records["impact"], "encoder": replace(encoder, counts=counts)}
    signed = replace(session, records={**session.records, "impact": impact})
    whole, found = certify_session(session), certify_session(signed)
    assert found.metric.value == pytest.approx(whole.metric.value, rel=1e-10)
    assert found.metric.u == pytest.approx(whole.metric.u, rel=1e-10)
    plots = [certificate(each).encoder.turn for each in (whole, found)]
    known, shown = (np.array(plot.angle_deg) for plot in plots)
    assert shown - shown[0] == pytest.approx(known - known[0], abs=1e-5)


Change = Callable[[Path], object]


def _form(old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        path = folder / "laboratory.toml"
        text = path.read_text("utf-8")
        assert re.search(old, text, re.MULTILINE)
        path.write_text(re.sub(old, new, text, count=1, flags=re.MULTILINE), "utf-8")

    return change


def _both(*changes: Change) -> Change:
    return lambda folder: [change(folder) for change in changes]


def _more(constant: str) -> Change:
    """Add a constant to the form."""
    return _form(
        '^"ball.radius"', f'"{constant}" = {{ value = 1, unit = "1", u = 0 }}\n"ball.radius"'
    )


def _no_line(start: str) -> Change:
    return _form(f"^{re.escape(start)}.*\n", "")


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (_form('^bat = "r161"', 'bat = "?"'), ["line 5: bat; not filled in"]),
        (_form("^bat = ", "bats = 1\nbat = "), ["bats", "unknown key"]),
        (_no_line("bat ="), ["bat", "missing"]),
        (_no_line("laboratory ="), ["laboratory", "missing"]),
        (_no_line("ball ="), ["ball", "missing"]),
        (_form("index_from = 1", "index_from = 2"), ["index_from", "0 or 1"]),
        (_form("index_from = 1", "index_from = "), ["TOML", "parsed"]),
        (_form('"astm-f1881"', '"astm-f1991"'), ["laboratory.toml", "did you mean astm-f1881"]),
        (_form('"astm-f1881"', '"house.toml"'), ["house.toml", "no such file"]),
        (_form('"balls.csv"', '"none.csv"'), ["none.csv", "cannot be read"]),
        (_form('columns = { item = "ball" }', "colums = 3"), ["bench.ball-mass", "colums"]),
        (_form('record = "pendulum"', 'record = "swings"'), ["record", "swings", "pendulum"]),
        (
            _form('^("balls.gates.distance_0".*)"in"', r'\1"oz"'),
            ["balls.gates.distance_0.unit", "oz", "um"],
        ),
        (
            _both(_no_line('"bench.rule.offset"'), _no_line('"impact.gates.clock"')),
            ["missing: bench.rule.offset, impact.gates.clock"],
        ),
        (
            _form("bench.rule.offset", "bench.ruler.offset"),
            ["missing: bench.rule.offset", "unknown: bench.ruler.offset"],
        ),
        (
            _more("impact.gate.clock"),
            ["impact.gate.clock", "did you mean impact.gates.clock"],
        ),
        (
            _both(_more("impact.gates.distance_2"), _form('(_2.*unit = )"1"', r'\1"in"')),
            ["impact/gates: gates = 2", "the calibration has distances of 3"],
        ),
        (
            _form('clock" = { value = 1,', 'clock" = { value = 0,'),
            ["clock", "0.5 to 2", "laboratory.toml"],
        ),
        (_form('pivot.from_knob" = { value = 6', 'pivot.from_knob" = { value = 7'), ["pivot_from"]),
        (_form(r"^\[channels.impact.aim\]", "[channels.impact.marks]"), ["impact/aim", "missing"]),
        (lambda f: (f / "laboratory.toml").write_bytes(b"\xff"), ["laboratory.toml", "UTF-8"]),
        (lambda f: (f / "session.json").write_text("{}"), ["session.json", "keep only one"]),
    ],
)
def test_every_fault_of_foreign_records_is_named_in_one_line(
    break_it: Change,
    words: list[str],
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    """The command ends with code 2 and one line that names the fault, and writes nothing."""
    shutil.copytree(RECORDS, tmp_path / "theirs")
    break_it(tmp_path / "theirs")
    code, out, err = run("reduce", "theirs", "--out", "mine")
    assert (code, out, err.count("\n")) == (2, "", 1)
    for word in words:
        assert word in err
    assert [path.name for path in tmp_path.iterdir()] == ["theirs"]


def test_a_procedure_file_beside_the_form_is_used(tmp_path: Path) -> None:
    """A procedure file beside the form, with Windows line ends; its faults name the file."""
    from virtual_lab import catalog

    shutil.copytree(RECORDS, tmp_path / "theirs")
    _form('"astm-f1881"', '"house.toml"')(tmp_path / "theirs")
    rules = catalog.text("procedures", "astm-f1881")
    strict = rules.replace("limit = { value = 1.2", "limit = { value = 0.9")
    path = tmp_path / "theirs" / "house.toml"
    path.write_bytes(b"\xef\xbb\xbf" + strict.replace("\n", "\r\n").encode())
    assert reduce(tmp_path / "theirs").verdict == "FAIL"
    path.write_text(rules.replace("limit =", "limits ="))
    with pytest.raises(InputError, match=r"house.toml: limit"):
        reduce(tmp_path / "theirs")


def test_a_form_written_on_windows_is_read(tmp_path: Path) -> None:
    shutil.copytree(RECORDS, tmp_path / "theirs")
    path = tmp_path / "theirs" / "laboratory.toml"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_text("utf-8").replace("\n", "\r\n").encode())
    assert load_laboratory(tmp_path / "theirs").bat == "r161"


def test_records_of_an_unknown_rig_can_be_reduced(tmp_path: Path) -> None:
    """For a rig unknown here, the first missing constant is still named."""
    from virtual_lab import catalog

    shutil.copytree(RECORDS, tmp_path / "theirs")
    _form('"astm-f1881"', '"house.toml"')(tmp_path / "theirs")
    rules = catalog.text("procedures", "astm-f1881").replace('"astm-pivot"', '"their-pivot"')
    (tmp_path / "theirs" / "house.toml").write_text(rules)
    known = KNOWN["restitution"]
    found = reduce(tmp_path / "theirs").certification.quantities["restitution"]
    assert abs(found.value - known["value"]) < 0.02 * known["u"]
    _no_line('"impact.encoder.scale"')(tmp_path / "theirs")
    with pytest.raises(InputError, match=r"laboratory.toml: calibration.impact.encoder.scale"):
        reduce(tmp_path / "theirs")


def test_the_page_of_the_form_has_every_key() -> None:
    """The page lists every key of a channel and of a laboratory."""
    page = Path(__file__).parents[3] / "virtual_lab" / "docs" / "forms.md"
    section = page.read_text("utf-8")
    for form in (ChannelForm, LaboratoryForm):
        for field in fields(form):
            assert re.search(rf"`{field.name}`|^{field.name} =|^\[{field.name}", section, re.M), (
                field
            )
