"""Conventions of all commands: sections of the help, folders, files, progress."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import click
import pytest
from numba import njit

from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab.cli import cli
from virtual_lab.output import progress as module
from virtual_lab.output.progress import show_progress


def test_the_help_lists_every_command_under_its_purpose(run: Run) -> None:  # noqa: F811
    _, out, _ = run("--help")
    assert len(out.split()) <= 300
    parts = ["Test a bat:", "Bats", "Studies", "Camera:", "Speed and accuracy:", "Shell:"]
    assert [out.index(part) for part in parts] == sorted(out.index(part) for part in parts)
    listed = out[out.index("Test a bat:") :]
    for name, command in cli.commands.items():
        assert f"  {name} " in listed
        assert command.get_short_help_str(1000).split()[0] in listed
    assert "..." not in listed
    assert sum(map(len, cli.sections.values())) == len(cli.commands)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            "certify",
            "out/BAT-PROCEDURE, followed by -seed-SEED and -number-NUMBER if given;",
        ),
        ("daily", "out/daily, followed by -seed-SEED if given;"),
        ("track", "CLIP-track beside the clip;"),
    ],
)
def test_the_help_states_the_default_folder(command: str, said: str, run: Run) -> None:  # noqa: F811
    assert f"[default: {said} -2, -3," in " ".join(run(command, "--help")[1].split())


@pytest.mark.parametrize("name", sorted(cli.commands))
def test_every_command_shares_the_conventions(name: str) -> None:
    """Commands have `--json`, `--seed`, `--out` if they draw a picture, and help on options."""
    command = cli.commands[name]
    below = command.commands.values() if isinstance(command, click.Group) else [command]
    for each in below:
        options = {option: parameter for parameter in each.params for option in parameter.opts}
        assert "--json" in options or name == "completion"
        assert "--out" in options or "--plot" not in options
        assert "--first-seed" not in options
        if "--laboratories" in options:
            assert "--seed" in options
        for option in options.values():
            if isinstance(option, click.Option):
                assert option.help or option.show_default, (name, option.opts)


def test_the_seed_is_in_the_folder_only_where_it_was_given(run: Run, tmp_path: Path) -> None:  # noqa: F811
    for words in ([], ["--seed", "12", "--number", "3"], []):
        code, out, _ = run("certify", "ea70", *words)
        assert code == 0
    assert out.endswith("out/ea70-astm-f1881-2/certificate.html\n")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    truth = (tmp_path / "out" / names[-1] / "truth" / "truth.json").read_text()
    assert '"seed": 12,\n "number": 3,' in truth
    assert names == ["ea70-astm-f1881", "ea70-astm-f1881-2", "ea70-astm-f1881-seed-12-number-3"]


def test_table_and_picture_go_to_the_named_files(run: Run, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "sub").mkdir()
    files = ("--csv", "sub/peaks.csv", "--plot", "peaks.svg")
    code, out, _ = run("profile", "r161", "ea70", *files)
    assert code == 0
    assert out.splitlines()[-2:] == ["sub/peaks.csv", "peaks.svg"]
    assert (tmp_path / "sub" / "peaks.csv").read_text().startswith("bat,swing_exponent,")
    assert "<svg" in (tmp_path / "peaks.svg").read_text()[:400]
    code, out, err = run(
        "slope", "r161", "ea70", "--csv", "slope.csv", "--plot", "slope.png", "--json"
    )
    assert (code, err) == (0, "slope.csv\nslope.png\n")
    assert json.loads(out)[-1]["bat"] == "deviation"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("slope --csv table.txt", "ends in .csv"),
        ("slope --csv there.csv", "exists already"),
        ("profile r161 --plot picture.bmp", ".png, .svg, .pdf"),
        (f"slope --csv {'x' * 300}.csv", "cannot be written"),
        ("slope --csv there.csv/table.csv", "cannot be written"),
    ],
)
def test_files_that_cannot_be_written_are_named(
    words: str,
    said: str,
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    (tmp_path / "there.csv").write_text("years of work")
    code, out, err = run(*words.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, "no such line of progress"
        time.sleep(0.005)


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


class Old(Terminal):
    encoding = "latin-1"


@pytest.mark.parametrize(("stream", "mark"), [(Terminal, "█"), (Old, "#")])
def test_progress_is_a_bar_with_the_time_left(
    stream: type[io.StringIO], mark: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line is rewritten in a terminal, and removed at the end."""
    monkeypatch.setattr(module, "PATIENCE", 0.02)
    monkeypatch.setattr(module, "BAR_STEP", 0.02)
    monkeypatch.setenv("COLUMNS", "120")
    with show_progress(output := stream()) as progress:
        for done in (0, 20, 70):
            progress("laboratories", done, 100)
        wait(lambda: "70 of 100, about " in output.getvalue())
        progress("drawing")
        wait(lambda: "drawing, 00:" in output.getvalue())
    *lines, blank, end = output.getvalue().split("\r")[1:]
    assert {len(line) for line in (*lines, blank)} == {119}
    assert (blank.strip(), end) == ("", "")
    counted = [line for line in lines if "70 of 100" in line]
    drawn = re.fullmatch(r"laboratories \|(.+)\| 70 of 100, about \d+ s left", counted[-1])
    assert drawn
    assert drawn[1].count(mark) == pytest.approx(0.7 * len(drawn[1]), abs=1)
    assert re.fullmatch(r"drawing, 00:\d\d", lines[-1].rstrip())
    monkeypatch.setattr(module, "PATIENCE", 60.0)
    with show_progress(quick := stream()) as progress:
        progress("bats")
    assert quick.getvalue() == ""


