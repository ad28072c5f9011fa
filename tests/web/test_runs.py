"""Runs and results: start, files, cancel, restart, and the files that remain after a run."""

from __future__ import annotations

import json
import os
import re
import signal
import time
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

import virtual_lab as vl
from tests.web.visiting import Answer as Page
from tests.web.visiting import Visitor
from virtual_lab.commands.output import Answer
from virtual_lab.page import opening
from virtual_lab.page.working import answer_of

SLOW = [("bats", "r161"), ("laboratories", "1000000")]  # a sweep that no test waits for


@pytest.fixture
def visitor(tmp_path: Path) -> Any:
    visitor = Visitor(tmp_path / "lab")
    (tmp_path / "lab").mkdir()
    yield visitor
    visitor.page.runs.end()


def wait(condition: Callable[[], Any], limit: float = 240.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.05)


def finish(visitor: Visitor, name: str, fields: list[tuple[str, str]]) -> Page:
    """Start a run, wait for its end, and return the page of its result."""
    answer = visitor.submit(name, fields)
    assert answer.status == 303, answer.words
    wait(lambda: not visitor.page.runs.workers)
    return visitor.ask(answer.headers["location"])


def test_a_result_is_the_same_as_at_the_shell(
    visitor: Visitor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """Answer first, then text, files, the next step, and the shell line last."""
    from virtual_lab.cli import cli

    page = finish(visitor, "slope", [("bats", "r161"), ("bats", "ea70")])
    order = ['class="answer"', "<figure", "As text", "Files", "What next", "in a terminal"]
    places = [page.text.index(each) for each in order]
    assert places == sorted(places)
    monkeypatch.chdir(tmp_path)
    cli(["slope", "r161", "ea70", "--out", "shell"], standalone_mode=False)
    text = capsys.readouterr().out.rpartition("\n\n")[0]
    assert re.search(r"<pre>(.*?)</pre>", page.text, re.DOTALL)[1].strip() == text.strip()
    files = {path.name: path.read_bytes() for path in (tmp_path / "shell").iterdir()}
    for name, path in visitor.page.runs.get(1).files.items():
        assert path.read_bytes() == files[path.name], name
    zipped = zipfile.ZipFile(BytesIO(visitor.ask("/run/1/zip").body))
    assert {Path(name).name for name in zipped.namelist()} == files.keys()
    restarted = Visitor(visitor.page.folder)  # results survive a restart
    assert "slope" in restarted.ask("/").words
    assert restarted.ask("/run/1").text == page.text


def test_a_run_shows_its_progress_and_can_be_cancelled(visitor: Visitor) -> None:
    """Two runs at most; a reload and the start page show them; nothing is left; quit ends all."""
    for number in (1, 2):
        answer = visitor.submit("sweep", SLOW)
        assert answer.headers["location"] == f"/run/{number}"
    refused = visitor.submit("sweep", SLOW)
    assert (refused.status, "2 runs are in progress" in refused.words) == (422, True)
    state = {}

    def is_counted() -> bool:
        state.update(json.loads(visitor.ask("/run/1/progress").body))
        return bool(state["total"])

    wait(is_counted)
    assert state["live"]
    assert 0 <= state["done"] < state["total"]
    assert 'role="status"' in visitor.ask("/run/1").text
    assert "In progress" in visitor.ask("/").words
    assert visitor.ask("/run/1/cancel", b"").status == 303
    wait(lambda: 1 not in visitor.page.runs.workers)
    assert "ended before it had a result" in visitor.ask("/run/1").words
    process = visitor.page.runs.workers[2].process
    wait(lambda: visitor.page.runs.workers[2].process)
    os.kill(visitor.page.runs.workers[2].process.pid, signal.SIGTERM)
    wait(lambda: not visitor.page.runs.workers)
    assert "ended before it had a result" in visitor.ask("/run/2").words
    assert [path.name for path in visitor.page.folder.iterdir()] == ["runs"]
    assert process is None or process.poll() is not None
    visitor.submit("sweep", SLOW)
    asked = visitor.ask(visitor.ask("/quit", b"").headers["location"])
    assert "If you quit now, nothing of its result is left" in asked.words
    assert (visitor.quits, len(visitor.page.runs.workers)) == ([], 1)
    assert "The page is closed" in visitor.ask("/quit?sure=yes", b"").words
    wait(lambda: not visitor.page.runs.workers)
    assert visitor.quits == [True]


def test_a_run_that_is_refused_leads_back_to_its_field(visitor: Visitor) -> None:
    page = finish(visitor, "show", [("name", "r162")])
    assert "“r162” cannot be used: did you mean r161?" in page.words
    again = visitor.ask("/form/show?run=1").text
    assert "“r162” cannot be used" in re.search(r'id="f-name-fault">(.*?)<', again)[1]
    assert "1 more" in visitor.ask("/").words


def test_forms_that_were_filled_in_lead_to_their_certificate(visitor: Visitor) -> None:
    page = finish(visitor, "template", [("procedure", "astm-f1881")]).text
    forms = visitor.page.folder / "template-astm-f1881"
    assert f">Empty, to fill in: {forms}<" in page
    assert f'href="/form/reduce?records={quote(str(forms))}"' in page
    assert "/form/score" not in page


def test_the_sealed_truth_leaves_only_if_ticked(visitor: Visitor) -> None:
    """A run of a folder with a truth, written by hand: its page, its files and its zip."""
    made, home = visitor.page.folder / "r161", visitor.page.folder / "runs" / "0001"
    for path in (made / "certificate.json", made / "truth" / "truth.json", home / "x"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("{}")
    call = {"command": "certify", "values": {"bat": "r161"}, "began": 0.0}
    (home / "call.json").write_text(json.dumps(call))
    (home / "outcome.json").write_text(json.dumps({"answer": "PASS", "written": [str(made)]}))
    page = visitor.ask("/run/1").text
    assert "certificate.json" in page
    assert "truth.json" not in page
    assert f'href="/form/score?folder={quote(str(made))}"' in page
    both = {"certificate.json", "truth.json"}
    for query, names in (("", {"certificate.json"}), ("?truth=yes", both)):
        archive = zipfile.ZipFile(BytesIO(visitor.ask(f"/run/1/zip{query}").body))
        assert {Path(name).name for name in archive.namelist()} == names


def test_a_page_that_nobody_uses_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "IDLE", 0.5)
    said: list[str] = []
    page = opening.open_page(tmp_path / "lab", browser=False, progress=said.append)
    assert (page.text, said) == (str(tmp_path / "lab"), [""])
    assert list((tmp_path / "lab").iterdir()) == []


def test_results_of_the_command_line_are_listed(visitor: Visitor) -> None:
    """Once, with answer and settings; a damaged folder is left out."""
    made = vl.certify("ea70", procedure="bbcor", seed=1).save(visitor.page.folder / "made")
    (visitor.page.folder / "old").mkdir()
    (visitor.page.folder / "old" / "certificate.json").write_text('{"verdict": "PASS"}')
    for _ in range(2):
        page = visitor.ask("/").text
        assert len(re.findall(r">FAIL: e 0\.\d+ ± 0\.\d+, limit 0\.500<", page)) == 1
        assert page.count('"/run/') == 1
    result = visitor.ask("/run/1").text
    assert "made/certificate.json" in result
    assert f'href="/form/score?folder={quote(str(made))}"' in result
    assert '<option value="ea70" selected' in visitor.ask("/form/certify?run=1").text


def test_a_result_without_a_sentence_has_its_first_line() -> None:
    flagged = {"flags": ["LATE"], "warnings": ["late by 2 s"]}
    certified = {"flags": [{"name": "drift", "sentence": "long"}]}
    for document, flags in (({}, []), (flagged, ["LATE", "late by 2 s"]), (certified, ["drift"])):
        result = Answer(document=document, text="\n slope of e_A\nmore")
        assert answer_of(result) == {"answer": "Slope of e_A", "flags": flags}
