"""The day as a replay of its log: what is refused, what a double click does, what is on disk."""

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from tests.bench.days import PLAIN, asked
from virtual_lab.bench.day.actions import ARGUMENTS, action_of
from virtual_lab.bench.day.log import LOG, DayLog, SequenceError
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.day.table import action_table
from virtual_lab.bench.machines.stored_day import SECRET, StoredDay
from virtual_lab.errors import InputError


@pytest.fixture
def rehearsal(tmp_path: Path) -> StoredDay:
    return StoredDay.begin(tmp_path / "day", load_scenario("plain-day"), 3)


def test_the_table_holds_every_action_and_argument() -> None:
    assert ARGUMENTS.keys() <= action_table().actions.keys()


def test_a_resumed_day_equals_the_day_before_the_break(rehearsal: StoredDay) -> None:
    for action in asked(PLAIN[:20]):
        rehearsal.do(action)
    again = StoredDay(rehearsal.log.path.parent)
    assert again.day == rehearsal.day
    assert again.day.seconds == sum(event.seconds for event in again.day.events)
    assert (
        again.do(action_of("tap-bat")).shown
        == rehearsal.apparatus.play(rehearsal.day, action_of("tap-bat")).shown
    )


def test_a_double_click_makes_one_entry(rehearsal: StoredDay) -> None:
    rehearsal.do(action_of("tare"), 1)
    with pytest.raises(SequenceError, match="entry 2 is next"):
        rehearsal.do(action_of("tare"), 1)
    stale = StoredDay(rehearsal.log.path.parent)
    rehearsal.do(action_of("weigh-bat"))
    with pytest.raises(SequenceError):  # a second server that does not know of it
        stale.do(action_of("weigh-bat"))
    assert [event.action for event in rehearsal.log.events()] == ["tare", "weigh-bat"]


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE entries SET entry = '{}' WHERE number = 1",
        "DELETE FROM entries",
        "INSERT OR REPLACE INTO entries VALUES (1, '{}')",
    ],
)
def test_the_log_only_grows(rehearsal: StoredDay, statement: str) -> None:
    rehearsal.do(action_of("tare"))
    with rehearsal.log._open() as base, pytest.raises(sqlite3.DatabaseError):
        base.execute(statement)
    assert [event.action for event in rehearsal.log.events()] == ["tare"]


def test_the_log_of_a_day_contains_no_hidden_truth(tmp_path: Path) -> None:
    """Seed, salt and faults lie in a file of their own that only its owner may read."""
    path = tmp_path / "fault.toml"
    text = load_scenario("plain-day").text
    path.write_text(text.replace("procedure =", 'faults = ["gate-moved"]\nprocedure ='), "utf-8")
    seed = 918273645546372819
    begun = StoredDay.begin(tmp_path / "day", load_scenario(str(path)), seed)
    for action in asked(PLAIN[:13]):
        begun.do(action)
    secret = tmp_path / "day" / SECRET
    assert secret.stat().st_mode & 0o777 == 0o600
    sealed = json.loads(secret.read_text("utf-8"))
    assert "faults" not in sealed  # they are drawn from the seed
    log = (tmp_path / "day" / LOG).read_bytes()
    for word in (str(seed), sealed["salt"], "gate-moved", "restitution_loss"):
        assert word.encode() not in log
    assert begun.log.morning["briefing"]["title"] == "The plain day"


