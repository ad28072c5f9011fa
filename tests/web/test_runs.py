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

from tests.web.visiting import Answer, Visitor
from virtual_lab.page import answers, opening
from virtual_lab.page.answers import sentence

SLOW = [("bats", "r161"), ("laboratories", "1000000")]  # a sweep that no test waits for


@pytest.fixture
def visitor(tmp_path: Path) -> Any:
    visitor = Visitor(tmp_path / "lab")
    (tmp_path / "lab").mkdir()
    yield visitor
    visitor.page.runs.end()


def wait(condition: Callable[[], Any], limit: float = 60.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.05)


def finish(visitor: Visitor, name: str, fields: list[tuple[str, str]]) -> Answer:
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
    assert "The page is closed" in visitor.ask("/quit", b"").words
    wait(lambda: not visitor.page.runs.workers)
    assert visitor.quits == [True]


def test_a_run_that_is_refused_leads_back_to_its_field(visitor: Visitor) -> None:
    page = finish(visitor, "show", [("name", "r162")])
    assert "“r162” cannot be used: did you mean r161?" in page.words
    again = visitor.ask("/form/show?run=1").text
    assert "“r162” cannot be used" in re.search(r'id="f-name-fault">(.*?)<', again)[1]
    assert "1 more" in visitor.ask("/").words


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


SLOWER = {"flight": 2, "speed_in_m_per_s": {"value": 1.0, "u": 0.1}}
FLOWN, BOUNCE = {"value": 2.0, "u": 0.1}, {"value": 0.5, "u": 0.01}


def test_a_page_that_nobody_uses_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "IDLE", 0.5)
    said: list[str] = []
    page = opening.open_page(tmp_path / "lab", browser=False, progress=said.append)
    assert (page.text, said) == (str(tmp_path / "lab"), [""])
    assert list((tmp_path / "lab").iterdir()) == []


INTERVAL = {"value": 0.49852, "interval_95": [0.49444, 0.50260], "limit": 0.5}
CERTIFIED = {"verdict": "FAIL", "metric": {"name": "restitution", **INTERVAL}, "reasons": ["much"]}
SPEED = {"name": "batted_speed", "value": 44.704, "interval_95": [44.6, 44.808], "limit": None}
COSTS = {
    "hits": 6,
    "final_hits": 10,
    "balls": 12,
    "minutes": 252.8,
    "exchanged": "none",
    "reaches": "yes",
}
PLANS = [
    COSTS | {"plan": "0", "reaches": "not decided", "compared": ""},
    {"plan": "1", "compared": "equal", "simulated_u": 0.0015, "unit": "", **COSTS},
    {"plan": "2", "compared": "cheapest", "simulated_u": 0.00148722, "unit": "", **COSTS},
]


def test_results_of_the_command_line_are_listed(visitor: Visitor) -> None:
    """Once, with answer and settings; a damaged folder is left out."""
    for name, certificate in (("made", CERTIFIED), ("old", {"verdict": "PASS"})):
        (visitor.page.folder / name).mkdir()
        (visitor.page.folder / name / "certificate.json").write_text(json.dumps(certificate))
    (visitor.page.folder / "made" / "truth").mkdir()
    (visitor.page.folder / "made" / "truth" / "truth.json").write_text("{}")
    (visitor.page.folder / "made" / "settings.toml").write_text('bat = "r161"')
    for _ in range(2):
        page = visitor.ask("/").text
        assert page.count("FAIL: e 0.4985 ± 0.0041, limit 0.500") == page.count("/run/") == 1
    result = visitor.ask("/run/1").text
    assert "made/certificate.json" in result
    assert f'href="/form/score?folder={quote(str(visitor.page.folder / "made"))}"' in result
    assert '<option value="r161" selected' in visitor.ask("/form/certify?run=1").text


@pytest.mark.parametrize(
    ("command", "document", "answer"),
    [
        ("certify", CERTIFIED, "FAIL: e 0.4985 ± 0.0041, limit 0.500"),
        (
            "reduce",
            CERTIFIED | {"verdict": "MEASURED"},
            "MEASURED: e 0.4985 ± 0.0041, limit 0.500; much",
        ),
        ("show", CERTIFIED | {"verdict": "INVALID"}, "INVALID: much"),
        ("show", {"kind": "bats"}, "Slope of e_A"),
        (
            "certify",
            CERTIFIED | {"verdict": "MEASURED", "metric": SPEED, "reasons": []},
            "MEASURED: v_f 100.00 ± 0.23 mph",
        ),
        (
            "plan",
            PLANS,
            "Plan 2 reaches a standard uncertainty of 0.00149: 6 hits, 10 final hits, 12 balls, "
            "253 minutes; exchanged: none",
        ),
        ("plan", PLANS[:1], "No plan is sure to reach this uncertainty"),
        (
            "track",
            {"flights": [{"flight": 1, "speed_out_m_per_s": FLOWN, "restitution": BOUNCE}, SLOWER]},
            "Fastest: 2.00 ± 0.20 m/s (4.5 ± 0.4 mph) at the end of flight 1; "
            "restitution 0.500 ± 0.020 after it",
        ),
        ("verify", {"state": "whole"}, "Whole: no file was changed"),
        ("slope", {}, "Slope of e_A"),
    ],
)
def test_an_answer_is_one_sentence(command: str, document: Any, answer: str) -> None:
    assert sentence(command, document, "\n slope of e_A\n") == answer
    assert set(answers.ANSWERS) < set(Visitor(Path()).page.commands)
