"""Descriptions of parameters for a form: kind, titles of choices, unit, limits, folders."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import virtual_lab as vl
from tests.cli.test_commands import COMMANDS
from virtual_lab.commands.call import RefusedError, bind
from virtual_lab.errors import InputError
from virtual_lab.files.folders import folder_kinds

FOREIGN = Path(__file__).parents[1] / "foreign_laboratory" / "records"


def test_every_field_has_a_kind_that_agrees_with_its_rule() -> None:
    """Closed names are complete, and each word that a number's rule forbids is refused."""
    for command in COMMANDS.values():
        for key, each in command.fields.items():
            rule = each.rule.several or each.rule
            assert rule.kind == each.rule.kind, (command.name, key)
            if rule.closed:
                assert all(rule.read(name) == name for name in rule.complete())
            if rule.kind in ("name", "choice"):
                assert rule.complete(), (command.name, key)
            for kind, type_ in (("number", ("int", "float")), ("flag", ("bool",))):
                if each.annotation.split(" ")[0] in type_:
                    assert rule.kind == kind, (command.name, key)


def test_a_choice_has_a_title_and_a_number_its_unit_and_limits() -> None:
    certify, track, plan = (COMMANDS[name].fields for name in ("certify", "track", "plan"))
    titles = certify["bat"].rule.complete()
    assert titles["r161"] == vl.bat("r161").title
    assert certify["rig"].rule.complete()["filmed-cannon"] == vl.rig("filmed-cannon").title
    assert not certify["bat"].rule.closed
    assert certify["faults"].rule.closed
    assert (track["gravity"].unit, track["fps"].unit) == ("m/s²", "1/s")
    assert (track["clip"].rule.kind, certify["seed"].unit) == ("clip", "")
    assert plan["target_u"].rule.limits == "more than 0"
    assert plan["laboratories"].rule.limits == "at least 100"
    assert COMMANDS["daily"].fields["days"].rule.limits == "6 to 10000"


@pytest.mark.parametrize(
    ("name", "values", "refused"),
    [
        ("plan", {"target_u": "0", "laboratories": "99"}, {"target_u", "laboratories"}),
        ("coverage", {"laboratories": "1"}, {"laboratories"}),
        ("profile", {"bats": ["r161"], "swings": ["0.3", "0.6"]}, {"swings"}),
        ("daily", {"days": 5, "drift": 1.0, "hits": "1"}, {"days", "drift", "hits"}),
        ("board", {"board": "chessboard:9x6:40mm", "views": "2"}, {"views"}),
        ("fit-bat", {"path": "a.toml", "members": "1", "out": "b.toml"}, {"members"}),
        ("twin", {"folder": "a", "days": 99}, {"days"}),
        ("certify", {"bat": "r161", "lot": "-1"}, {"lot"}),
    ],
)
def test_a_value_beyond_its_limit_is_refused_before_anything_runs(
    name: str, values: dict[str, object], refused: set[str]
) -> None:
    with pytest.raises(RefusedError) as caught:
        bind(COMMANDS[name], {"procedure": "asa"} | values if name == "plan" else values)
    assert caught.value.faults.keys() == refused


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    """Return one folder of each kind, with the file that identifies it."""
    marks = {"result": "certificate.json", "campaign": "campaign.json", "day": "day.sqlite"}
    marks["laboratory"] = "laboratory.csv"
    every = {kind: tmp_path / kind for kind in (*marks, "records", "other", "empty")}
    for folder in every.values():
        folder.mkdir()
    for kind, mark in marks.items():
        (every[kind] / mark).write_text("{}")
    (every["records"] / "session.json").write_text("{}")
    (every["other"] / "notes.txt").write_text("")
    shutil.copytree(FOREIGN, tmp_path / "foreign")
    return every | {"foreign": tmp_path / "foreign", "missing": tmp_path / "missing"}


def test_the_kind_of_a_folder_is_that_of_its_content(folders: dict[str, Path]) -> None:
    kinds = {name: folder_kinds(path) for name, path in folders.items()}
    others = {"empty": "new", "missing": "new", "foreign": "records"}
    expected = {name: {others.get(name, name)} for name in folders} | {"other": set()}
    assert kinds == expected
    assert folder_kinds(folders["other"] / "notes.txt") == set()
    assert folder_kinds(Path("x" * 300)) in (set(), {"new"})


def test_a_rehearsed_day_is_also_a_result(folders: dict[str, Path]) -> None:
    day = folders["day"]
    shutil.copy(folders["result"] / "certificate.json", day)
    assert folder_kinds(day) == {"day", "result"}
    for name, values in (("score", {}), ("rehearse branch", {"entry": 3, "folder": "new"})):
        key, *_ = COMMANDS[name].fields
        assert bind(COMMANDS[name], values | {key: str(day)}).values[key] == day
    with pytest.raises(RefusedError, match="is a day of a rehearsal"):
        bind(COMMANDS["campaign check"], {"folder": str(day)})


@pytest.mark.parametrize(
    ("name", "key", "allowed"),
    [
        ("score", "folder", {"result"}),
        ("verify", "folder", {"result"}),
        ("report", "folders", {"result"}),
        ("reduce", "records", {"records", "foreign"}),
        ("twin", "folder", {"result", "records", "foreign"}),
        ("campaign check", "folder", {"campaign"}),
        ("rehearse branch", "day", {"day"}),
        ("template", "folder", set()),
    ],
)
def test_a_folder_of_another_kind_is_refused(
    name: str, key: str, allowed: set[str], folders: dict[str, Path]
) -> None:
    """The error names the folder, what it is and what is allowed, in one line."""
    rule = COMMANDS[name].fields[key].rule
    for kind, folder in folders.items():
        if kind in allowed or kind in ("other", "empty", "missing"):
            assert rule.read(folder) in (folder, (folder,))
        else:
            with pytest.raises(InputError, match=rf"{kind}: folder; is .*; allowed: a ") as caught:
                rule.read(folder)
            assert "\n" not in str(caught.value)
