"""Commands made from signatures: options, help, settings in a file, and examples."""

from __future__ import annotations

import importlib.metadata
import inspect
import json
import shlex
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import virtual_lab as vl
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab import api
from virtual_lab.api.describing import first_line
from virtual_lab.cli import cli
from virtual_lab.cli.commands import FunctionCommand
from virtual_lab.commands.command import Command
from virtual_lab.commands.output import PRINTED
from virtual_lab.commands.table import every_command
from virtual_lab.errors import InputError
from virtual_lab.sheets import settings_text

PACKAGE = Path(__file__).parents[1] / "third_party_rig" / "pyproject.toml"
LOADED = """if True:
    import sys, virtual_lab as vl
    from virtual_lab.cli import cli
    commands = [cli, *cli.commands.values()]
    for group in ("campaign", "rehearse"):
        commands += cli.commands[group].commands.values()
    for each in commands:
        assert len(each.get_help(each.context_class(each))) > 100
    for name in filter(str.islower, dir(vl)):
        assert getattr(vl, name).__doc__ or name.startswith("__")
    print("numpy" in sys.modules)
"""


COMMANDS = every_command()


def parameters_of(words: str) -> dict[str, Any]:
    """Return the values of a command's parameters, as parsed from a line; nothing runs."""
    return context_of(words).params


def context_of(words: str) -> click.Context:
    """Return the context of a parsed line; nothing runs."""
    context: click.Context = click.Context(cli)
    command: click.Command = cli
    rest = shlex.split(words)
    while isinstance(command, click.Group) and rest and not rest[0].startswith("-"):
        subcommand = command.get_command(context, rest[0])
        if subcommand is None:
            break
        command, rest = subcommand, rest[1:]
    return command.make_context(words, rest)


def test_help_and_docstrings_load_no_numpy() -> None:
    """Help and docstrings of all commands and functions stay quick: a study loads for a second."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED], check=True, capture_output=True, text=True
    )
    assert done.stdout == "False\n"


@pytest.mark.parametrize("name", sorted(filter(str.islower, api.PLACES)))
def test_a_signature_read_from_the_source_is_that_of_the_function(name: str) -> None:
    """Names, order, kinds and literal defaults agree with those of Python's `inspect`."""
    module, there = api.PLACES[name]
    real = inspect.signature(getattr(import_module(module), there)).parameters
    read = getattr(api, name).__signature__.parameters
    assert [(each.name, each.kind) for each in read.values()] == [
        (each.name, each.kind) for each in real.values()
    ]
    for key, each in real.items():
        if isinstance(each.default, None | bool | int | str | tuple):
            assert (read[key].default, type(read[key].default)) == (
                each.default,
                type(each.default),
            )


def test_every_parameter_of_a_command_is_an_option_with_words() -> None:
    """The option has the parameter's name, in the singular if it may be given several times."""
    for words, command in COMMANDS.items():
        options = {str(each.name): each for each in FunctionCommand(command).params}
        assert command.parameters.keys() <= options.keys(), words
        for key in command.parameters:
            option = options[key]
            if isinstance(option, click.Option):
                assert option.help, (words, key)
                named = key.removesuffix("s") if option.multiple else key
                assert option.opts[0] == f"--{named.replace('_', '-')}"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_example_of_a_command_is_valid(name: str) -> None:
    """The options of the example exist, and their values are allowed."""
    example = COMMANDS[name].example_line
    assert parameters_of(example)


