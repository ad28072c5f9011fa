"""The lines of a shell and of Python that carry out the same call."""

from __future__ import annotations

import ast
import shlex
from pathlib import Path
from typing import Any

import pytest

import virtual_lab as vl
from tests.cli.test_commands import COMMANDS, context_of
from virtual_lab.cli import cli
from virtual_lab.cli.commands import FunctionCommand
from virtual_lab.commands.call import Call, RefusedError, bind, field_of
from virtual_lab.commands.lines import python_line, shell_line, shell_words
from virtual_lab.errors import InputError

# a call of each command whose example leaves a kind of value out: flags, lists, numbers, sheets
MORE = [
    "certify 'a bat.toml' --no-film --instrument pivot-gates=worse.toml --pdf --paper letter",
    "certify r161 --fault aim-along --fault gate-misses --seed 7 --number 3 --out 'new folder'",
    "profile r161 --swing 0.3 --swing 1e-7 --csv t.csv --plot p.png --out both",
    "daily",
    "plan bbcor --target-u 0.0015 --json",
    "slope -- -odd-name.toml",
    "track 'my clip.mp4' --ball 73mm±0.5mm --region=-5,3,20,30 --scale 10,10:90,10=50cm",
    "rehearse --scenario heavy --seed 18446744073709551616 --operator book",
    "campaign run study.toml --out c --workers 2",
]
# arguments of the methods that save a result, as fields of the command
SAVED = {"save": ["out"], "write": ["out"], "to_csv": ["csv"], "plot": ["plot"]}


def call_of(words: str) -> Call:
    """Return the call that a line states."""
    context = context_of(words)
    name = next(each for each in sorted(COMMANDS, reverse=True) if words.startswith(each))
    return FunctionCommand(COMMANDS[name]).call(context)


def python_call(call: Call, line: str) -> Call:
    """Return the call that lines of Python state, as Python's own parser reads them."""
    values: dict[str, Any] = {}
    for node in ast.walk(ast.parse(line)):
        if not isinstance(node, ast.Call):
            continue
        named = {str(each.arg): ast.literal_eval(each.value) for each in node.keywords}
        places = [ast.literal_eval(each) for each in node.args]
        method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        parameters = call.command.description.parameters
        positional = [key for key, each in parameters.items() if not each.keyword]
        keys = SAVED.get(method, positional)
        values |= dict(zip(keys, places, strict=False)) | named
    if call.command.output.into:
        values["out"] = values.pop(call.command.output.into)
    return bind(call.command, {key: each for key, each in values.items() if key != "index"})


@pytest.mark.parametrize("words", [*(each.example_line for each in COMMANDS.values()), *MORE])
def test_a_line_becomes_a_call_and_the_same_line(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shell → call → shell → the same call, and → Python → the same call."""
    monkeypatch.chdir(tmp_path)
    Path("worse.toml").write_text(vl.instrument("pivot-gates").text)
    call = call_of(words)
    line = shell_line(call, windows=False)
    assert line.startswith("virtual-lab ")
    assert shlex.split(line) == shell_words(call)
    assert call_of(line.removeprefix("virtual-lab ")) == call
    again = python_call(call, python_line(call))
    usual = again.values.get("out") if "out" not in call.values else None
    assert again == Call(call.command, {**call.values, **({"out": usual} if usual else {})})
    assert (usual is not None) == bool(call.command.output.folder and "out" not in call.values)


def test_the_line_of_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It writes the files that the command writes."""
    monkeypatch.chdir(tmp_path)
    words = "profile r161 ea70 --swing 0.3 --out {0} --csv {0}.csv --plot {0}.svg"
    call = call_of(words.format("a"))
    exec(python_line(call), {})
    words = shell_words(call_of(words.format("b")))[1:]
    assert cli.main(words, standalone_mode=False) == 0
    names = [sorted(each.name for each in Path(name).iterdir()) for name in "ab"]
    assert names[0] == names[1]
    assert Path("a.svg").is_file()
    tables = [Path(f"{name}.csv").read_text().splitlines() for name in "ab"]
    assert (tables[0][0], len(tables[0])) == (tables[1][0], len(tables[1]))


def test_a_line_for_windows_has_double_quotes() -> None:
    call = call_of("certify 'a bat.toml'")
    assert shell_line(call, windows=True) == 'virtual-lab certify "a bat.toml"'


def test_values_that_are_not_allowed_have_a_sentence_each() -> None:
    """Each field has its own sentence; the message is that of the first."""
    with pytest.raises(RefusedError) as caught:
        bind(COMMANDS["certify"], {"bat": "r161", "seed": "x", "reality": "idael", "sed": 1})
    assert caught.value.faults == {
        "seed": "'x'; allowed: one whole number from 0 to 2^128 - 1",
        "reality": "'idael'; did you mean ideal? allowed: real, noise-free or ideal",
        "sed": caught.value.faults["sed"],
    }
    assert "did you mean seed" in caught.value.faults["sed"]
    with pytest.raises(InputError, match=r"fit-bat: out; is missing; allowed: a path"):
        bind(COMMANDS["fit-bat"], {"path": "measured.toml"})


@pytest.mark.parametrize(
    ("name", "fault", "key"),
    [
        ("certify", InputError("", "bat", "r999", "unknown"), "bat"),
        ("profile", InputError("", "bat", "r999", "unknown"), "bats"),
        ("track", InputError("{ball}", "73", None, "allowed: a length"), "ball"),
        ("track", InputError("", "{film_of_track}", None, "no"), "film_of_track"),
        ("track", InputError("clip.mp4", "frames", 3, "too few"), "frames"),
        ("track", InputError("clip.mp4", "rate", None, "no rate; give {fps}"), "fps"),
        ("score", InputError("somewhere", "truth", None, "is missing"), ""),
    ],
)
def test_an_error_belongs_to_a_field(name: str, fault: InputError, key: str) -> None:
    assert field_of(COMMANDS[name], fault) == key
