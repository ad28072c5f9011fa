"""Every example in the help of a command runs, in a folder that has the files it names."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

import pytest

from tests.cli.test_cli import MEASURED
from tests.cli.test_commands import COMMANDS
from tests.video.scenes import Film, write_video
from virtual_lab.cli import cli
from virtual_lab.output.tables import WIDEST

EXAMPLES = {name: each.example_line for name, each in COMMANDS.items()}
# examples that take a quarter of a second and less, beside the files that several of them read
FAST = ("score", "reduce", "verify", "template", "list", "show", "profile", "slope")
SCENARIO = Path(__file__).parents[2] / "data/bench/scenarios/plain-day.toml"
INTERLAB = Path(__file__).parents[1] / "studies" / "interlab-asa.toml"
STUDY = 'bats = ["r161"]\nprocedures = ["bbcor"]\nlaboratories = 2\nseed = 1\n'


def run(words: str) -> None:
    assert cli.main(shlex.split(words), standalone_mode=False) == 0, words


def run_campaign() -> None:
    Path("study.toml").write_text(STUDY)
    run(EXAMPLES["campaign run"])


def make_pictures() -> None:
    run("board --board chessboard:9x6:40mm --views 4 --seed 1 --out board")
    Path("board/pictures").rename("pictures")


def make_class() -> None:
    Path("days").mkdir()
    run("rehearse --operator expert --seed 3 --out days/one")


# files and folders that examples name, and the functions that make them
FILES: dict[str, Callable[[], object]] = {
    "out/r161-bbcor-seed-7": lambda: run(EXAMPLES["certify"]),
    "out/other": lambda: run("certify r161 --procedure bbcor --seed 8 --out out/other"),
    "measured.toml": lambda: Path("measured.toml").write_text(MEASURED),
    "mine.toml": lambda: Path("mine.toml").write_text(SCENARIO.read_text()),
    "laboratories.toml": lambda: Path("laboratories.toml").write_text(INTERLAB.read_text()),
    "study.toml": lambda: Path("study.toml").write_text(STUDY),
    "campaign": run_campaign,
    "clip.mp4": lambda: write_video(Path("clip.mp4"), list(Film().frames()), 240),
    "days": make_class,
    "day": lambda: run(EXAMPLES["rehearse"]),
    "pictures": make_pictures,
}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the files that examples read, each made once."""
    return tmp_path_factory.mktemp("examples")


@pytest.mark.parametrize(
    "name",
    [each if each in FAST else pytest.param(each, marks=pytest.mark.long) for each in EXAMPLES],
)
def test_the_example_of_a_command_runs(
    name: str,
    store: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The example ends with exit code 0, prints a result, and writes the file that it names.

    A line of a table, which has cells two spaces apart, has at most 110 characters.
    """
    words = shlex.split(EXAMPLES[name])
    new = words[words.index("--out") + 1 :] if "--out" in words else []
    for word in words[1:]:
        for file, make in FILES.items():
            if word not in new and f"{word}/".startswith(f"{file}/"):
                if not (store / file).exists():
                    with chdir(store):
                        make()
                top = Path(file).parts[0]
                if not (tmp_path / top).exists():
                    (tmp_path / top).symlink_to(store / top)
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    run(EXAMPLES[name])
    printed = capsys.readouterr().out
    assert printed.strip()
    tables = (line.rstrip() for line in printed.splitlines() if "  " in line.strip())
    assert [line for line in tables if len(line) > WIDEST] == []
    assert all(Path(each).exists() for each in new)
