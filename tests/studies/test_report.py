"""Reports of many certificates: kind of comparison, and content of each form."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import statistics
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from pypdf import PdfReader

import virtual_lab as vl
from tests.certificate.test_pdf import failed_rules
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from tests.laboratories import certified
from tests.pictures import lines_of
from virtual_lab.certificate.document import FlagRaised
from virtual_lab.certificate.filling import certificate
from virtual_lab.errors import InputError
from virtual_lab.studies.report import REPEATS, CertificateReport, ComparedCertificate

LABS = {"one": "Riverside", "two": "Hilltop"}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Save tests of two bats, two procedures, laboratories with and without names, and repeats."""
    folder = tmp_path_factory.mktemp("results")
    for kind in ("repeats", "unnamed", "bats", "procedures", "laboratories"):
        (folder / kind).mkdir()
    named = {"laboratory": {"name": "Riverside"}}
    for number in range(3):
        test = vl.certify("r161", seed=7, test=number, laboratory=named)
        test.save(folder / "repeats" / f"n{number}")
    for number in (1, 2):
        vl.certify("r161", seed=7, number=number).save(folder / "unnamed" / f"n{number}")
    vl.certify("ea70", seed=7).save(folder / "bats" / "ea70")
    vl.certify("r161", seed=7, laboratory={"bat": {"serial": "S1"}}).save(folder / "bats" / "r161")
    vl.certify("r161", procedure="ncaa-besr", seed=7).save(folder / "procedures" / "besr")
    vl.certify("r161", seed=7).save(folder / "procedures" / "astm")
    for number, (key, name) in enumerate(LABS.items()):
        lab = folder / f"{key}.toml"
        lab.write_text(f'[laboratory]\nname = "{name}"\n')
        test = vl.certify("r161", seed=7, number=number, laboratory=lab)
        test.save(folder / "laboratories" / key)
    return folder


@pytest.mark.parametrize(
    ("folder", "kind"),
    [
        ("bats", "bats by one procedure"),
        ("procedures", "one bat by several procedures"),
        ("laboratories", "laboratories of one bat design"),
        ("unnamed", "one bat design by one procedure, laboratories not told apart"),
        ("repeats", "the same bat, procedure and laboratory, as far as stated"),
    ],
)
def test_the_report_names_its_comparison(results: Path, folder: str, kind: str) -> None:
    found = vl.report(results / folder)
    assert found.kind == kind
    assert kind in found.title
    assert kind in found.page
    assert found.document["comparison"] == kind
    assert "SIMULATED" in found.text
    assert "SIMULATED" in found.page


def test_certificates_that_differ_in_more_than_one_way_are_refused_by_name(results: Path) -> None:
    with pytest.raises(InputError) as refused:
        vl.report([results / "bats", results / "procedures"])
    said = str(refused.value)
    for name in ("bats: ea70 in ea70, r161 S1 in r161", "procedures: astm-f1881 in ea70, ncaa-"):
        assert name in said
    assert "\n" not in said


def test_the_scatter_of_laboratories_is_compared_with_the_stored_study(results: Path) -> None:
    said = (
        "Simulated laboratories that test the same bat scatter by s_R 0.0061 (virtual-lab interlab,"
    )
    assert said in vl.report(results / "laboratories").text
    assert "interlab" not in vl.report(results / "repeats").text
    assert "interlab" not in vl.report(results / "unnamed").text


def test_laboratories_without_a_name_are_not_told_apart(results: Path) -> None:
    """One named laboratory among them settles nothing; two different names do."""
    said = "{} of {} certificates name no laboratory"
    unnamed = vl.report(results / "unnamed")
    assert said.format(2, 2) in unnamed.text
    assert any("mean of 2 results" in each for each in unnamed.words)
    one = vl.report([results / "unnamed", results / "laboratories" / "one"])
    assert (one.kind, said.format(2, 3) in one.text) == (unnamed.kind, True)
    two = vl.report([results / "unnamed", results / "laboratories"])
    assert two.kind == "laboratories of one bat design"