class Display:
    """`display` of a notebook: the outputs that a saved notebook would have, and all texts."""

    def __init__(self) -> None:
        self.outputs: list[dict[str, str]] = []
        self.texts: list[str] = []

    def __call__(self, data: dict[str, str], *, raw: bool, display_id: bool) -> Display:
        assert raw
        assert display_id
        self.outputs.append(data)
        return self

    def update(self, data: dict[str, str], *, raw: bool) -> None:
        assert raw
        self.outputs[-1] = data
        self.texts.append(data["text/plain"])


def test_a_notebook_keeps_one_empty_output_of_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    module_of_display = ModuleType("IPython.display")
    module_of_display.display = display = Display()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module_of_display)
    monkeypatch.setattr(module, "PATIENCE", 0.02)
    monkeypatch.setattr(module, "BAR_STEP", 0.02)
    notebook = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})
    with show_progress(output := notebook()) as progress:
        progress("laboratories", 70, 100)
        for _ in range(1000):  # 10 s at most
            if len(display.texts) < 2:
                time.sleep(0.01)
    assert output.getvalue() == ""
    assert display.outputs == [{"text/plain": ""}]
    assert len(display.texts) > 2
    assert any("█" in text and "70 of 100" in text for text in display.texts)


@pytest.mark.parametrize(
    ("elapsed", "left"), [(10.0, "6 s"), (100.0, "60 s"), (200.0, "2 min"), (12_000.0, "2 h")]
)
def test_the_time_left_is_that_of_the_present_task(
    elapsed: float, left: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 70 laboratories 50 were done in 10 s, so the other 30 take 6 s.

    The first 20 took longer, because a kernel was compiled for them.
    """
    clock = iter([0.0, 10.0, 100.0, 100.0 + elapsed])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(clock))
    status = module._Status()
    for done in (0, 20, 70):
        status.update("laboratories", done, 100)
    assert status.line(module.LINE) == f"laboratories: 70 of 100, about {left} left"


def test_progress_in_a_pipe_is_a_line_every_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    assert module.PIPE_STEP == 10.0
    monkeypatch.setattr(module, "PIPE_STEP", 0.05)
    began = time.monotonic()
    with show_progress(output := io.StringIO()) as progress:
        for done in (0, 20, 50):
            progress("laboratories", done, 100)
            time.sleep(0.01)
        wait(lambda: output.getvalue().count("\n") >= 2)
    lines = output.getvalue().splitlines()
    assert len(lines) <= (time.monotonic() - began) / 0.05
    form = r"… laboratories: 50 of 100, about \d+ s left"  # more on a busy machine
    assert all(re.fullmatch(form, line) for line in lines)
    assert "\r" not in output.getvalue()
    with show_progress(silent := io.StringIO()) as progress:
        progress("")  # a page is served
        time.sleep(0.12)  # two steps
    assert silent.getvalue() == ""


def test_tqdm_is_loaded_only_where_progress_is_shown() -> None:
    code = """if True:
        import io, sys, time
        import virtual_lab as vl
        from virtual_lab.output import progress
        vl.slope(["r161", "ea70"])
        print("tqdm" in sys.modules)
        progress.PIPE_STEP = 0.0
        with progress.show_progress(stream := io.StringIO()):
            while not stream.getvalue():
                time.sleep(0.01)
        print("tqdm" in sys.modules)"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["False", "True"]


def test_progress_names_a_kernel_in_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    def kernel(x: float) -> float:
        return x + 1

    monkeypatch.setattr(module, "PIPE_STEP", 1e-3)
    with show_progress(stream := io.StringIO()) as progress:
        progress("impact rig")
        for _ in range(20):
            if "kernel" not in stream.getvalue():
                njit(kernel)(1.0)
        time.sleep(0.05)
    lines = stream.getvalue().splitlines()
    assert any(re.fullmatch(r"… .*, \d\d:\d\d, compiling kernel .*", line) for line in lines)
    assert "compiling" not in lines[-1]


def test_a_closed_stream_of_progress_is_no_error() -> None:
    class Gone(Terminal):
        def write(self, _: str) -> int:
            raise BrokenPipeError

    status, over = module._Status(), module.threading.Event()
    monkeypatched = Gone()
    over.wait = lambda _=None: False  # type: ignore[method-assign]
    module._write(status, monkeypatched, over)
