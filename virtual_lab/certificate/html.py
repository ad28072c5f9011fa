"""The certificate as a page to read and print, and as a card for a notebook."""

from __future__ import annotations

from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.figures import certificate_figures
from virtual_lab.certificate.printed import printed_result, printed_values
from virtual_lab.output.template import page_template

PACKAGE = "virtual_lab.certificate"


def certificate_page(document: CertificateDocument, paper: str = "a4") -> str:
    """Return the certificate as one self-contained HTML page for paper ``a4`` or ``letter``.

    The page contains no script and loads no other file.
    """
    from markupsafe import Markup

    # this package draws the figures and escapes their text
    figures = {name: svg and Markup(svg) for name, svg in certificate_figures(document).items()}
    return page_template(PACKAGE, "certificate.html").render(
        document=document, paper=paper, **printed_values(document), **figures
    )


def notebook_card(document: CertificateDocument) -> str:
    """Return verdict and result as a short HTML text for the output cell of a notebook."""
    return page_template(PACKAGE, "card.html").render(
        document=document, result=printed_result(document)
    )
