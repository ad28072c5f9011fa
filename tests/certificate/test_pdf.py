"""The certificate as PDF: conforming, repeatable, and equal to the document."""

from __future__ import annotations

import io
import json
import re
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import page as validator
import pytest
from pypdf import PdfReader

import virtual_lab as vl
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from tests.laboratories import certified
from virtual_lab.api import Certificate
from virtual_lab.certificate import html as html_module
from virtual_lab.certificate import pdf as pdf_module
from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.pdf import certificate_pdf, pdf_name
from virtual_lab.certificate.printed import NONE, printed_values
from virtual_lab.certificate.seal import compared_seal
from virtual_lab.certificate.text import certificate_text
from virtual_lab.errors import IncompleteError, InputError
from virtual_lab.records.particulars import NOTHING_STATED, Customer, particulars_of


@pytest.fixture(scope="module")
def document() -> CertificateDocument:
    return certificate(certified().certification)


@pytest.fixture(scope="module")
def pdf(document: CertificateDocument) -> bytes:
    return certificate_pdf(document)


def text_of(pdf: bytes) -> str:
    pages = PdfReader(io.BytesIO(pdf)).pages
    text = re.sub(r"\s+", " ", " ".join(each.extract_text() for each in pages))
    return text.replace("\N{SOFT HYPHEN}", "-")  # ligature: one glyph for two letters


def failed_rules(pdf: bytes, profile: str) -> set[str]:
    """Return the rules of a profile that a PDF breaks, by the validator and for lengths by us.

    The validator takes a CR that is the last byte of a stream for a part of the end of line after
    it, and so miscounts the stream.
    """
    report = validator.validate_pdf_bytes(pdf, profile=profile)
    rules = {str(each.rule_id) for each in report.failures}
    lengths = {rule for rule in rules if rule.endswith("-STREAM-LENGTH-001")}
    if lengths and b"\r\nendstream" in pdf and _streams_have_their_lengths(pdf):
        rules -= lengths
    return rules


def _streams_have_their_lengths(pdf: bytes) -> bool:
    """Return whether each stream ends where its dictionary says, with one end of line."""
    objects = re.finditer(rb"\n\d+ 0 obj\s*<<(.*?)>>\s*stream\r?\n", pdf, re.DOTALL)
    lengths = [(each.end(), re.search(rb"/Length (\d+)", each[1])) for each in objects]
    return len(lengths) == len(re.findall(rb"\nendstream\n", pdf)) and all(
        length and re.match(rb"\r?\nendstream\n", pdf[start + int(length[1]) :][:12])
        for start, length in lengths
    )


def with_customer(name: str) -> CertificateDocument:
    particulars = replace(NOTHING_STATED, customer=Customer(name=name))
    return replace(certificate(certified().certification), particulars=particulars)


@pytest.mark.parametrize("profile", ["ua1", "3a"])
def test_the_pdf_conforms_to_its_profiles(pdf: bytes, profile: str) -> None:
    """The validator passes the corpus of veraPDF, and refuses a PDF with a tag removed."""
    assert failed_rules(pdf, profile) == set()
    untagged = pdf.replace(b"/MarkInfo", b"/XarkInfo")
    assert untagged != pdf
    assert failed_rules(untagged, profile)


def test_a_stream_that_is_longer_than_stated_breaks_a_rule(pdf: bytes) -> None:
    lengths = list(re.finditer(rb"/Length (\d+)", pdf))
    for stated in (lengths[0], lengths[-1]):
        shorter = pdf.replace(stated[0], b"/Length %d" % (int(stated[1]) - 1), 1)
        assert failed_rules(shorter, "3a")


def test_the_same_document_gives_the_same_bytes(document: CertificateDocument, pdf: bytes) -> None:
    assert certificate_pdf(document) == pdf
    assert certificate_pdf(document, "letter") != pdf


@pytest.mark.parametrize(("paper", "size"), [("a4", (595, 842)), ("letter", (612, 792))])
def test_the_paper_is_the_one_asked_for(
    document: CertificateDocument, paper: str, size: tuple[int, int]
) -> None:
    box = PdfReader(io.BytesIO(certificate_pdf(document, paper))).pages[0].mediabox
    assert (round(box.width), round(box.height)) == size


def test_the_document_is_attached(document: CertificateDocument, pdf: bytes) -> None:
    attached = PdfReader(io.BytesIO(pdf)).attachments
    assert attached["certificate.json"] == [document.text.encode()]


def test_every_page_bears_number_word_and_count(document: CertificateDocument, pdf: bytes) -> None:
    number = printed_values(document)["number"]
    pages = PdfReader(io.BytesIO(pdf)).pages
    for n, each in enumerate(pages, start=1):
        text = each.extract_text()
        assert f"certificate {number}, page {n} of {len(pages)}" in text
        assert "SIMULATED" in text
        assert len(text) > 500
    assert pdf_name(document) == f"certificate-{number}-SIMULATED.pdf"


def test_the_pdf_says_the_same_as_the_page(document: CertificateDocument, pdf: bytes) -> None:
    """Every printed value is in the text of the PDF, table cells included."""
    shown, printed = text_of(pdf), printed_values(document)

    def texts(value: Any) -> list[str]:
        if isinstance(value, dict):
            return [text for each in value.values() for text in texts(each)]
        if isinstance(value, list):
            return [text for each in value for text in texts(each)]
        return [value] if isinstance(value, str) else []

    hidden = {"", NONE, printed["conditions"]["bat"]}  # no bat is swung by astm-f1881
    for text in set(texts(printed)) - hidden:
        assert text in shown or text.replace("_", "") in shown, (
            text
        )  # an index is set as a subscript
    assert document.conditional_on in shown
    assert "Limit of BPF: 1.200. The test has 6 valid hits." in shown


