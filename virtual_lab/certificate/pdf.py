"""The certificate as PDF/UA-1 and PDF/A-3a, with certificate.json attached.

Typst sets it; its wheel brings all fonts, so the same document gives the same bytes everywhere.
"""

from __future__ import annotations

import datetime
import json
import re
from importlib.resources import files
from typing import Any

from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.figures import certificate_figures
from virtual_lab.certificate.printed import printed_values
from virtual_lab.errors import InputError, of_extra
from virtual_lab.output.svg import description_of
from virtual_lab.records.logo import picture_in

PAPERS = {"a4": "a4", "letter": "us-letter"}  # as people say it, and Typst
NO_GLYPH = re.compile(r'the text `"(.+?)"` could not be displayed')
MOST_ODD = 500  # characters that no font has, before the form is given up


def pdf_name(document: CertificateDocument) -> str:
    """Return the file's name, which says what the certificate is worth."""
    kind = "SIMULATED" if document.simulation else "not-verified"
    return f"certificate-{document.number}-{kind}.pdf"


def require_paper(paper: str) -> None:
    """Raise `InputError` for an unknown paper."""
    if paper not in PAPERS:
        raise InputError("", "paper", paper, f"allowed: {', '.join(PAPERS)}")


def require_pdf(paper: str) -> None:
    """Raise `InputError` for an unknown paper, or where the extra that sets it is missing."""
    require_paper(paper)
    _typst()


def certificate_pdf(document: CertificateDocument, paper: str = "a4") -> bytes:
    """Return the certificate as PDF; `InputError` as `require_pdf`.

    Characters that no font of Typst has stand as code points, and the page says so.
    """
    require_paper(paper)
    typst = _typst()
    source, view = source_of_pdf(), _view(document)
    odd: set[str] = set()
    while True:
        try:
            found: bytes = typst.compile(
                source,
                format="pdf",
                sys_inputs=_inputs(document, view, odd, paper),
                pdf_standards=["ua-1", "a-3a"],
                ignore_system_fonts=True,
            )
        except Exception as fault:
            lacking = set("".join(NO_GLYPH.findall(str(fault)))) - odd
            if not lacking or len(odd) > MOST_ODD:
                raise
            odd |= lacking
        else:
            return found


def source_of_pdf() -> bytes:
    """Return the template that Typst sets."""
    return (files("virtual_lab.certificate") / "templates" / "certificate.typ").read_bytes()


def inputs_of_pdf(document: CertificateDocument, paper: str = "a4") -> dict[str, str]:
    """Return what the template is given, for a document whose characters all have glyphs."""
    return _inputs(document, _view(document), set(), paper)


def _inputs(
    document: CertificateDocument, view: dict[str, Any], odd: set[str], paper: str
) -> dict[str, str]:
    shown = {**_spelled(view, odd), "code_points": bool(odd)}
    return {"view": json.dumps(shown), "document": document.text, "paper": PAPERS[paper]}


def _typst() -> Any:
    return of_extra("typst", "pdf", "a certificate as PDF")


def _view(document: CertificateDocument) -> dict[str, Any]:
    """Return all that the template shows."""
    figures = certificate_figures(document)
    return {
        "document": {**document.as_json(), "contact_sheet": None, "encoder": None},
        **printed_values(document),
        **figures,
        "day": _day(document),
        "logo": _logo(document.particulars.laboratory.logo),
        "not_stated": document.particulars.not_stated,
        "alts": {name: description_of(svg) for name, svg in figures.items() if svg},
    }


def _logo(address: str) -> dict[str, Any] | None:
    """Return kind and content of a logo as the template takes them."""
    if not address:
        return None
    kind, data = picture_in(address)
    return {"kind": kind, "data": data.decode() if kind == "svg" else list(data)}


def _day(document: CertificateDocument) -> list[int]:
    """Return year, month and day of the document, which PDF/A asks for."""
    course = document.particulars.test
    for text in (course.issued, course.ended, course.begun, document.date):
        try:
            day = datetime.date.fromisoformat(text)
        except ValueError:  # not stated, or written otherwise
            continue
        return [day.year, day.month, day.day]
    return [1970, 1, 1]


def _spelled(value: Any, odd: set[str]) -> Any:
    """Return texts with the characters that no font has as code points."""
    if isinstance(value, str):
        return "".join(f"[U+{ord(each):04X}]" if each in odd else each for each in value)
    if isinstance(value, dict):
        return {key: _spelled(each, odd) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_spelled(each, odd) for each in value]
    return value
