"""Forms: every parameter, every example, and only words of the page."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, urlencode

import pytest

from tests.web.visiting import Form, Visitor
from virtual_lab.cli.commands import FunctionCommand
from virtual_lab.commands.call import bind
from virtual_lab.commands.lines import shell_words
from virtual_lab.commands.table import every_command
from virtual_lab.page.fields import EXCEPTIONS, given, texts

COMMANDS = {name: each for name, each in every_command().items() if name != "open"}
OF_SHELL = re.compile(
    r"--\w|\[SI\]|several times|exit code|vl\.|virtual-lab|`"
    r"|\b(?:FOLDER|FILE|NAME|NUMBER|TEXT|BALL\||X,Y|FIRST:LAST|KIND:)|\b(?!e_A|v_f)\w+_\w+"
)


@pytest.fixture(scope="module")
def visitor(tmp_path_factory: pytest.TempPathFactory) -> Visitor:
    return Visitor(tmp_path_factory.mktemp("lab"))


def lacks(command: str, key: str) -> bool:
    return ("", key) in EXCEPTIONS or (command, key) in EXCEPTIONS


def test_each_exception_is_needed(visitor: Visitor) -> None:
    keys = {(name, key) for name, each in COMMANDS.items() for key in each.fields}
    assert {("", key) for _, key in keys} | keys >= EXCEPTIONS.keys()
    assert len(EXCEPTIONS) <= 8
    assert OF_SHELL.findall(visitor.ask("/").words) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_form_has_all_fields_in_words_of_the_page_and_keeps_its_example(
    visitor: Visitor, name: str
) -> None:
    """An untouched form states nothing. Command line, form, what it sends, command line again."""
    command, page = COMMANDS[name], visitor.ask(f"/form/{name}")
    form, hidden = Form(page.text), {key for key in COMMANDS[name].fields if lacks(name, key)}
    assert form.names - {"point"} == command.fields.keys() - hidden  # which point a click sets
    assert given(command, parse_qs(urlencode(form.sent))) == {}
    assert OF_SHELL.findall(page.words) == []
    line = FunctionCommand(command)
    call = line.call(line.make_context(name, shlex.split(command.example)))
    new = dict.fromkeys(hidden & call.values.keys(), "new")
    values = {
        key: each
        for key, each in call.values.items()
        if key not in hidden and each != command.fields[key].default
    }
    filled = urlencode({key: texts(each) for key, each in values.items()}, doseq=True)
    sent = Form(visitor.ask(f"/form/{name}?{filled}").text).sent
    entered = given(command, parse_qs(urlencode(sent)))
    assert entered.keys() == values.keys()
    again, expected = (bind(command, {**new, **each}) for each in (entered, values))
    assert sorted(shell_words(again)) == sorted(shell_words(expected))


def test_a_form_loads_no_simulation(tmp_path: Path) -> None:
    code = f"""if True:
    import sys
    from tests.web.visiting import Visitor, Path
    assert "ncaa-swing" in Visitor(Path({str(tmp_path)!r})).ask("/form/certify").text
    print([name for name in sys.modules if name.startswith(("rigs", "virtual_lab.simulation"))])"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_seed_and_workers_are_folded(visitor: Visitor) -> None:
    """The first fields are positional, required, or in the example."""
    first, _, more = visitor.ask("/form/certify").text.partition("<details")
    assert Form(first).names == {"bat", "procedure"}
    assert {"seed", "motion", "reality"} < Form(more).names
    assert "workers" not in Form(visitor.ask("/form/sweep").text.partition("<details")[0]).names


@pytest.mark.parametrize(
    ("name", "fields", "key", "sentence"),
    [
        ("plan", [("procedure", "bbcor")], "target_u", "Fill in this field."),
        ("operating", [("laboratories", "many")], "laboratories", "“many” cannot be used."),
        ("certify", [("bat", "r161"), ("seed", "-1")], "seed", "Allowed: a whole number from 0"),
        (
            "track",
            [("clip", "a.mp4"), ("ball", "73")],
            "ball",
            "Allowed: a diameter with its unit, e.g. 73mm",
        ),
    ],
)
def test_a_refused_value_stands_beside_its_field(
    visitor: Visitor, name: str, fields: list[tuple[str, str]], key: str, sentence: str
) -> None:
    """Nothing runs, what was entered stays, and the error text is tied to the control."""
    answer = visitor.submit(name, fields)
    assert answer.status == 422
    (control,) = re.findall(rf"<[^>]*id=\"f-{key}\"[^>]*>", answer.text)
    assert 'aria-invalid="true"' in control
    assert f"f-{key}-fault" in re.search(r'aria-describedby="([^"]*)"', control)[1]
    fault = re.search(rf'id="f-{key}-fault">(.*?)</p>', answer.text)
    assert fault
    assert sentence in fault[1]
    assert set(fields) <= set(Form(answer.text).sent)
    assert not (visitor.page.folder / "runs").exists()


def test_uncertainties_may_be_typed_with_plus_and_minus(visitor: Visitor) -> None:
    values = given(COMMANDS["track"], {"clip": ["a.mp4"], "ball": ["73mm+-0.5mm"]})
    assert bind(COMMANDS["track"], values).values["ball"] == "73mm+-0.5mm"


def test_folders_and_files_of_the_user_are_offered(tmp_path: Path) -> None:
    """Only those that fit, and nothing from a result's own folder."""
    for name in (
        "result/certificate.json",
        "result/settings.toml",
        "reduced/certificate.json",
        "other/a.txt",
        "mine.toml",
        "result/truth/seal.json",
        "act.json",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    visitor = Visitor(tmp_path)
    assert f'value="{tmp_path / "result"}"' in visitor.ask("/form/score").text
    assert str(tmp_path / "other") not in visitor.ask("/form/score").text
    assert str(tmp_path / "reduced") not in visitor.ask("/form/score").text
    assert str(tmp_path / "reduced") in visitor.ask("/form/verify").text
    rehearse = visitor.ask("/form/rehearse").text
    assert ("act.json" in rehearse, "seal.json" in rehearse) == (True, False)
    assert '<option value="plain-day" selected>The plain day' in rehearse
    form = visitor.ask("/form/certify").text
    assert f'value="{tmp_path / "mine.toml"}"' in form
    assert "settings.toml" not in form
