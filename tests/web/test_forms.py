"""Forms: every parameter, every example, and only words of the page."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, parse_qsl, urlencode

import pytest

import virtual_lab
from tests.asking import Answer
from tests.web.visiting import Visitor, clip_of, form_of, words_of
from virtual_lab.cli.commands import FunctionCommand
from virtual_lab.commands.call import bind
from virtual_lab.commands.lines import shell_words
from virtual_lab.commands.table import every_command
from virtual_lab.commands.wording import parameters_named
from virtual_lab.errors import name_parameters
from virtual_lab.page.fields import form_values
from virtual_lab.page.wording import WORDS, field_name, texts

COMMANDS = {name: each for name, each in every_command().items() if name != "open"}
HIDDEN = WORDS["hidden"]
FOLDED = {"seed", "operator_seed", "workers"}
OF_SHELL = re.compile(
    r"--\w|\[SI\]|several times|exit code|vl\.|virtual-lab|`"
    r"|catalog or (?:a )?\.toml|x,y|first:last"
    r"|\b(?:FOLDER|FILE|NAME|NUMBER|TEXT|BALL\||X,Y|FIRST:LAST|KIND:)|\b(?!e_A|v_f)\w+_\w+"
)


def test_each_exception_is_needed(visitor: Visitor) -> None:
    everywhere = {key for each in COMMANDS.values() for key in each.fields}
    for name, reasons in HIDDEN.items():
        assert reasons.keys() <= (COMMANDS[name].fields.keys() if name in COMMANDS else everywhere)
    assert sum(map(len, HIDDEN.values())) <= 8
    assert OF_SHELL.findall(words_of(visitor.ask("/"))) == []


def test_the_symbols_of_the_page_are_those_of_the_site(visitor: Visitor) -> None:
    row = r'<tr><th scope="row"[^>]*>(.*?)</th><td[^>]*>(.*?)</td><td[^>]*>(.*?)</td>'
    pages = Path(virtual_lab.__file__).with_name("docs")
    lines = (pages / "what-is-what.md").read_text("utf-8").partition("## Symbols")[2].splitlines()
    cells = (line.strip("| ").split(" | ") for line in lines if line.count(" | ") == 3)
    stated = {(symbol, meaning, unit) for symbol, _, meaning, unit in cells}
    plus_minus, *rows = re.findall(row, visitor.ask("/").text)
    assert plus_minus[0] == "±"
    assert len(rows) >= 14
    assert set(rows) <= stated


def unfolded(page: Answer) -> set[str]:
    """Return the names of the fields that are not folded."""
    return form_of(page.text.partition("<details")[0])[1]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_form_has_all_fields_in_words_of_the_page_and_keeps_its_example(
    visitor: Visitor, name: str
) -> None:
    """An untouched form states nothing. Command line, form, what it sends, command line again.

    A field that is filled in is not folded, and one with its default is.
    """
    command, page = COMMANDS[name], visitor.ask(f"/form/{name}")
    sent, names = form_of(page.text)
    hidden = command.fields.keys() & {**HIDDEN["everywhere"], **HIDDEN.get(name, {})}
    assert names - {"point"} == command.fields.keys() - hidden  # point: the one that a click sets
    assert form_values(command, parse_qs(urlencode(sent))) == {}
    assert OF_SHELL.findall(words_of(page)) == []
    line = FunctionCommand(command)
    call = line.call(line.make_context(name, shlex.split(command.example)))
    new = dict.fromkeys(hidden & call.values.keys(), "new")
    values = {
        key: each
        for key, each in call.values.items()
        if key not in hidden and each != command.fields[key].default
    }
    shown = unfolded(page)
    assert values.keys() - FOLDED <= shown <= command.fields.keys() - FOLDED | {"point"}
    untouched = urlencode(parse_qsl(urlencode(sent)))  # a field without a text is not sent
    assert unfolded(visitor.ask(f"/form/{name}?{untouched}")) == shown
    filled = urlencode({key: texts(each) for key, each in values.items()}, doseq=True)
    page = visitor.ask(f"/form/{name}?{filled}")
    assert unfolded(page) == shown | values.keys()
    sent, _ = form_of(page.text)
    entered = form_values(command, parse_qs(urlencode(sent)))
    assert entered.keys() == values.keys()
    again, expected = (bind(command, {**new, **each}) for each in (entered, values))
    assert sorted(shell_words(again)) == sorted(shell_words(expected))


def test_boxes_that_were_not_ticked_stay_so(visitor: Visitor) -> None:
    pages = (visitor.ask(f"/form/sweep{values}").text for values in ("", "?all=yes"))
    assert [" checked" in page for page in pages] == [True, False]


def test_a_form_folds_most_fields_and_loads_no_simulation(tmp_path: Path) -> None:
    code = f"""if True:
    import sys
    from tests.web.visiting import Visitor, Path, form_of
    page = Visitor(Path({str(tmp_path)!r})).ask("/form/certify").text
    assert form_of(page.partition("<details")[0])[1] == {{"bat", "procedure"}}
    print([name for name in sys.modules if name.startswith(("rigs", "virtual_lab.simulation"))])"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("name", "fields", "key", "sentence"),
    [
        ("plan", "procedure=bbcor", "target_u", "Fill in this field."),
        ("operating", "laboratories=many", "laboratories", "“many” cannot be used."),
        ("certify", "bat=r161&seed=-1", "seed", "Allowed: a whole number from 0"),
        ("track", "clip=a&ball=73", "ball", "Allowed: a diameter with its unit, e.g. 73mm"),
        ("track", "clip=a.avi", "ball", "The scale is unknown; give “Ball”, “Scale” or"),
        ("track", "clip=b.avi", "clip", "No such file or folder, expected"),
        ("track", "clip=c.avi&ball=73mm", "clip", "cannot be opened (cut short, unknown codec"),
    ],
)
def test_a_refused_value_stands_beside_its_field(
    visitor: Visitor, name: str, fields: str, key: str, sentence: str
) -> None:
    """Nothing runs, what was entered stays, and the error text is tied to the control."""
    clip_of(visitor.page.folder / "a.avi")
    (visitor.page.folder / "c.avi").write_text("no clip")
    fields = fields.replace("clip=", f"clip={visitor.page.folder}/")
    answer = visitor.ask(f"/form/{name}", fields.encode())
    assert answer.status == 422
    (control,) = re.findall(rf'<[^>]*id="f-{key}"[^>]*>', answer.text)
    assert 'aria-invalid="true"' in control
    assert f"f-{key}-fault" in re.search(r'aria-describedby="([^"]*)"', control)[1]
    assert sentence in re.search(rf'id="f-{key}-fault">(.*?)</p>', answer.text)[1]
    assert set(parse_qsl(fields)) <= set(form_of(answer.text)[0])
    if "“Ball”" in sentence:  # the fields that it names are shown
        assert "f-scale" in (shown := answer.text.partition("<details")[0])
        assert "f-ruler" in shown
    assert not (visitor.page.folder / "runs").exists()


