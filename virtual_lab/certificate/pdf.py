"""The certificate as PDF/UA-1 and PDF/A-3a, with certificate.json attached.

Typst typesets it. Typst's wheel contains all fonts, so the same document gives the same bytes on
every computer.
"""

from __future__ import annotations

import datetime
import json
import re
from importlib.resources import files
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any
from unicodedata import category

from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.figures import certificate_figures
from virtual_lab.certificate.printed import printed_values
from virtual_lab.errors import InputError, of_extra
from virtual_lab.files import read_bytes
from virtual_lab.output.svg import description_of
from virtual_lab.records.logo import picture_in

PAPERS = {"a4": "a4", "letter": "us-letter"}  # paper size: name in Typst
NO_GLYPH = re.compile(r'the text `"(.+?)"` could not be displayed')
ESCAPED = re.compile(r"\\u\{([0-9a-f]+)\}")  # escaped character in a message of Typst
MARKS = ("Mn", "Me", "Mc", "Cf")  # categories of characters that change their neighbors
MOST_UNPRINTABLE = 500  # largest number of characters without a glyph


def pdf_name(document: CertificateDocument) -> str:
    """Return the file name of the PDF, such as ``certificate-0123456789ab-SIMULATED.pdf``.

    The name contains the number of the certificate. Then follows ``SIMULATED`` for a simulated
    test, and ``not-verified`` for any other test.
    """
    kind = "SIMULATED" if document.simulation else "not-verified"
    return f"certificate-{document.number}-{kind}.pdf"


def require_paper(paper: str) -> None:
    """Raise `InputError` for a paper size other than ``a4`` and ``letter``."""
    if paper not in PAPERS:
        raise InputError("", "paper", paper, f"allowed: {', '.join(PAPERS)}")


def require_pdf(paper: str) -> None:
    """Raise `InputError` for an unknown paper size, or if the extra ``pdf`` is not installed.

    The paper sizes are ``a4`` and ``letter``.
    """
    require_paper(paper)
    _typst()


def certificate_pdf(document: CertificateDocument, paper: str = "a4") -> bytes:
    """Return the certificate as a PDF file for paper ``a4`` or ``letter``.

    A character that is in no font of Typst is printed as its code point, and the certificate states
    this. Raises `InputError` for another paper size, if the extra ``pdf`` is not installed, and if
    Typst fails.
    """
    require_paper(paper)
    typst = _typst()
    attached = {"document": document.text, "paper": PAPERS[paper]}
    return typeset(typst, source_of_pdf(), _view(document), attached, ["ua-1", "a-3a"])


def typeset(
    typst: Any,
    source: bytes,
    view: dict[str, Any],
    others: dict[str, str],
    standards: list[str],
) -> bytes:
    """Return the bytes of the PDF that Typst makes from a template.

    A character that is in no font is printed as its code point. Raises `InputError` if Typst fails.

    Parameters
    ----------
    typst
        The imported module ``typst``.
    source
        The Typst template.
    view
        Values of the template, which are passed as JSON.
    others
        Further inputs of the template, keyed by name.
    standards
        Names of the PDF standards to meet, such as ``ua-1``.
    """
    unprintable: set[str] = set()
    while True:
        printable = _dump_view(view, unprintable)
        try:
            pdf: bytes = typst.compile(
                source,
                format="pdf",
                sys_inputs={"view": printable, **others},
                pdf_standards=standards,
                ignore_system_fonts=True,
            )
        except Exception as fault:
            lacking = _missing_glyphs(str(fault), printable) - unprintable
            if not lacking or len(unprintable) > MOST_UNPRINTABLE:
                message = " ".join(f"cannot be set by Typst ({fault})".split())
                raise InputError("", "PDF", None, message) from fault
            unprintable |= lacking
        else:
            return pdf


def _missing_glyphs(refusal: str, printable: str) -> set[str]:
    """Return the characters of a string without a glyph, from Typst's error message.

    If the message names a base character with combining marks, only the marks are returned, because
    the font may have the base character. If the message names only an ASCII character, which every
    font has, the marks that follow it in the text are returned.
    """
    characters = set[str]()
    for escaped in NO_GLYPH.findall(refusal):
        text = ESCAPED.sub(lambda code: chr(int(code[1], 16)), escaped)
        marks = {each for each in text if category(each) in MARKS}
        if text.isascii():
            behind = (each for base, each in pairwise(printable) if base in text)
            marks = {each for each in behind if category(each) in MARKS}
        characters |= marks or {each for each in text if not each.isascii()}
    return characters


def text_of_pdf(path: Path) -> str:
    """Return the text of a PDF with single spaces; "" if it cannot be read.

    Raises `InputError` if there is no such file, or if the extra ``pdf`` is not installed.
    """
    pypdf = of_extra("pypdf", "pdf", "the text of a PDF")
    try:
        pages = pypdf.PdfReader(BytesIO(read_bytes(path))).pages
        return " ".join(" ".join(page.extract_text() for page in pages).split())
    except InputError:
        raise
    except Exception:  # the file may be anything
        return ""


def source_of_pdf() -> bytes:
    """Return the Typst template of the certificate, as bytes."""
    return (files("virtual_lab.certificate") / "templates" / "certificate.typ").read_bytes()


def inputs_of_pdf(document: CertificateDocument, paper: str = "a4") -> dict[str, str]:
    """Return the inputs of the Typst template, keyed by name.

    Characters are passed as they are, even if no font of Typst has them. `paper` is ``a4`` or
    ``letter``. Raises `KeyError` for another paper size.
    """
    printable = _dump_view(_view(document), set())
    return {"view": printable, "document": document.text, "paper": PAPERS[paper]}


def _dump_view(view: dict[str, Any], unprintable: set[str]) -> str:
    return json.dumps(
        {**_spell_out(view, unprintable), "code_points": bool(unprintable)}, ensure_ascii=False
    )


def _typst() -> Any:
    return of_extra("typst", "pdf", "a certificate as PDF")


def _view(document: CertificateDocument) -> dict[str, Any]:
    """Return all that the template shows."""
    figures = certificate_figures(document)
    logo = document.particulars.laboratory.logo
    return {
        "document": {**document.as_json(), "contact_sheet": None, "encoder": None},
        **printed_values(document),
        **figures,
        "day": _day(document),
        "logo": list(picture_in(logo)) if logo else None,
        "alts": {name: description_of(svg) for name, svg in figures.items() if svg},
    }


def _day(document: CertificateDocument) -> list[int]:
    """Return year, month and day of the document. PDF/A requires them."""
    course = document.particulars.test
    for text in (course.issued, course.ended, course.begun, document.date):
        try:
            day = datetime.date.fromisoformat(text)
        except ValueError:  # not stated, or in another format
            continue
        return [day.year, day.month, day.day]
    return [1970, 1, 1]


def _spell_out(value: Any, unprintable: set[str]) -> Any:
    """Return `value` with each unprintable character in its strings replaced by its code point."""
    if isinstance(value, str):
        return "".join(f"[U+{ord(each):04X}]" if each in unprintable else each for each in value)
    if isinstance(value, dict):
        return {key: _spell_out(each, unprintable) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_spell_out(each, unprintable) for each in value]
    return value
