"""The tutorials work: their Python is a doctest, and their commands run, in one folder."""

from __future__ import annotations

import doctest
import re
import shlex
from pathlib import Path

import pytest

from virtual_lab.cli import cli

DOCS = Path(__file__).parents[1] / "virtual_lab" / "docs"
BLOCK = re.compile(r"^```(python)?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.parametrize("name", ["certify-and-score", "uncertainty-study", "a-clip", "rehearse"])
def test_a_tutorial_runs_as_it_stands(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    text = (DOCS / f"{name}.md").read_text("utf-8")
    blocks = [match.groups() for match in BLOCK.finditer(text)]
    assert len(blocks) >= 3
    for number, (language, block) in enumerate(blocks):
        if language:
            example = doctest.DocTestParser().get_doctest(block, names, name, name, number)
            runner = doctest.DocTestRunner(optionflags=OPTIONS)
            said: list[str] = []
            runner.run(example, out=said.append, clear_globs=False)
            assert runner.failures == 0, "".join(said)
            names = example.globs
        else:
            for line in block.strip().splitlines():
                program, *words = shlex.split(line)
                assert program == "virtual-lab"
                assert cli.main(words, standalone_mode=False) in (None, 0), line


def test_a_wrong_output_in_a_tutorial_fails() -> None:
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    example = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "x", "x", 0)
    runner.run(example, out=lambda _: None)
    assert runner.failures == 1


def test_the_page_of_tasks_has_sixteen_tasks() -> None:
    text = (DOCS / "how-do-i.md").read_text("utf-8")
    assert len(re.findall(r"^\d+\. \*\*", text, re.MULTILINE)) == 16
