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
from tests.asking import Answer as Page
from tests.web.visiting import Visitor, words_of
from virtual_lab.cli import cli
from virtual_lab.commands.output import Answer
from virtual_lab.page import opening, runs, working
from virtual_lab.page.runs import StartedRun
from virtual_lab.page.working import answer_of

SLOW = b"bats=r161&laboratories=1000000"  # a sweep that no test waits for


def wait(condition: Callable[[], Any], limit: float = 240.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.05)


class SameProcess:
    """A worker without a process of its own, which would take a second to start."""

    def __init__(self, words: str) -> None:
        self.words = words

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return function(*arguments)

    def end(self) -> None:
        """Do nothing: the call has ended."""

    dismiss = end


@pytest.fixture
def same_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "Worker", SameProcess)


def finish(visitor: Visitor, name: str, fields: bytes) -> Page:
    """Start a run, wait for its end, and return the page of its result."""
    answer = visitor.ask(f"/form/{name}", fields)
    assert answer.status == 303, words_of(answer)
    wait(lambda: not visitor.page.runs.workers)
    return visitor.ask(answer.headers["location"])


@pytest.mark.usefixtures("same_process")
def test_a_fitted_bat_leads_to_its_profile_and_its_test(visitor: Visitor) -> None:
    """The form of each has the file of the bat."""
    form = vl.template("measurements", visitor.page.folder / "measured.toml")
    words = form.read_text("utf-8").replace('template = "?"', 'template = "wood"')
    numbers = {"length": 33, "mass": 30, "z_cm": 11, "inertia": 9900, "inertia_axis": 27}
    for key, number in numbers.items():
        words = words.replace(f'\n{key} = {{ value = "?"', f"\n{key} = {{ value = {number}")
    form.write_text(words, "utf-8")
    result = finish(visitor, "fit-bat", f"path={quote(str(form))}&members=2".encode())
    for name in ("profile", "certify"):
        (place,) = re.findall(rf'href="(/form/{name}\?[^"]*)"', result.text)
        chosen = r'value="[^"]*fit-bat-measured\.toml" (checked|selected)'
        page = visitor.ask(place).text
        assert re.search(chosen, page)
        boxes = re.findall('type="checkbox" name="bats" value="(.*?)"', page)
        assert all("fit-bat-measured" in each for each in boxes[:1])  # the first one


def names_in(archive: Page) -> set[str]:
    return {Path(name).name for name in zipfile.ZipFile(BytesIO(archive.body)).namelist()}


