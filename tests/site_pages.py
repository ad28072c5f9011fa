"""Accessibility of the built site, page by page, at two widths and in both themes.

    python -m tests.site_pages out/site [PART ...]

The command opens each page in a Chromium of the machine and prints what axe-core finds (contrast
below 4.5, pictures without alternative text, headings out of order, …) and each page that must be
scrolled sideways. Empty headers of tables are left out: a column of row names needs no header. With
PART the command checks only pages whose path contains one of these texts. The exit code is 1 if it
finds anything.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.bench.browsing import faults_of, opened

LOOKS = [(width, theme) for width in (390, 1280) for theme in ("light", "dark")]


def findings(site: Path, parts: Sequence[str]) -> Iterator[str]:
    """Yield page, width, theme and finding, one text per finding."""
    pages = [
        path
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts
        and (not parts or any(part in str(path.relative_to(site)) for part in parts))
    ]
    if not pages:
        raise SystemExit(f"{site}: no such pages")
    with opened() as browser:
        for width, theme in LOOKS:
            size = {"width": width, "height": 900}
            page = browser.new_page(viewport=size, color_scheme=theme, reduced_motion="reduce")
            for path in pages:
                page.goto(path.resolve().as_uri())
                for fault in faults_of(page):
                    if not fault.startswith("empty-table-header"):
                        yield f"{path.relative_to(site)}, {width} px, {theme}: {fault}"
            page.close()


if __name__ == "__main__":
    lines = []
    for line in findings(Path(sys.argv[1]), sys.argv[2:]):
        print(line, flush=True)
        lines.append(line)
    print(f"{len(lines)} findings")
    sys.exit(bool(lines))
