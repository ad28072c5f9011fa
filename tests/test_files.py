"""Drafts of real processes that are killed, stopped or running, folders of others, and tables."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import FunctionType

import numpy as np
import pandas as pd
import pytest

from tests.warming import kernels
from virtual_lab.errors import InputError
from virtual_lab.files import new_files, new_folder
from virtual_lab.files.caches import CACHE, one_process_at_a_time
from virtual_lab.files.documents import parse_table
from virtual_lab.files.tables import csv_text
from virtual_lab.records.record import require_numbers

HALF_WAY = """
import sys, time
from pathlib import Path
from virtual_lab.files import new_folder
with new_folder(Path(sys.argv[1])) as draft:
    (draft / "half.txt").write_text("half of a certificate")
    print("half-way", flush=True)
    time.sleep(60)
"""


@contextmanager
def half_way(target: Path) -> Iterator[subprocess.Popen[str]]:
    """Run a process that stops halfway through filling its folder, and kill it at the end."""
    command = [sys.executable, "-c", HALF_WAY, str(target)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half-way\n"
        try:
            yield process
        finally:
            process.kill()


def write(target: Path) -> None:
    with new_folder(target) as draft:
        (draft / "whole.txt").write_text("a certificate")


def hidden(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.name.startswith(".")}


def test_the_draft_of_a_killed_process_is_removed(tmp_path: Path) -> None:
    """The next process that writes there removes it, but nothing that only looks like a draft."""
    mine = {".cache", ".virtual-lab-draft-", ".virtual-lab-draft-of-my-thesis", ".second.ab12cd34"}
    for name in mine:
        (tmp_path / name).mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / ".virtual-lab-draft-0123456789abcdef").write_text("a file")
    (tmp_path / ".virtual-lab-draft-fedcba9876543210").symlink_to(tmp_path / "elsewhere")
    before = hidden(tmp_path)
    with half_way(tmp_path / "first") as process:
        (left,) = hidden(tmp_path) - before
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert (tmp_path / left / "half.txt").exists()
    write(tmp_path / "second")
    assert hidden(tmp_path) == before
    assert not (tmp_path / "first").exists()
    assert (tmp_path / "elsewhere").is_dir()
    assert [path.name for path in (tmp_path / "second").iterdir()] == ["whole.txt"]


def test_the_draft_of_a_process_at_work_is_left_alone(tmp_path: Path) -> None:
    with half_way(tmp_path / "first"):
        (draft,) = hidden(tmp_path)
        write(tmp_path / "second")
        assert hidden(tmp_path) == {draft}
        assert (tmp_path / draft / "half.txt").read_text() == "half of a certificate"


def test_a_folder_may_be_written_within_a_draft(tmp_path: Path) -> None:
    """The outer draft, as that of a control bat, is not mistaken for an abandoned one."""
    with new_folder(tmp_path / "outer") as draft:
        write(draft / "inner")
        assert draft.is_dir()
    paths = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")}
    assert paths == {"outer", "outer/inner", "outer/inner/whole.txt"}


@pytest.mark.parametrize("new", [new_folder, new_files])
def test_an_error_leaves_no_files(
    new: Callable[[Path], AbstractContextManager[Path]], tmp_path: Path
) -> None:
    def fail(draft: Path) -> None:
        (draft / "half.txt").write_text("half")
        raise ZeroDivisionError

    (tmp_path / "mine").mkdir()
    with pytest.raises(ZeroDivisionError), new(tmp_path / "mine") as draft:
        fail(draft)
    assert [path for path in tmp_path.rglob("*") if path.name != "mine"] == []


@pytest.mark.parametrize("new", [new_folder, new_files])
def test_a_mistyped_path_makes_no_folders(
    new: Callable[[Path], AbstractContextManager[Path]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The folder ``out`` of the current folder is ours, and made when it is needed."""
    with pytest.raises(InputError, match="there is no folder"), new(tmp_path / "wrnog" / "mine"):
        pass
    assert list(tmp_path.iterdir()) == []
    monkeypatch.chdir(tmp_path)
    with new_folder(Path("out") / "mine") as draft:
        (draft / "file.txt").write_text("result")
    assert (tmp_path / "out" / "mine" / "file.txt").exists()


def test_files_appear_together_and_replace_none(tmp_path: Path) -> None:
    with new_files(tmp_path) as draft:
        (draft / "a.toml").write_text("a")
        (draft / "a.png").write_text("picture")
        assert not (tmp_path / "a.toml").exists()
    assert {path.name for path in tmp_path.iterdir()} == {"a.toml", "a.png"}
    why = r"a\.toml: file; exists already; name another file"
    with pytest.raises(InputError, match=why), new_files(tmp_path) as draft:
        (draft / "a.toml").write_text("another")
    assert (tmp_path / "a.toml").read_text() == "a"
    with new_files(tmp_path, overwrite=True) as draft:
        (draft / "a.toml").write_text("another")
    assert (tmp_path / "a.toml").read_text() == "another"
    assert hidden(tmp_path) == set()


def test_no_file_is_moved_if_one_exists(tmp_path: Path) -> None:
    """Each of eight files is the existing one in turn, because the order of a folder is unknown."""
    names = [f"{number}.csv" for number in range(8)]

    def fill(draft: Path) -> None:
        for name in names:
            (draft / name).write_text("new")

    for name in names:
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("earlier")
        with pytest.raises(InputError, match="exists already"), new_files(folder) as draft:
            fill(draft)
        assert [file.name for file in folder.iterdir()] == [name]
        assert (folder / name).read_text() == "earlier"


