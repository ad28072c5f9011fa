"""A check of the built pages: no script, style, font or picture comes from elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

LOADED = re.compile(
    r"<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc\s*=\s*[\"']?(?:https?:)?//[^>]*"
    r"|<link\b(?![^>]*rel=[\"']?(?:canonical|author|license))[^>]*href\s*=\s*[\"']?(?:https?:)?//[^>]*"
    r"|@import\s+(?:url\()?[\"']?(?:https?:)?//[^;]*"
    r"|url\(\s*[\"']?(?:https?:)?//[^)]*"
    r"|\bimport\s*\(?\s*[\"']https?://[^\"']*"
)


def remote_resources(folder: Path) -> list[str]:
    """Return the places in built pages at which a page loads something from another site.

    `folder` holds the built pages. Each item has the path of a file and the text at the place in
    this file, at most 120 characters. The list is empty if there are no such places.
    """
    return [
        f"{path.relative_to(folder)}: {match[0][:120]}"
        for path in sorted(folder.rglob("*"))
        if path.suffix in {".html", ".css", ".js", ".svg"}
        for match in LOADED.finditer(path.read_text("utf-8"))
    ]


def _refuse(app: Sphinx, failure: Exception | None) -> None:
    if failure is None and (remote := remote_resources(Path(app.outdir))):
        raise ValueError("loaded from elsewhere:\n" + "\n".join(remote))


def setup(app: Sphinx) -> dict[str, bool]:
    """Let Sphinx check after the build that no page loads anything from another site.

    The result states that Sphinx may process pages in parallel.
    """
    app.connect("build-finished", _refuse)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
