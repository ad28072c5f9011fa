"""Accessibility of the built site, page by page, at two widths and in both themes.

    python -m tests.site_pages out/site [PART ...]

The command opens each page in a Chromium of the machine and prints what axe-core finds (contrast
below 4.5, pictures without alternative text, headings out of order, …) and each page that must be
scrolled sideways. Empty headers of tables are left out: a column of row names needs no header. With
PART the command checks only pages whose path is one of these, such as coach.html or */test-*.html.
The exit code is 1 if it finds anything.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

from tests.bench.browsing import faults_of, opened

LOOKS = [(width, theme) for width in (390, 1280) for theme in ("light", "dark")]


def findings(site: Path, parts: Sequence[str]) -> Iterator[str]:
    """Yield page, width, theme and finding, one text per finding."""
    paths = [path for path in sorted(site.rglob("*.html")) if "_static" not in path.parts]
    pages = set[Path]()
    for part in parts or ["*"]:
        some = [path for path in paths if fnmatch(str(path.relative_to(site)), part)]
        if not some:
            raise SystemExit(f"{site}: no page {part}")
        pages.update(some)
    with opened() as browser:
        for width, theme in LOOKS:
            size = {"width": width, "height": 900}
            page = browser.new_page(viewport=size, color_scheme=theme, reduced_motion="reduce")
            for path in sorted(pages):
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