def test_a_result_folder_is_overwritten_as_a_whole(tmp_path: Path) -> None:
    """After an error the earlier result is unchanged; a folder without settings.toml stays."""
    target = tmp_path / "result"
    with new_folder(target, "# first") as draft:
        (draft / "old.csv").write_text("1")
    with pytest.raises(ZeroDivisionError), new_folder(target, "# second", overwrite=True) as draft:
        raise ZeroDivisionError
    assert {path.name for path in target.iterdir()} == {"old.csv", "settings.toml"}
    with new_folder(target, "# second", overwrite=True) as draft:
        write(draft / "inner")
    assert {path.name for path in target.iterdir()} == {"inner", "settings.toml"}
    assert (target / "settings.toml").read_text() == "# second"
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years")
    for other in (mine, tmp_path):
        why = r"is not a result folder \(it has no settings.toml\), so it is not overwritten"
        with pytest.raises(InputError, match=why), new_folder(other, "# third", overwrite=True):
            pass
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(InputError), new_folder(tmp_path / "link", "# third", overwrite=True):
        pass
    assert (mine / "thesis.txt").read_text() == "years"
    assert {path.name for path in tmp_path.iterdir()} == {"result", "mine", "link"}


def test_an_earlier_result_is_back_if_the_new_one_cannot_take_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "result"
    with new_folder(target, "# first"):
        pass
    rename = Path.rename

    def refuse(path: Path, to: Path) -> Path:
        if to == target and (path / "new.csv").exists():
            raise PermissionError(13, "Permission denied")
        return rename(path, to)

    monkeypatch.setattr(Path, "rename", refuse)
    why = "cannot be written"
    with pytest.raises(InputError, match=why), new_folder(target, "#", overwrite=True) as draft:
        (draft / "new.csv").write_text("1")
    assert (target / "settings.toml").read_text() == "# first"
    assert hidden(tmp_path) == set()


COMPILING = """
import sys, time
from virtual_lab.files.caches import one_process_at_a_time

def compiled(function):
    with open(sys.argv[1], "a") as log:
        for word in ("begins", "ends"):
            print(word, file=log, flush=True)
            time.sleep(0.3)
    return function

one_process_at_a_time(compiled)(lambda: None)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files are not locked")
@pytest.mark.parametrize("cache", [None, "cache"])
def test_two_processes_never_compile_one_function_at_the_same_time(
    cache: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless each has its own folder of compiled code: the third does not wait for a lock."""
    code, log = tmp_path / "code.py", tmp_path / "log"
    code.write_text(COMPILING)
    code.chmod(0o444)
    monkeypatch.delenv(CACHE, raising=False)
    if cache:
        monkeypatch.setenv(CACHE, str(tmp_path / cache))
    command = [sys.executable, str(code), str(log)]
    both = [subprocess.Popen(command) for _ in range(2)]
    assert [each.wait() for each in both] == [0, 0]
    assert log.read_text().split() == ["begins", "ends"] * 2
    elsewhere = os.environ | {CACHE: str(tmp_path / "elsewhere")}

    def while_it_compiles(_: object) -> None:
        subprocess.run(command, env=elsewhere, timeout=60, check=True)

    one_process_at_a_time(while_it_compiles)(FunctionType(compile("", code, "exec"), {}))


def test_every_generalised_function_is_compiled_by_one_process_at_a_time() -> None:
    for file in (Path(__file__).parents[1] / "virtual_lab").rglob("*.py"):
        text = file.read_text("utf-8")
        alone = text.count("@one_process_at_a_time(\n    guvectorize(")
        assert text.count("guvectorize(") + text.count("vectorize(") == 2 * alone, file


def test_the_kernels_that_are_compiled_before_the_tests_are_kernels() -> None:
    """If a module without kernels is counted, all kernels are compiled again before each run."""
    texts = {file.stem: file.read_text("utf-8") for file in kernels()}
    assert {"modal_kernel", "budget_kernel", "kinematics", "wall_kernel"} <= texts.keys()
    assert all(re.search(r"njit\(|vectorize\(", text) for text in texts.values())


def test_a_table_is_written_as_pandas_writes_it() -> None:
    """All digits, empty cells for missing values, and quotes around commas and line ends."""
    numbers = np.random.default_rng(3).normal(size=200) * 10.0 ** np.arange(-100, 100)
    table = pd.DataFrame(
        {
            "float": np.where(numbers > 0, numbers, np.nan),
            "count": np.arange(200),
            "hit": numbers > 0,
            "words": ["a, b", 'say "so"', "two\nlines", "", "plain"] * 40,
            "some": [None, "x", np.nan, 2.5, 3] * 40,
        }
    )
    assert csv_text(table) == table.to_csv(index=False, lineterminator="\n")
    assert csv_text({"one": np.array([np.nan])}) == 'one\n""\n'  # no empty line


def test_a_row_longer_than_the_header_is_named() -> None:
    why = r"x\.csv: line 3 = '3 cells'; the header has 2 \(decimal commas\?\)"
    with pytest.raises(InputError, match=why):
        parse_table(b"a,b\n1,2\n3,4,5\n6,7\n", "x.csv")


def test_a_cell_that_is_no_number_is_named_with_its_row() -> None:
    table = parse_table(b"a,b\n1,2\n3,n.a.\n6,7\n", "x.csv")
    with pytest.raises(InputError, match=r"b = 'n\.a\.'; must be numbers, .*; see row 2"):
        require_numbers(table, "x.csv")