def test_uncertainties_may_be_typed_with_plus_and_minus() -> None:
    values = form_values(COMMANDS["track"], {"clip": ["a.mp4"], "ball": ["73mm+-0.5mm"]})
    assert bind(COMMANDS["track"], values).values["ball"] == "73mm+-0.5mm"


def test_a_message_names_a_field_and_a_value_but_no_pattern() -> None:
    with parameters_named(field_name):
        message = name_parameters("use {fps=240} or {ball_at=X,Y@FRAME}")
    assert message == "use “Frame rate” = 240 or “The ball in one frame”"


def test_folders_and_files_of_the_user_are_offered(visitor: Visitor) -> None:
    """Only those that fit, and nothing from a result's own folder."""
    advice = "There is none in the folder yet: first"
    assert '<input type="file" accept=".zip">' in visitor.ask("/form/score").text
    for name, maker in (
        *(("score", "certify"), ("report", "certify"), ("reduce", "template")),
        *(("campaign check", "campaign%20run"), ("rehearse branch", "rehearse")),
    ):
        assert f'{advice} <a href="/form/{maker}">' in visitor.ask(f"/form/{name}").text
    assert advice not in visitor.ask("/form/certify").text  # certify needs no folder
    (visitor.page.folder / "mine").mkdir()
    (visitor.page.folder / "mine" / "session.json").touch()
    answer = words_of(visitor.ask("/form/score", f"folder={visitor.page.folder}/mine".encode()))
    assert "/mine” is a folder of records (session.json or laboratory.toml); allowed: a" in answer
    shutil.rmtree(visitor.page.folder / "mine")
    home, result = visitor.page.folder, ["certificate.json", "settings.toml", "truth/seal.json"]
    others = ["old/certificate.json", "a/settings.toml", "c.toml", "d.json"]
    for path in [*(home / "made" / name for name in result), *(home / name for name in others)]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    for form, expected in (
        ("score", {"made"}),
        ("verify", {"made", "old"}),
        ("certify", {"made", "old", "c.toml"}),  # c.toml: a laboratory or a bat
        ("rehearse", {"made", "old", "c.toml", "d.json"}),
    ):
        page = visitor.ask(f"/form/{form}").text
        assert set(re.findall(rf'value="{home}/(.*?)"', page)) == expected
        assert advice not in page
    assert '<option value="plain-day" selected>The plain day' in page