def test_settings_in_a_file_act_as_options(run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Settings have the names of Python's parameters; options on the command line replace them."""
    (tmp_path / "s.toml").write_text(
        'bat = "ea70"\nprocedure = "bbcor"\nseed = 7\nfilm = true\nfaults = ["aim-along"]\n'
        'reality = "ideal"\npdf = true\n'
    )
    values = parameters_of("certify --config s.toml")
    stated = {"bat": "ea70", "procedure": "bbcor", "seed": 7, "film": True, "pdf": True}
    assert stated.items() <= values.items()
    assert (values["faults"], values["reality"]) == (("aim-along",), "ideal")
    other = parameters_of("certify r161 --config s.toml --seed 8 --no-film --fault gate-misses")
    assert (other["bat"], other["seed"], other["film"]) == ("r161", 8, False)
    assert other["faults"] == ("gate-misses",)
    (tmp_path / "p.toml").write_text('bats = "r161"\nswings = 0.3\nball = "game-2003"\n')
    code, out, _ = run("profile", "--config", "p.toml", "--json")
    document = json.loads(out)
    assert (code, document["swing_exponent"], document["ball"]) == (0, 0.3, "game-2003")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('procedur = "bbcor"', ["s.toml", "procedur", "did you mean procedure"]),
        ("seed = -1", ["s.toml", "seed = -1", "from 0 to 2^128 - 1"]),
        ('seed = "7"', ["s.toml", "seed = '7'", "whole number"]),
        ('reality = "idael"', ["s.toml", "did you mean ideal"]),
        ("film = 3", ["s.toml", "film = 3", "True or False"]),
        ("pdf = 1", ["s.toml", "pdf = 1", "True or False"]),
        ("faults = []", ["s.toml", "faults", "at least one"]),
        ("seed = ", ["s.toml", "parsed"]),
    ],
)
def test_settings_that_cannot_be_used_name_the_file(
    text: str,
    words: list[str],
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    (tmp_path / "s.toml").write_text(text)
    code, out, err = run("certify", "r161", "--config", "s.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    for word in words:
        assert word in err


def test_a_wrong_instrument_file_is_refused(run: Run, tmp_path: Path) -> None:  # noqa: F811
    for words, said in (
        ("pivot-gates", "NAME=FILE"),
        ("pivot-gate=w.toml", "did you mean pivot-gates"),
        ("pivot-gates=no.toml", "no such file"),
        (
            "pivot-gates=w.toml",
            "w.toml: kind = ''; allowed: 'light-gate', the kind of pivot-gates",
        ),
    ):
        (tmp_path / "w.toml").write_text('title = "worse"\n')
        code, _, err = run("certify", "r161", "--instrument", words)
        assert (code, err.count("\n")) == (2, 1)
        assert said in err
    gates = vl.instrument("pivot-gates").text.replace("distance_u", "distanz_u")
    (tmp_path / "w.toml").write_text(gates)
    code, _, err = run("certify", "r161", "--instrument", "pivot-gates=w.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert "w.toml: distanz_u; unknown key, did you mean distance_u?" in err


def test_another_package_can_add_a_command(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """An entry point adds a command, which is in the help and has the options of a study."""
    group = "virtual_lab.commands"
    selection = {"group": group}
    points = tomllib.loads(PACKAGE.read_text())["project"]["entry-points"][group]
    points |= {"broken": "third_party_rig.nowhere:none", "certify": points["radar-cosine"]}
    ours = [EntryPoint(name, value, group) for name, value in points.items()]
    installed = importlib.metadata.entry_points
    monkeypatch.setattr(
        "importlib.metadata.entry_points",
        lambda **words: ours if words == selection else installed(**words),
    )
    code, text, err = run("--help")
    assert (code, err.count("\n")) == (0, 2)
    assert "third_party_rig.nowhere:none: broken; is not a command: " in err
    assert "third_party_rig.cosine:cosine: certify; is not a command: another" in err
    assert text.index("From other packages:") < text.index("radar-cosine  Show how much too low")
    code, out, err = run("radar-cosine", "60", "--json", "--csv", "cosine.csv")
    row = {"angle_deg": 60.0, "error_percent": pytest.approx(-50)}
    assert (code, json.loads(out), err) == (0, [row], "cosine.csv\n")
    code, _, err = run("broken")
    assert (code, err.count("\n")) == (2, 1)
    assert "nowhere.py" in err
    code, _, err = run("radar-cosine", "x")
    assert (code, err.splitlines()[-1]) == (
        2,
        "virtual-lab: Invalid value for '[ANGLES]...': 'x'; allowed: a number "
        "(try 'virtual-lab radar-cosine --help')",
    )
    with pytest.raises(InputError, match="no picture"):
        cli.main(["radar-cosine", "--plot", "p.png"], standalone_mode=False)


def test_a_result_folder_keeps_the_settings_that_repeat_it(
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    """The file has the given settings except the hidden ones, and is in the list of files."""
    words = ("--seed", "7", "--reality", "real", "--fault", "aim-along", "--paper", "letter")
    assert run("certify", "ea70", *words, "--out", "first")[0] == 0
    settings = tmp_path / "first" / "settings.toml"
    assert tomllib.loads(settings.read_text()) == {
        "bat": "ea70",
        "reality": "real",
        "paper": "letter",
    }
    assert "fault" not in settings.read_text()
    hidden = ("--seed", "7", "--fault", "aim-along")
    assert run("certify", "--config", str(settings), *hidden, "--out", "second")[0] == 0
    one, other = (
        (tmp_path / name / "records" / "impact" / "gates.csv").read_bytes()
        for name in ("first", "second")
    )
    assert one == other
    for check in ("verify", "score"):
        code, out, err = run(check, "second")
        assert code == 0, out + err
    sealed = vl.certify(vl.bat("r161").with_({"body.material.density": 700})).settings
    assert tomllib.loads(sealed) == {}
    assert "# bat: sheets with changed values" in sealed
    assert run("slope", "--csv", "t.csv", "--config", "first/settings.toml")[0] == 2
    assert run("profile", "r161", "--swing", "0.3", "--out", "p")[0] == 0
    at_shell = (tmp_path / "p" / "settings.toml").read_text()
    assert at_shell.startswith("# virtual-lab profile --config settings.toml\n")
    assert tomllib.loads(at_shell) == {"bats": ["r161"], "swings": [0.3]}
    vl.profile(Path("r161"), swings=(each for each in (0.3,))).save(tmp_path / "q")
    in_python = (tmp_path / "q" / "settings.toml").read_text()
    assert in_python.startswith("# arguments of vl.profile\n")
    assert tomllib.loads(in_python) == {"bats": ["r161"], "swings": [0.3]}


def test_settings_of_a_sealed_test_hide_the_laboratory() -> None:
    """The same text with and without a seed, a fault and another instrument."""
    gates = vl.instrument("pivot-gates").with_(distance_u="1 mm")
    hidden = {"seed": 7, "faults": ("aim-along",), "instruments": (gates,)}
    plain, other = (
        settings_text("x", {"bat": "r161", **more}, sealed=True) for more in ({}, hidden)
    )
    assert plain == other
    assert "instruments" in settings_text("x", hidden, sealed=False)


def test_settings_hold_no_absolute_path_and_no_key(tmp_path: Path) -> None:
    """Only the name of a file, because the folder may be handed on."""
    bat, key = str(tmp_path / "mine.toml"), tmp_path / "key.pem"
    paths = {"bat": bat, "laboratory": tmp_path / "lab.toml", "history": (tmp_path / "tests",)}
    text = settings_text("x", {**paths, "procedure": "sub/rules.toml", "sign": key}, sealed=True)
    assert tomllib.loads(text) == {
        "bat": "mine.toml",
        "laboratory": "lab.toml",
        "history": ["tests"],
        "procedure": "sub/rules.toml",
    }
    assert "key" not in text


def test_settings_name_what_no_file_gives_again() -> None:
    """The settings contain neither the pixels of a clip nor a function."""
    frames = np.zeros((3, 20, 20), np.uint8)
    settings = vl.track(frames, ball="73mm", fps=240, tripod=True).settings
    assert settings == (
        "# arguments of vl.track\n# clip: ndarray of the program\n"
        'ball = "73mm"\nfps = 240.0\ntripod = true\n'
    )


def test_a_sweep_at_the_shell_equals_that_in_python(run: Run, tmp_path: Path) -> None:  # noqa: F811
    words = ("sweep", "r161", "--laboratories", "1", "--seed", "4", "--csv", "rows.csv")
    code, out, _ = run(*words, "--json")
    table = vl.sweep("r161", laboratories=1, seed=4)
    assert code == 0
    assert json.loads(out) == json.loads(table.to_json(orient="records"))
    assert (tmp_path / "rows.csv").read_text().startswith("bat,procedure,laboratory,")
    verdicts = vl.sweep(["r161", "ea70"], procedures="bbcor", laboratories=2)["verdict"].tolist()
    counts = {f"{verdicts.count(each)} {each}" for each in verdicts}
    code, out, _ = run("sweep", "r161", "ea70", "--procedure", "bbcor", "--laboratories", "2")
    assert set(out.splitlines()[0].removeprefix("tests: ").split(", ")) == counts


TYPED = '''
def sides(side: Literal["left", "right"], size: list[float] = [], *, file: Path | None = None):
    """Say a side."""


def tables(of: DataFrame, side: Literal[1, 2] = 1):
    """Say nothing."""
'''


def test_a_rule_follows_from_the_annotation_of_another_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Choices, numbers, lists and paths have a rule; a command of another type is refused."""
    (tmp_path / "sided.py").write_text(TYPED)
    monkeypatch.syspath_prepend(tmp_path)
    row = Command("sides", ("sided", "sides"), output=PRINTED)
    row.require_rules()
    command = FunctionCommand(row)
    values = command.make_context("sides", ["left", "2", "3e1", "--file", "a.csv"]).params
    assert values == {"side": "left", "size": (2, 30), "file": Path("a.csv"), "as_json": False}
    for wrong, allowed in ((["lefd"], "did you mean left"), (["left", "x"], "a number")):
        with pytest.raises(click.BadParameter, match=allowed):
            command.make_context("sides", wrong)
    other = Command("tables", ("sided", "tables"))
    with pytest.raises(ValueError, match=r"the type of of has no rule \(DataFrame\)"):
        other.require_rules()


def test_every_parameter_of_a_command_has_a_rule() -> None:
    for name, command in COMMANDS.items():
        assert command.parameters, name
        command.require_rules()


def test_a_function_without_a_docstring_is_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The docstring of the next function is not taken; a module may be a single file."""
    text = 'def bare(x):\n    return x\n\n\ndef said(x):\n    """Say x."""\n'
    (tmp_path / "alone_here.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert first_line("alone_here", "said") == "Say x."
    with pytest.raises(ValueError, match="alone_here has no function bare with a docstring"):
        first_line("alone_here", "bare")
