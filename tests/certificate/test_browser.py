"""The certificate's page in a real browser: axe-core, sizes, themes and printing."""

from __future__ import annotations

import io
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from pypdf import PdfReader

from tests.bench.browsing import faults_of, opened
from tests.certificate.test_html import case
from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.pdf import certificate_pdf
from virtual_lab.records.particulars import Particulars, particulars_of

LOOKS = [(320, "light"), (320, "dark"), (1280, "dark"), (1280, "light")]
CASES = ("pass", "scan with fresh hits", "no valid hit", "all stated", "scan without a limit")
SHORT = ("scan with fresh hits", "all stated")  # case in the suite; the others are marked long
EACH = [each if each in SHORT else pytest.param(each, marks=pytest.mark.long) for each in CASES]
PRINTED = [pytest.param(each, marks=[pytest.mark.long] * (each != SHORT[0])) for each in CASES]
STATED = {
    "laboratory": {"name": "Bat Laboratory", "address": "1 Test Road"},
    "customer": {"name": "中文 棒球 " * 8, "address": "Ωμέγα"},
    "bat": {"serial": "S" * 60, "condition": "new", "received": "2026-11-20"},
    "test": {"begun": "2026-11-21", "ended": "2026-11-22", "issued": "2026-11-23"},
    "authorised_by": {"name": "A. Nonymous", "role": "manager"},
}


@cache
def document(name: str) -> CertificateDocument:
    found = certificate(case("pass" if name == "all stated" else name))
    if name != "all stated":
        return found
    stated: Particulars = particulars_of(STATED, "lab.toml")
    return replace(found, particulars=replace(stated, instruments=found.particulars.instruments))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened() as browser:
        yield browser


@pytest.mark.parametrize("look", [0, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", EACH)
def test_axe_finds_nothing_and_nothing_is_cut_off(browser: Any, name: str, look: int) -> None:
    """On a phone and a screen, light and dark; horizontal scrolling is a fault."""
    page = browser.new_page()
    complaints: list[str] = []
    page.on("console", lambda line: complaints.append(line.text))
    page.set_content(certificate_page(document(name)))
    width, theme = LOOKS[(CASES.index(name) + look) % len(LOOKS)]
    page.set_viewport_size({"width": width, "height": 900})
    page.emulate_media(color_scheme=theme)
    found = faults_of(page)
    page.close()
    assert not found
    assert [each for each in complaints if "axe" not in each.lower()] == []


def of_print(browser: Any, name: str, paper: str) -> list[str]:
    """Return the text of each sheet that the browser prints."""
    page = browser.new_page()
    page.set_content(certificate_page(document(name), paper))
    data = page.pdf(prefer_css_page_size=True)
    page.close()
    return texts(data)


def texts(pdf: bytes) -> list[str]:
    pages = PdfReader(io.BytesIO(pdf)).pages
    found = (
        unicodedata.normalize("NFKC", each.extract_text()) for each in pages
    )  # ligatures of the font
    return [re.sub(r"\s+", " ", each) for each in found]


@pytest.mark.parametrize("paper", ["a4", pytest.param("letter", marks=pytest.mark.long)])
@pytest.mark.parametrize("name", PRINTED)
def test_every_page_in_print_is_named_and_full(browser: Any, name: str, paper: str) -> None:
    """In the browser's print and in the PDF, no sheet is empty or holds only the end mark."""
    shown = document(name)
    number = shown.number
    for pages in (of_print(browser, name, paper), texts(certificate_pdf(shown, paper))):
        for at, text in enumerate(pages, start=1):
            assert "SIMULATED" in text
            assert f"certificate {number}, page {at} of {len(pages)}" in text
            assert len(text) > 500
        assert "Provenance" in pages[-1]
        assert pages[-1].count("End of certificate") == 1
        for wanted in ("Result", shown.verdict, "Identification"):
            assert wanted in pages[0]