def test_a_logo_appears_on_page_and_pdf(document: CertificateDocument, tmp_path: Path) -> None:
    """Both forms conform with a logo; the page runs and loads nothing."""
    cv2.imwrite(str(tmp_path / "logo.png"), np.full((30, 50, 4), 99, np.uint8))
    stated = {"laboratory": {"name": "Bat Laboratory", "logo": "logo.png"}}
    particulars = particulars_of(stated, "lab.toml", folder=tmp_path)
    shown = replace(document, particulars=particulars)
    pdf, page = certificate_pdf(shown), certificate_page(shown)
    for profile in ("ua1", "3a"):
        assert failed_rules(pdf, profile) == set()
    assert len(pdf) > len(certificate_pdf(replace(shown, particulars=NOTHING_STATED)))
    (address,) = re.findall(r'<img src="([^"]+)" alt="Logo of Bat Laboratory"', page)
    assert address.startswith("data:image/")
    assert "img-src data:" in page
    assert "img-src" not in certificate_page(document)


def test_markup_in_a_name_is_text(pdf: bytes) -> None:
    """Markup of Typst, TeX and HTML is not interpreted."""
    name = r'#panic("x") *bold* _it_ $x$ <b> \ [a] @ref "q" // no /* no */'
    shown = text_of(certificate_pdf(with_customer(name)))
    assert name.replace(" ", "") in shown.replace(" ", "")  # a line may break anywhere


def test_scripts_that_the_font_has_are_set() -> None:
    name = "Le\u0301on Müller & Søn Ωμέγα Привет ﺎﻟﻌﺮﺒﻳﺓ שלום देवनागरी"
    assert "[U+" not in text_of(certificate_pdf(with_customer(name)))


def test_characters_without_a_glyph_are_code_points_and_said() -> None:
    document = with_customer("中文 ไทย 🏏 Ltd")
    pdf = certificate_pdf(document)
    shown = text_of(pdf)
    assert "[U+4E2D][U+6587]" in shown
    assert "[U+1F3CF] Ltd" in shown
    assert "printed as code points" in shown
    (attached,) = PdfReader(io.BytesIO(pdf)).attachments["certificate.json"]
    assert attached == document.text.encode()
    assert "中文" in certificate_text(document)


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("No 1\ufe0f\u20e3 Ltd", "No 1[U+FE0F][U+20E3] Ltd"),  # keycap; the font has the digit
        ("ก็ Bats", "[U+0E01][U+0E47] Bats"),
        ("👩\u200d👧 Bats", "[U+1F469][U+200D][U+1F467] Bats"),
    ],
)
def test_a_mark_without_a_glyph_leaves_its_base(name: str, shown: str) -> None:
    """Typst reports base and mark together; figures keep their markup."""
    text = text_of(certificate_pdf(with_customer(name)))
    assert shown.replace(" ", "") in text.replace(" ", "")


class Panic(BaseException):
    """A panic like Typst's, which is not an Exception."""


def test_a_form_that_fails_costs_nothing_else(
    tmp_path: Path,
    run: Run,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """For a sealed test the command ends with code 4, one line, and a whole folder."""

    def fails(*_: object) -> bytes:
        raise Panic("index out\nof bounds")

    monkeypatch.setattr(pdf_module, "certificate_pdf", fails)
    code, out, err = run("certify", "r161", "--pdf", "--out", str(tmp_path / "sealed"))
    assert code == 4
    *progress, said = err.splitlines()
    assert all(line.startswith("… ") for line in progress)  # time limit on a loaded machine
    assert json.loads((tmp_path / "sealed" / "certificate.json").read_text())["session_digest"]
    assert re.search(
        r"sealed was saved without certificate-\S+-SIMULATED\.pdf \(Panic: index out of bounds\)$",
        said,
    )
    assert out.splitlines()[-1] == str(tmp_path / "sealed")
    assert not list((tmp_path / "sealed").glob("*.pdf"))
    assert not [*compared_seal(tmp_path / "sealed")]
    assert run("verify", str(tmp_path / "sealed"))[0] == 0

    test = Certificate(certification=certified().certification, film=fails)
    monkeypatch.setattr(html_module, "certificate_page", fails)
    with pytest.raises(IncompleteError, match=r"without certificate.html \(.*; film \(Panic"):
        test.save(tmp_path / "bare")
    assert sorted(path.name for path in (tmp_path / "bare").iterdir()) == [
        "SHA256SUMS",
        "certificate.json",
        "datapackage.json",
        "readings.csv",
        "records",
        "ro-crate-metadata.json",
    ]


def test_save_writes_the_pdf_on_request(tmp_path: Path, document: CertificateDocument) -> None:
    test = Certificate(certification=certified().certification)
    test.save(tmp_path / "without")
    test.save(tmp_path / "with", pdf=True)
    assert not list((tmp_path / "without").glob("*.pdf"))
    (path,) = (tmp_path / "with").glob("*.pdf")
    printed = vl.load(tmp_path / "with").printed
    assert path.read_bytes() == certificate_pdf(printed)
    assert printed.versions == test.printed.versions | {"typst": version("typst")}
    with pytest.raises(InputError, match="paper = 'a5'; allowed: a4, letter"):
        test.save(tmp_path / "a5", pdf=True, paper="a5")
    assert not (tmp_path / "a5").exists()


def test_a_missing_extra_is_named_in_one_line(
    document: CertificateDocument, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(InputError, match=r"a certificate as PDF needs the extra 'pdf'; .*\[pdf\]"):
        certificate_pdf(document)