def test_a_killed_process_loses_no_answered_entry(tmp_path: Path) -> None:
    """It writes a number to its output after each entry is answered, and is then killed."""
    code = f"""
import os, sys
from pathlib import Path
from virtual_lab.bench.day.day import DayEvent
from virtual_lab.bench.day.log import DayLog
log = DayLog.create(Path({str(tmp_path / "log")!r}), {{}})
for number in range(1, 100000):
    log.append(DayEvent(number=number, action="tare", arguments={{}}, seconds=1.0))
    os.write(1, b".")
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert process.stdout is not None
    answered = len(os.read(process.stdout.fileno(), 1))
    while answered < 40:
        answered += len(os.read(process.stdout.fileno(), 40 - answered))
    process.kill()
    answered += len(process.communicate()[0])
    found = DayLog(tmp_path / "log").events()
    assert [event.number for event in found] == list(range(1, len(found) + 1))
    assert answered <= len(found) <= answered + 1


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("weigh", {}, "did you mean weigh-bat"),
        ("tare", {"x": 1}, "tare: x; allowed: no argument"),
        ("swing", {"amplitude": "wide"}, "allowed: numbers from 0.5 to 45 deg"),
        ("swing", {"amplitude": 1e99}, "allowed: numbers from 0.5 to 45 deg"),
        ("swing", {"amplitude": "nan"}, "allowed: numbers"),
        ("swing", {"swings": "1.5"}, "allowed: whole numbers"),
        ("swing", {"clock": "sundial"}, "allowed: photogate, hand"),
        ("set-place", {}, "set-place: place; is missing"),
        ("set-place", {"place": "1,200,0"}, "allowed: numbers"),
        ("reject", {"shot": 1}, "because; is missing"),
        ("reject", {"shot": 1, "because": "a\nb"}, "a line of up to"),
    ],
)
def test_bad_arguments_are_named(name: str, given: dict, message: str) -> None:
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        action_of(name, given)


@pytest.mark.parametrize(
    ("typed", "millimetres"),
    [("5", 5), ("-5,5", -5.5), ("0.2 in", 5.08), ("0,2in", 5.08), ("5e-3 m", 5), ("1 cm", 10)],
)
def test_a_number_may_be_typed_with_its_unit(typed: str, millimetres: float) -> None:
    found = action_of("re-aim", {"along": typed}).arguments["along"]
    assert found == pytest.approx(millimetres, rel=1e-12)


@pytest.mark.parametrize("typed", ["5 g", "5 furlong", "in", "1,200,0 mm", "5 mm mm", "0.2 m/s"])
def test_a_unit_of_another_kind_is_refused(typed: str) -> None:
    with pytest.raises(InputError, match="allowed: numbers from -50 to 50 mm"):
        action_of("re-aim", {"along": typed})


def test_a_decimal_comma_is_read() -> None:
    assert action_of("swing", {"amplitude": "3,5"}).arguments["amplitude"] == 3.5


@pytest.mark.parametrize(
    ("days", "message"),
    [
        ([("fire", {})], "load-ball comes first"),
        ([("load-ball", {"ball": 1}), ("fire", {})], "set-place comes first"),
        ([("load-ball", {"ball": 13})], "allowed: 1 to 12"),
        ([("accept", {"shot": 1})], "no shot has been fired yet"),
        ([("reduce", {})], "no shot has been fired at the bat yet"),
        ([("give-verdict", {"verdict": "PASS"})], "reduce or enter-result comes first"),
        ([("hand-in", {})], "give-verdict comes first"),
        (
            [("tare", {}), ("strike-out", {"entry": 1, "because": "x"})],
            "only readings",
        ),
        (
            [("hit-wall", {}), ("strike-out", {"entry": 1, "because": "x"})],
            "only readings",
        ),
    ],
)
def test_what_is_impossible_is_refused_and_leaves_no_entry(
    rehearsal: StoredDay, days: list, message: str
) -> None:
    *before, last = asked(days)
    for action in before:
        rehearsal.do(action)
    with pytest.raises(InputError, match=message):
        rehearsal.do(last)
    assert len(rehearsal.log.events()) == len(before)


def test_nothing_is_changed_after_the_reduction(rehearsal: StoredDay) -> None:
    for action in asked([*PLAIN, ("reduce", {})]):
        rehearsal.do(action)
    for late in (("reject", {"shot": 1, "because": "x"}), ("fire", {}), ("reduce", {})):
        with pytest.raises(InputError, match="has been reduced"):
            rehearsal.do(*asked([late]))
    for last in asked([("give-verdict", {"verdict": "PASS"}), ("hand-in", {})]):
        rehearsal.do(last)
    with pytest.raises(InputError, match="handed in"):
        rehearsal.do(action_of("note-doubt", {"doubt": "none"}))
    with pytest.raises(InputError, match="is not empty"):
        StoredDay.begin(rehearsal.log.path.parent, load_scenario("plain-day"))
