"""Answers that all web applications give: a page of one sentence, a sealed-off page, a file."""

from __future__ import annotations

from importlib.resources import files

from starlette.responses import HTMLResponse, Response
from starlette.routing import Route

from virtual_lab.output.template import page_template

KEPT = {"Cache-Control": "private, max-age=600"}  # header of responses that do not change
# a page with scripts or addresses of others shows nothing of them
SANDBOX = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    # otherwise a link back has no cookie, and nothing is printed
    "frame-ancestors 'self'; sandbox allow-same-origin allow-modals"
}
KINDS = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}


def sentence_page(
    status: int, sentence: str, *, title: str = "Not available", by_code: bool = False
) -> Response:
    """Return a page with a title and one sentence, both plain text.

    If `by_code`, the page also has a field in which the user enters a code.
    """
    page = page_template("virtual_lab.web", "plain.html")
    html = page.render(title=title, sentence=sentence, by_code=by_code)
    return HTMLResponse(html, status_code=status)


def static_routes(package: str, *names: str) -> list[Route]:
    """Return one route per file in the templates of a package, such as ``bench.css``."""

    def route(name: str) -> Route:
        content = files(package).joinpath("templates", name).read_bytes()
        kind = KINDS[name.rpartition(".")[2]]
        return Route(f"/{name}", lambda _: Response(content, media_type=kind, headers=KEPT))

    return [route(name) for name in names]