def test_a_result_is_the_same_as_at_the_shell(
    visitor: Visitor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """Answer first, then text, files, the next step, and the shell line last."""
    page = finish(visitor, "slope", b"bats=r161&bats=ea70")
    order = ['class="answer"', "<figure", "As text", "Files", "What next", "in a terminal"]
    places = [page.text.index(each) for each in order]
    assert places == sorted(places)
    monkeypatch.chdir(tmp_path)
    cli(["slope", "r161", "ea70", "--out", "shell"], standalone_mode=False)
    text = capsys.readouterr().out.rpartition("\n\n")[0]
    shown = re.search(r"<pre>(.*?)</pre>", page.text, re.DOTALL)[1]
    assert re.sub("</?span>", "", shown).strip() == text.strip()  # a span is wrapped
    files = {path.name: path.read_bytes() for path in (tmp_path / "shell").iterdir()}
    for name, path in visitor.page.runs.get(1).files.items():
        assert path.read_bytes() == files[path.name], name
    assert names_in(visitor.ask("/run/1/zip")) == files.keys()
    restarted = Visitor(visitor.page.folder)  # results survive a restart
    assert "slope" in words_of(restarted.ask("/"))
    assert restarted.ask("/run/1").text == page.text


def test_a_result_without_a_text_is_answered_by_its_files(visitor: Visitor) -> None:
    page = finish(visitor, "board", b"board=chessboard:9x6:40mm&views=3&seed=1")
    assert f'class="answer">{visitor.page.folder / "board-seed-1" / "pictures"}<' in page.text


def test_a_run_shows_its_progress_and_can_be_cancelled(visitor: Visitor) -> None:
    """Two runs at most; a reload and the start page show them; nothing is left; quit ends all."""
    workers, state = visitor.page.runs.workers, {}
    for number in (1, 2):
        assert visitor.ask("/form/sweep", SLOW).headers["location"] == f"/run/{number}"
    refused = visitor.ask("/form/sweep", SLOW)
    assert (refused.status, "2 runs are in progress" in words_of(refused)) == (422, True)

    def is_counted() -> bool:
        state.update(json.loads(visitor.ask("/run/1/progress").body))
        return bool(state["total"])

    wait(is_counted)
    assert state["live"]
    assert 0 <= state["done"] < state["total"]
    assert 'role="status"' in visitor.ask("/run/1").text
    assert "r161" in words_of(visitor.ask("/run/1"))
    assert "In progress" in words_of(visitor.ask("/"))
    processes = [each.process for each in workers.values()]
    assert visitor.ask("/run/1/cancel", b"").status == 303
    wait(lambda: 1 not in workers)
    os.kill(processes[1].pid, signal.SIGTERM)
    wait(lambda: not workers)
    for number in (1, 2):
        assert "ended before it had a result" in words_of(visitor.ask(f"/run/{number}"))
    assert [path.name for path in visitor.page.folder.iterdir()] == ["runs"]
    assert all(each.poll() is not None for each in processes)
    visitor.ask("/form/sweep", SLOW)
    asked = visitor.ask(visitor.ask("/quit", b"").headers["location"])
    assert "If you quit now, nothing of its result is left" in words_of(asked)
    assert (visitor.quits, len(workers)) == ([], 1)
    assert "The page is closed" in words_of(visitor.ask("/quit?sure=yes", b""))
    wait(lambda: not workers)
    assert visitor.quits == [True]


@pytest.mark.usefixtures("same_process")
def test_a_run_that_fails_says_what_to_do(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = finish(visitor, "sweep", b"bats=r161&laboratories=1000000000000000000")
    assert "not enough memory: 6.94 EiB; allowed: smaller numbers or files" in words_of(page)
    monkeypatch.setattr(working, "carry_out", None)
    page = words_of(finish(visitor, "show", b"name=r161"))
    assert "a bug in this program, not in your input; please report the text below" in page
    assert "As text" in page


@pytest.mark.usefixtures("same_process")
def test_a_bench_is_linked_and_its_debrief_is_a_result(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page of the run is up to date after the start of the bench and after the hand-in."""
    pages: list[Page] = []

    def serve(folders: dict[str, Path], *_: Any, say: Any, **how: Any) -> None:
        (folder,) = folders.values()
        pages.append(visitor.ask("/run/1"))
        say(f"the day, begun in {folder}: open http://bench/?token=a once, in one browser")
        say("Ctrl-C stops the server")
        pages.extend(visitor.ask(path) for path in ("/run/1", "/", "/run/1/progress?stage=0"))
        pages.append(visitor.ask(visitor.ask("/quit", b"").headers["location"]))
        folder.mkdir()
        debrief = {"title": "Plain", "verdict": "PASS", "right_verdict": "FAIL"}
        (folder / "debrief.json").write_text(json.dumps(debrief))
        (folder / "debrief.html").write_text("<p>debrief</p>")
        pages.extend(visitor.ask(path) for path in ("/run/1", "/", "/run/1/progress?stage=1"))
        # a day that is handed in needs no question
        assert "closed" in visitor.ask("/quit", b"").text
        assert not how["browser"]  # the page has the link

    monkeypatch.setattr("virtual_lab.bench.entrance.serve.serve", serve)
    last = finish(visitor, "rehearse", b"scenario=tuesday")
    early, served, start, changed, asked, ready, done, changed_again = pages
    assert '?stage=0"' in early.text
    assert "href" not in early.text.partition('role="status"')[2].partition("</p>")[0]
    assert 'href="http://bench/?token=a" target="_blank">Open' in served.text
    assert '?stage=1"' in served.text
    assert "the bench is open" in words_of(start)
    assert json.loads(changed.body)["live"] is json.loads(changed_again.body)["live"] is False
    assert "except the saved day of a bench" in words_of(asked)
    assert "Traceback" not in last.text
    for page in (ready, last):
        assert 'class="answer">Plain: verdict PASS, correct FAIL<' in page.text
        assert "file?name=rehearse/debrief.html" in re.search("<iframe.*?>", page.text)[0]
    assert "Close the bench" in words_of(ready)
    assert "In progress" not in words_of(done)
    assert "Open" not in words_of(last)


def test_a_day_that_was_not_handed_in_is_opened_again(visitor: Visitor) -> None:
    day, run = visitor.page.folder / "tuesday", visitor.page.folder / "runs" / "0001"
    for folder in (day, run):
        folder.mkdir(parents=True)
    (day / "day.sqlite").touch()
    call = {"command": "rehearse", "values": {"day": str(day)}, "began": 0}
    (run / "call.json").write_text(json.dumps(call))
    page = visitor.ask("/run/1")
    assert "The bench is closed. Its day is saved." in words_of(page)
    assert f'href="/form/rehearse?day={quote(str(day))}">Open this day' in page.text
    assert "day.sqlite" not in page.text.partition("What next")[0]  # nor the sealed truth
    assert "No result: the day is not handed in" in words_of(visitor.ask("/"))


@pytest.mark.usefixtures("same_process")
def test_a_run_that_is_refused_leads_back_to_its_field(visitor: Visitor) -> None:
    page = finish(visitor, "show", b"name=r162&toml=yes")
    assert "“r162” cannot be used: did you mean r161?" in words_of(page)
    again = visitor.ask("/form/show?run=1").text
    assert "“r162” cannot be used" in re.search(r'id="f-name-fault">(.*?)<', again)[1]
    start = words_of(visitor.ask("/"))
    assert "1 more" in start
    assert "show r162, toml," in start  # a box that is ticked has its title


@pytest.mark.usefixtures("same_process")
def test_forms_that_were_filled_in_lead_to_their_certificate(visitor: Visitor) -> None:
    page = finish(visitor, "template", b"procedure=astm-f1881").text
    forms = visitor.page.folder / "template-astm-f1881"
    assert f">Empty, to fill in: {forms}<" in page
    assert f'href="/form/reduce?records={quote(str(forms))}"' in page
    assert "/form/score" not in page


def test_a_page_that_nobody_uses_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "IDLE", 0.1)
    said: list[str] = []
    page = opening.open_page(tmp_path / "lab", browser=False, progress=said.append)
    assert (page.text, said) == (str(tmp_path / "lab"), [""])
    assert list((tmp_path / "lab").iterdir()) == []


@pytest.mark.usefixtures("same_process")
def test_results_of_the_command_line_are_listed(visitor: Visitor) -> None:
    """Once, with answer and settings; a damaged folder is left out, and the truth if not ticked."""
    made = vl.certify("ea70", procedure="bbcor", seed=1).save(visitor.page.folder / "made")
    (visitor.page.folder / "old").mkdir()
    (visitor.page.folder / "old" / "certificate.json").write_text('{"verdict": "PASS"}')
    for _ in range(2):
        page = visitor.ask("/").text
        assert len(re.findall(r">FAIL: e 0\.\d+ ± 0\.\d+, limit 0\.500<", page)) == 1
        assert page.count('"/run/') == 1
    result = visitor.ask("/run/1").text
    assert "made/certificate.json" in result
    assert "truth.json" not in result
    score, *_ = places = re.findall(r'<iframe|href="/form/score\?folder=[^"]*"', result)
    assert (score, len(places)) == (f'href="/form/score?folder={quote(str(made))}"', 3)
    assert '<option value="ea70" selected' in visitor.ask("/form/certify?run=1").text
    with_truth = names_in(visitor.ask("/run/1/zip?truth=yes"))
    assert names_in(visitor.ask("/run/1/zip")) == with_truth - {"truth.json", "seal.json"}
    assert {"truth.json", "certificate.json"} < with_truth
    scored = finish(visitor, "score", f"folder={quote(str(made))}".encode())
    assert re.findall(r'<a href="/run/(\d+)">FAIL: e ', scored.text) == ["1"]
    assert "e of hit " in scored.text
    assert "Of the result" not in visitor.ask("/run/1").text


@pytest.mark.usefixtures("same_process")
def test_a_result_links_only_its_own_sources(visitor: Visitor) -> None:
    """A corrected result, and one that the run used; none that took the name of a folder later."""
    for earlier in ("", "?run=1", "?run=1", "?run=3"):
        page = finish(visitor, f"show{earlier}", b"name=r161&toml=yes")
        assert re.findall(r'Of the result <a href="/run/(\d+)', page.text) == [*earlier[5:]]
    runs, made = visitor.page.folder / "runs", str(visitor.page.folder / "made")
    uses = {1: {"out": made}, 2: {"plot": made}, 3: {"out": made}, 4: {"bats": ["r161", made]}}
    uses[5] = {"out": made}  # the folder was deleted before
    (runs / "0005").mkdir()
    for number, values in uses.items():
        call = {"command": "slope", "values": values, "began": number}
        (runs / f"{number:04}" / "call.json").write_text(json.dumps(call))
    (runs / "0003" / "outcome.json").write_text(json.dumps({"written": [made]}))
    for number, sources in ((1, []), (2, []), (3, []), (4, ["3"]), (5, [])):
        page = visitor.ask(f"/run/{number}").text
        assert re.findall(r'Of the result <a href="/run/(\d+)', page) == sources


def test_a_run_is_listed_with_the_number_of_its_correction(tmp_path: Path) -> None:
    values = {"clip": "/lab/a.mp4", "corrected": "/lab/uploads/a.mp4-corrected-2.csv", "out": "b"}
    (tmp_path / "call.json").write_text(json.dumps({"values": values}))
    assert StartedRun(tmp_path, live=False).values_text == "a.mp4, corrected-2.csv"


def test_a_result_without_a_sentence_has_its_first_line() -> None:
    flagged = {"flags": ["LATE"], "warnings": ["late by 2 s"]}
    certified = {"flags": [{"name": "drift", "sentence": "long"}]}
    noted = {"flags": [], "warnings": ["2 positions by hand"]}
    cases = (
        ({}, [], []),
        (noted, [], noted["warnings"]),
        (flagged, ["LATE"], ["late by 2 s"]),
        (certified, ["drift"], []),
    )
    for document, flags, warnings in cases:
        result = Answer(document=document, text="\n slope of e_A\nmore")
        said = {"answer": "Slope of e_A", "flags": flags, "warnings": warnings}
        assert answer_of(result) == said
    for symbol in ("e 0.537", "v_f 41.9", "e0 0.47"):  # a symbol keeps its small letter
        assert answer_of(Answer(document=[], text=symbol))["answer"] == symbol
