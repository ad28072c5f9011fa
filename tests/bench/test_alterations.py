"""Alterations of a stored day, by files alone or made again, show in the table of a class."""

from __future__ import annotations

import hashlib
import json
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

import virtual_lab as vl
from virtual_lab.bench.day.day import DayEvent
from virtual_lab.bench.day.log import LOG, DayLog
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.review import ClassDay, replay, summary
from virtual_lab.bench.machines.stored_day import SECRET, StoredDay
from virtual_lab.errors import InputError

Change = Callable[[Any], object]  # alters a document in place


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a day of the book, in a laboratory that may have faults."""
    day = vl.rehearse(operator="cheating", seed=3)
    return day.save(tmp_path_factory.mktemp("days") / "day")


@pytest.fixture
def copy(saved: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "day"))


def row_of(folder: Path) -> ClassDay:
    (row,) = summary(folder.parent).rows
    return row


def outcome(folder: Path) -> str:
    """Return the check that finds an alteration: reading of the files, seal or replay."""
    try:
        if not StoredDay(folder).seal.startswith("intact"):
            return "seal"
        return "passes" if all(entry.same for entry in replay(folder).rows) else "replay"
    except InputError as fault:
        assert "\n" not in str(fault)  # noqa: PT017 any of several inputs may be refused
        return "refused"


# --- by files alone -----------------------------------------------------------------------------


def in_database(statement: str) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        with closing(sqlite3.connect(folder / LOG)) as base:
            base.executescript(f"DROP TRIGGER no_change; DROP TRIGGER no_loss; {statement};")

    return edit


def in_json(name: str, **changes: Any) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        document = json.loads((folder / name).read_text("utf-8"))
        (folder / name).write_text(json.dumps(document | changes), "utf-8")

    return edit


def replaced(number: int, old: str, new: str) -> Callable[[Path], None]:
    """Return an edit of the text of one row."""
    swap = f"entry = replace(entry, '{old}', '{new}')"
    return in_database(f"UPDATE entries SET {swap} WHERE number = {number}")


OF_VERDICT = "(SELECT max(number) - 1 FROM entries)"
BY_FILES: dict[str, Callable[[Path], None]] = {
    "the bat": replaced(0, '"r161"', '"ea70"'),
    "the limit": replaced(0, "limit", "limits"),
    "a reading": replaced(2, "1", "2"),
    "the verdict": replaced(OF_VERDICT, "PASS", "FAIL"),
    "a decision": in_database(
        "UPDATE entries SET entry = replace(entry, 'reject', 'accept') WHERE entry LIKE '%reject%'"
    ),
    "an entry less": in_database("DELETE FROM entries WHERE number = 5"),
    "an entry less, renumbered": in_database(
        "DELETE FROM entries WHERE number = 5;"
        "UPDATE entries SET number = number - 1 WHERE number > 5"
    ),
    "no first row": in_database("DELETE FROM entries WHERE number = 0"),
    "no table": in_database("DROP TABLE entries"),
    "no JSON": in_database("UPDATE entries SET entry = '[' WHERE number = 0"),
    "a list": in_database("UPDATE entries SET entry = '[]' WHERE number = 3"),
    "no log": lambda folder: (folder / LOG).write_bytes(b"no database"),
    "no sealed file": lambda folder: (folder / SECRET).unlink(),
    "a sealed list": lambda folder: (folder / SECRET).write_text("[]"),
    "a sealed table": lambda folder: (folder / SECRET).write_text("{}"),
    "a seed of letters": in_json(SECRET, seed="three"),
    "a seed below 0": in_json(SECRET, seed=-1),
    "a salt of letters": in_json(SECRET, salt="zz"),
    "a scenario of numbers": in_json(SECRET, scenario=3),
    "another scenario": in_json(SECRET, scenario="title = 3"),
    "a key more": in_json(SECRET, more=1),
    "another seed": in_json(SECRET, seed=4),
    "another salt": in_json(SECRET, salt="00"),
}


@pytest.mark.parametrize("kind", BY_FILES)
def test_a_file_altered_by_hand_is_noticed(kind: str, copy: Path) -> None:
    BY_FILES[kind](copy)
    assert outcome(copy) in {"refused", "seal"}
    assert vl.verify(copy).state != "whole"


def test_the_debrief_in_the_folder_changes_no_score(copy: Path) -> None:
    sound = row_of(copy)
    debrief = json.loads((copy / "debrief.json").read_text("utf-8"))
    scores = [score | {"value": 1.0} for score in debrief["scores"]]
    in_json("debrief.json", scores=scores, verdict="FAIL", found=["gate-moved"])(copy)
    assert row_of(copy) == sound
    assert sound.record_score < 1
    assert vl.verify(copy).state == "altered"


def test_the_size_of_the_sealed_file_tells_nothing(tmp_path: Path) -> None:
    """Days with short and long seeds, with and without a fault."""
    scenario, sizes = load_scenario("tuesday"), set()
    for seed in (3, 4, 5, 2**127):
        StoredDay.begin(tmp_path / str(seed), scenario, seed)
        sizes.add((tmp_path / str(seed) / SECRET).stat().st_size)
    faults = [scenario.spec.draw_faults(seed).faults for seed in (3, 4, 5, 2**127)]
    assert sorted(set(map(bool, faults))) == [False, True]
    assert len(sizes) == 1


# --- made again by our own functions ------------------------------------------------------------


def made_again(
    folder: Path, change: Callable[[dict[str, Any], list[dict[str, Any]]], object]
) -> None:
    """Write the log again, with right digests, after a change of its start and its events."""
    log = DayLog(folder / LOG)
    start, names = log.morning, [each.name for each in fields(DayEvent)]
    events = [json.loads(json.dumps({n: getattr(e, n) for n in names})) for e in log.events()]
    change(start, events)
    (folder / LOG).unlink()
    again = DayLog.create(folder / LOG, start)
    for number, event in enumerate(events, 1):
        again.append(DayEvent(**event | {"number": number}))


def first(events: list[dict[str, Any]], action: str) -> dict[str, Any]:
    return next(event for event in events if event["action"] == action)


def sealed_again(**changes: Any) -> Callable[[Path], None]:
    """Return an edit of the sealed file, with its digest in the log made again."""

    def edit(folder: Path) -> None:
        in_json(SECRET, **changes)(folder)
        digest = hashlib.sha256((folder / SECRET).read_bytes()).hexdigest()
        made_again(folder, lambda start, _: start["briefing"].update(commitment=digest))

    return edit


def scenario_again(old: str, new: str) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        text = json.loads((folder / SECRET).read_text("utf-8"))["scenario"]
        assert old in text
        sealed_again(scenario=text.replace(old, new))(folder)

    return edit


def constant(key: str) -> Change:
    def change(start: dict[str, Any], _: object) -> None:
        start["session"]["calibration"]["impact.gates.distance_1"][key] *= 1.01

    return change


def reading(action: str, channel: str, column: str) -> Change:
    def change(_: object, events: list[dict[str, Any]]) -> None:
        values = first(events, action)["records"][channel][column]
        while isinstance(values[0], list):
            values = values[0]
        values[0] *= 1.0001

    return change


MADE_AGAIN: dict[str, tuple[str, Any]] = {
    "a constant": ("seal", constant("value")),
    "its u": ("seal", constant("u")),
    "the limit": (
        "seal",
        lambda start, _: start.update(procedure=start["procedure"].replace("limit", "limit ")),
    ),
    "the bat": ("seal", lambda start, _: start["session"].update(bat="ea70")),
    "the rig": ("seal", lambda start, _: start["session"]["rigs"].update(impact="bbcor-cannon")),
    "the commitment": ("seal", lambda start, _: start["briefing"].update(commitment="0" * 64)),
    "the rates": (
        "seal",
        lambda start, _: start["briefing"].update(may_go_wrong={"gate-moved": 0.1}),
    ),
    "an exam": ("seal", lambda start, _: start["briefing"].update(feedback="never")),
    "the budget": ("seal", lambda start, _: start["briefing"].update(shots=99)),
    "the supplied entries": ("refused", lambda start, _: start.update(came_with=3)),
    "the mass of the bat": ("replay", reading("weigh-bat", "bat-mass", "readings")),
    "a gate": ("replay", reading("fire", "gates", "times")),
    "a price": ("replay", lambda _, events: events[3].update(seconds=1.0)),
    "a display": (
        "replay",
        lambda _, events: first(events, "weigh-bat")["shown"].append(["a", 1, "g"]),
    ),
    "a sketch": ("replay", lambda _, events: first(events, "fire")["sketch"].update(more=1)),
    "the place": (
        "replay",
        lambda _, events: first(events, "set-place")["arguments"].update(place=150.0),
    ),
    "a step less": ("replay", lambda _, events: events.remove(first(events, "level-stand"))),
    "a constant of an event": (
        "replay",
        lambda _, events: events[0].update(
            constants={"impact.encoder.scale": {"value": 1.01, "u": 1e-4}}
        ),
    ),
    "an action that does not exist": ("refused", lambda _, events: events[0].update(action="sing")),
    "an action with another's arguments": (
        "refused",
        lambda _, events: events[0].update(arguments={"x": 1}),
    ),
    "a shot that was not fired": (
        "refused",
        lambda _, events: first(events, "reject")["arguments"].update(shot=30),
    ),
    "a record of no kind": (
        "refused",
        lambda _, events: first(events, "fire")["records"].update(gates={"kind": "x"}),
    ),
    "a record of ragged rows": (
        "refused",
        lambda _, events: first(events, "fire")["records"]["gates"].update(times=[[1], [1, 2]]),
    ),
    "a constant of no form": (
        "refused",
        lambda _, events: events[0].update(constants={"a": {"b": 1}}),
    ),
    "no action after the hand-in": ("refused", lambda _, events: events.append(events[0])),
    # a date and texts need a signature
    "the date": ("passes", lambda start, _: start["session"].update(date="2020-02-02")),
    "the person": ("passes", lambda start, _: start["briefing"].update(operator="somebody")),
    "a stated reason": (
        "passes",
        lambda _, events: first(events, "reject")["arguments"].update(because="so"),
    ),
}


@pytest.mark.parametrize("kind", MADE_AGAIN)
def test_a_log_made_again_contradicts_the_sealed_file(kind: str, copy: Path) -> None:
    expected, change = MADE_AGAIN[kind]
    made_again(copy, change)
    assert outcome(copy) == expected


SEALED_AGAIN: dict[str, Callable[[Path], None]] = {
    "the seed": sealed_again(seed=4),
    "the salt": sealed_again(salt="00" * 16),
    "the bat": scenario_again('bat = "r161"', 'bat = "ea70"'),
    "a fault": scenario_again("procedure =", 'faults = ["gate-moved"]\nprocedure ='),
    "a possible fault": scenario_again(
        "procedure =", "may_go_wrong = { gate-moved = 0.1 }\nprocedure ="
    ),
}


@pytest.mark.parametrize("kind", SEALED_AGAIN)
def test_a_sealed_file_made_again_contradicts_the_log(kind: str, copy: Path) -> None:
    SEALED_AGAIN[kind](copy)
    assert outcome(copy) in {"seal", "replay"}


@pytest.mark.parametrize(
    ("kind", "shown"), [("a price", ("intact", False)), ("a constant", "BROKEN")]
)
def test_the_table_of_a_class_shows_seal_and_replay(
    kind: str, shown: tuple[str, bool] | str, copy: Path
) -> None:
    made_again(copy, MADE_AGAIN[kind][1])
    table = summary(copy.parent)
    (row,) = table.rows
    assert shown in {row.seal, (row.seal, row.replay_agrees)}
    assert ("NO" in table.text) is not row.replay_agrees


def test_a_day_that_cannot_be_used_is_named_and_the_others_are_shown(
    copy: Path, saved: Path
) -> None:
    shutil.copytree(saved, copy.parent / "other")
    (copy / SECRET).write_text("{}")
    table = summary(copy.parent)
    unusable, whole = table.rows
    assert (unusable.trainee, whole.trainee, whole.seal) == ("day", "other", "intact")
    assert table.code == 4
    assert unusable.seal.startswith("unusable: ")
    assert str(copy / SECRET) in table.text
    shutil.rmtree(copy)
    table = summary(copy.parent)
    assert (table.rows, table.code) == ([whole], 0)
