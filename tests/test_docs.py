"""The site: what installs it, what its sources keep to, and the check of its built pages.

Its build, in ``.ci/run``, runs the pages and the scripts of the gallery.
"""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from tests.test_readme import PAGES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "virtual_lab" / "docs"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
BUILD = "uv run --group docs python -m sphinx"


def installed_by(group: str) -> set[str]:
    """Return the names of the packages of a dependency group, with those of included groups."""
    names: set[str] = set()
    for each in PROJECT["dependency-groups"][group]:
        if isinstance(each, dict):
            names |= installed_by(each["include-group"])
        else:
            names.add(re.split(r"[^\w.-]", each)[0])
    return names


def test_the_tests_do_not_install_what_builds_the_site() -> None:
    """`uv run pytest` installs the default groups, which are ``dev`` unless the file says more."""
    default = PROJECT["tool"]["uv"].get("default-groups", ["dev"])
    assert "docs" in PROJECT["dependency-groups"]
    assert not installed_by("docs") & {name for group in default for name in installed_by(group)}


def test_readme_and_checks_build_the_site_by_one_command() -> None:
    """The wheel has no page of it."""
    assert f"{BUILD} -W virtual_lab/docs out/site" in (ROOT / "README.md").read_text("utf-8")
    assert f"{BUILD} -q -W virtual_lab/docs" in (ROOT / ".ci" / "run").read_text("utf-8")
    assert PROJECT["tool"]["setuptools"]["package-data"]["virtual_lab"] == ["py.typed"]


def offline(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the module that checks the built pages."""
    spec = spec_from_file_location("offline", DOCS / "building" / "offline.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "offline", module)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.html", '<script async src="https://cdn.example/mathjax.js"></script>'),
        ("a.html", '<link rel="stylesheet" href="//fonts.example/css?family=Lato">'),
        ("a.html", "<p><img alt='x' src='http://example.org/x.png'></p>"),
        ("a.css", "@import url(https://fonts.example/a.css);"),
        ("a.css", '@font-face { src: url("https://fonts.example/a.woff2"); }'),
        ("a.js", 'import("https://cdn.example/require.js")'),
    ],
)
def test_a_page_that_loads_from_elsewhere_is_refused(
    name: str, text: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "sound.html").write_text(
        '<a href="https://example.org">a link</a><script src="_static/a.js"></script>'
        '<link rel="stylesheet" href="_static/a.css"><math xmlns="http://www.w3.org/1998/Math">',
        "utf-8",
    )
    (found,) = offline(monkeypatch).remote_resources(tmp_path)
    assert found.startswith(f"{name}: ")


def test_scripts_of_the_gallery_are_short() -> None:
    """At most 25 lines of code, after title and caption."""
    scripts = sorted((DOCS / "scripts").rglob("*.py"))
    assert len(scripts) >= 24
    for script in scripts:
        _, caption, code = script.read_text("utf-8").split('"""', 2)
        assert len([line for line in code.splitlines() if line]) <= 25, script
        assert set(caption.splitlines()[2]) == {"="}, script


def test_code_on_a_page_needs_no_scroll_bar() -> None:
    """The code that a reader sees is at most 80 characters wide."""
    blocks = [
        block
        for page in PAGES
        for block in re.findall(r"^```.*\n((?:.*\n)*?)```$", page.read_text("utf-8"), re.MULTILINE)
        if not re.match(r":tags: \[remove-(?:cell|input)\]", block)
    ]
    blocks += [script.read_text("utf-8") for script in (DOCS / "scripts").rglob("*.py")]
    assert len(blocks) > 120
    assert [line for block in blocks for line in block.splitlines() if len(line) > 80] == []


def test_each_task_has_an_anchor_and_at_most_six_lines() -> None:
    _, *tasks = re.split(r"^## ", (DOCS / "how-do-i.md").read_text("utf-8"), flags=re.MULTILINE)
    assert len(tasks) >= 18
    for task in tasks:
        title, _, text = task.partition("\n")
        lines = [line for line in text.splitlines() if line and not line.startswith("|")]
        assert len(lines) <= 6, title
