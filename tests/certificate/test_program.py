"""The commit of a clone, read without git and compared with git."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from virtual_lab.certificate.program import commit_of

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
FILES = ("virtual_lab/one.py", "virtual_lab/deep/er/two.py", "rigs/a.py", "data/b.toml", "notes.md")


def git(folder: Path, *words: str) -> str:
    named = ("-c", "user.name=n", "-c", "user.email=n@example.org", "-c", "commit.gpgsign=false")
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    called = ["git", "-C", str(folder), *named, *words]
    return subprocess.run(called, check=True, capture_output=True, text=True, env=clean).stdout


def changes(folder: Path) -> str:
    found = commit_of(folder)
    assert found is not None
    assert found.id == git(folder, "rev-parse", "HEAD").strip()
    return found.changes


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("clones") / "project"
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"# {name}\n")
    (root / "pyproject.toml").write_text('[project]\nname = "virtual-bat-lab"\n')
    git(root, "init", "-q", "-b", "main")
    git(root, "add", "-A")
    git(root, "commit", "-q", "-m", "first")
    return root


@pytest.fixture
def clone(repository: Path, tmp_path: Path) -> Path:
    git(tmp_path, "clone", "-q", str(repository), "clone")
    return tmp_path / "clone"


def test_the_commit_agrees_with_git(clone: Path) -> None:
    """The commit is read from a branch file, from packed refs, and without a branch."""
    assert changes(clone) == ""
    git(clone, "checkout", "-q", "-b", "work/of-mine")
    git(clone, "commit", "-q", "--allow-empty", "-m", "second")
    assert changes(clone) == ""
    git(clone, "pack-refs", "--all")
    assert not (clone / ".git/refs/heads/work/of-mine").exists()
    assert changes(clone) == ""
    git(clone, "checkout", "-q", "--detach", "HEAD~1")
    assert changes(clone) == ""


def test_a_worktree_has_a_commit_and_changes_of_its_own(clone: Path) -> None:
    git(clone, "worktree", "add", "-q", "-b", "other", "../beside")
    beside = clone.parent / "beside"
    git(beside, "commit", "-q", "--allow-empty", "-m", "second")
    (beside / FILES[0]).write_text("changed")
    assert changes(beside) != ""
    assert changes(clone) == ""
    git(clone, "pack-refs", "--all")
    assert changes(beside) != ""


@pytest.mark.parametrize("version", ["2", "3", "4"])
def test_changed_files_are_those_that_git_lists(clone: Path, version: str) -> None:
    """Changed and deleted program files count; a new date alone does not."""
    git(clone, "update-index", "--index-version", version)
    (clone / "data/new.toml").write_text("")
    git(
        clone, "add", "--intent-to-add", "data/new.toml"
    )  # index entry of version 3, which is longer
    assert changes(clone) == ""
    for name in FILES:
        content = (clone / name).read_bytes()
        os.utime(clone / name, (1, 1))
        assert changes(clone) == ""
        (clone / name).write_bytes(content.upper())
        of_program = not name.endswith(".md")
        assert (changes(clone) != "") == of_program
        listed = git(clone, "diff", "--name-only").splitlines()
        assert name in listed
        (clone / name).unlink()
        assert (changes(clone) != "") == of_program
        (clone / name).write_bytes(content)
        assert changes(clone) == ""


def test_other_changes_have_another_digest(clone: Path) -> None:
    (clone / FILES[0]).write_text("one")
    one = changes(clone)
    (clone / FILES[0]).write_text("two")
    assert len({one, changes(clone), ""}) == 3


def test_a_repository_around_the_program_is_another_project(clone: Path, tmp_path: Path) -> None:
    """Cases: an installed program, a project of another name, a folder without git."""
    installed = clone / ".venv/lib/site-packages"
    installed.mkdir(parents=True)
    assert commit_of(installed) is None
    (installed / "pyproject.toml").write_text('[project]\nname = "virtual-bat-lab"\n')
    assert commit_of(installed) is None
    assert commit_of(tmp_path) is None
    (clone / "pyproject.toml").write_text('[project]\nname = "mine"\n')
    assert commit_of(clone) is None


def test_an_unreadable_commit_is_not_stated(clone: Path) -> None:
    (clone / ".git/index").write_bytes(b"DIRC")
    assert commit_of(clone) is None
    (clone / ".git/index").unlink()
    assert commit_of(clone) is None