def test_a_copy_is_no_repeat(results: Path, tmp_path: Path) -> None:
    """The same test with another customer's name is no repeat either."""
    copy = shutil.copytree(results / "repeats" / "n0", tmp_path / "copy")
    document = json.loads((copy / "certificate.json").read_text("utf-8"))
    document["particulars"]["customer"]["name"] = "another"
    (copy / "certificate.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"copy: records; are also those of .*n0") as refused:
        vl.report([results / "repeats", copy])
    assert "\n" not in str(refused.value)


def test_every_form_says_that_nothing_was_verified(results: Path, tmp_path: Path) -> None:
    found = vl.report(results / "bats", pdf=True)
    pdf = PdfReader(found.save(tmp_path / "report") / "report.pdf")
    forms = [found.text, found.page, json.dumps(found.document), pdf.pages[0].extract_text()]
    assert all("as stated in the certificates, not verified" in each for each in forms)


def test_a_name_without_glyphs_costs_no_report(results: Path, tmp_path: Path) -> None:
    """The PDF shows code points instead, and says so."""
    found = vl.report(results / "bats", pdf=True)
    odd = replace(
        found, rows=(replace(found.rows[0], laboratory_name="中文 1\u20e3"), *found.rows[1:])
    )
    (sheet,) = PdfReader(odd.save(tmp_path / "report") / "report.pdf").pages
    text = re.sub(r"\s+", "", sheet.extract_text())
    assert "[U+4E2D][U+6587]1[U+20E3]" in text
    assert "printedascodepoints" in text


def test_repeats_scatter_as_their_values_do(results: Path) -> None:
    """The oracle: mean and standard deviation of the certificates by the standard library."""
    found = vl.report(results / "repeats")
    values = [vl.load(results / "repeats" / f"n{number}").value for number in range(3)]
    (said,) = (each for each in found.words if "mean of" in each)
    assert f"BPF {statistics.fmean(values):.4f} is the mean of 3" in said
    assert f"standard deviation is {statistics.stdev(values):.2g}" in said
    assert not any("mean of" in each for each in vl.report(results / "bats").words)


def compared(**known: Any) -> ComparedCertificate:
    empty = dict.fromkeys((each.name for each in fields(ComparedCertificate)), None)
    told = {"certificate": "1", "folder": "f", "verdict": "PASS", "marginal": False}
    told |= {"metric": "e", "unit": "", "flag_names": ""}
    return ComparedCertificate(**(empty | told | known))


def test_the_scatter_is_stated_relative_to_the_rms_of_u() -> None:
    """Values .1 and .3, s = .1 √2; u .1 and .7, whose root mean square is .5 and mean .4."""
    rows = tuple(compared(value=value, u=u) for value, u in ((0.1, 0.1), (0.3, 0.7)))
    found = CertificateReport(kind=REPEATS, rows=rows, statement="")
    (said,) = (each for each in found.words if "mean of" in each)
    assert said == (
        "e 0.2000 is the mean of 2 results; their standard deviation is 0.14, which is 0.28 times "
        "their rms u."
    )


def test_a_row_has_the_certificates_numbers_in_the_unit_of_its_metric() -> None:
    """The ASA's limit is 85 mph; risk and flags stand beside it."""
    document = certificate(certified("softball-34", procedure="asa", seed=7).certification)
    flag = FlagRaised(name="balls-mixed", sentence="x", invalidates=False)
    row = ComparedCertificate.of(replace(document, flags=(flag,)), "f")
    metric = document.metric
    assert metric.interval_95 is not None
    stated = (metric.value, metric.u, *metric.interval_95)
    shown = (row.value, row.u, row.low, row.high)
    assert [each and each * 0.44704 for each in shown] == pytest.approx(stated)
    assert (row.limit, row.unit, row.metric) == (pytest.approx(85), "mph", "v_f")
    assert document.risk is not None
    assert row.risk == document.risk.probability
    assert (row.flag_names, row.valid_hits) == ("balls-mixed", document.valid_hits)


def test_an_invalid_test_states_no_value() -> None:
    """Its hits have a metric, but it is no result: no row, figure or mean uses it."""
    document = certificate(certified(seed=7).certification)
    invalid = replace(document, verdict="INVALID", reasons=("x",), risk=None)
    sound, row = (ComparedCertificate.of(each, "f") for each in (document, invalid))
    assert (row.value, row.u, row.low, row.high, row.risk) == (None,) * 5
    assert (row.result, sound.value) == ("none", document.metric.value)
    found = CertificateReport(kind=REPEATS, rows=(sound, row), statement="")
    assert found.words[0] == "1 PASS, 1 INVALID."
    assert not any("mean of" in each for each in found.words)
    assert len(re.findall(r"<circle", found.svg)) == 1


def test_the_picture_has_every_result(results: Path) -> None:
    found = vl.report(results / "laboratories")
    assert lines_of(found.plot()) == [(row.low, row.value, row.high) for row in found.rows]
    (limit,) = {row.limit for row in found.rows}
    assert found.plot().axes[0].lines[0].get_xdata() == [limit, limit]


def test_every_form_has_every_certificate(results: Path, tmp_path: Path) -> None:
    """CSV, page, figure and PDF, which conforms to PDF/UA."""
    found = vl.report(results / "laboratories", pdf=True, paper="letter")
    folder = found.save(tmp_path / "report")
    assert {path.name for path in folder.iterdir()} == {
        "report.csv",
        "report.html",
        "report.pdf",
        "report.svg",
        "settings.toml",
    }
    rows = list(csv.DictReader((folder / "report.csv").read_text("utf-8").splitlines()))
    page = (folder / "report.html").read_text("utf-8")
    ElementTree.fromstring(page)
    pdf = (folder / "report.pdf").read_bytes()
    assert failed_rules(pdf, "ua1") == set()
    (sheet,) = PdfReader(io.BytesIO(pdf)).pages
    assert round(sheet.mediabox.width) == 612
    text = re.sub(r"\s+", " ", sheet.extract_text())
    for row in rows:
        for form in (page, text):
            assert row["certificate"] in form
            assert row["laboratory_name"] in form
        assert float(row["low"]) < float(row["value"]) < float(row["high"])
    assert [row["laboratory_name"] for row in rows] == ["Riverside", "Hilltop"]


def test_the_figure_shows_results_and_limit_to_scale(results: Path) -> None:
    """The figure has one interval per row, with its ends to scale."""
    found = vl.report(results / "repeats")
    lines = re.findall(r'<path d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)" fill="none"', found.svg)
    spans = [(float(a), float(b)) for a, y, b, z in lines if y == z]
    rows = found.rows
    assert len(spans) == len(rows)
    assert rows[0].high is not None
    assert rows[0].low is not None
    scale = (spans[0][1] - spans[0][0]) / (rows[0].high - rows[0].low)
    for row, (low, high) in zip(rows, spans, strict=True):
        assert high - low == pytest.approx(scale * (row.high - row.low), abs=0.03)


def test_a_folder_without_a_result_is_named(results: Path, tmp_path: Path, run: Run) -> None:  # noqa: F811
    with pytest.raises(InputError, match="allowed: two or more certificates"):
        vl.report(results / "bats" / "ea70")
    with pytest.raises(InputError, match=r"certificate\.json; not found in this folder"):
        vl.report([results / "bats", tmp_path])
    code, _, err = run("report", str(tmp_path / "nowhere"), str(results / "bats"))
    assert code == 2
    assert "nowhere" in err
    code, out, _ = run("report", str(results / "bats"), "--out", str(tmp_path / "out"))
    assert code == 0
    assert "2 certificates: bats by one procedure" in out
    assert (tmp_path / "out" / "report.html").exists()
