"""The program that makes a certificate: its version, and the commit of a clone of this project."""

from __future__ import annotations

import hashlib
import os
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from virtual_lab.certificate.document import CommitStated
from virtual_lab.errors import DISTRIBUTION, VERSION

LIBRARIES = ("numpy", "scipy", "pandas", "numba")
SOURCES = ("virtual_lab/", "rigs/", "data/")  # folders of the program in a clone
REGULAR = 0o100000  # mode of a regular file in the index, without its permissions


def versions() -> dict[str, str]:
    """Return the versions of this program and of its numerical libraries, keyed by name."""
    return {"virtual-lab": VERSION} | {name: _installed(name) for name in LIBRARIES}


def typst() -> str | None:
    """Return the version of Typst, which makes PDFs, or None if it is not installed."""
    with suppress(PackageNotFoundError):
        return _installed("typst")
    return None


_installed = cache(version)  # cached, because it searches every folder of the path


@cache
def commit() -> CommitStated | None:
    """Return the commit of the Git clone from which this program runs.

    The result is None if the program was installed and does not run from a clone.
    """
    return commit_of(Path(__file__).resolve().parents[2])


def commit_of(root: Path) -> CommitStated | None:
    """Return the Git commit of a clone of this project in the folder `root`.

    The result is None if `root` does not contain this project's pyproject.toml. A repository of
    another project therefore gives None, even if the program is installed in a virtual environment
    inside it. The result is also None if there is no commit, and for a repository in an unknown
    format, such as SHA-256. Git is not called.

    The field `changes` of the result is a digest of the program files that differ from git's index.
    It is empty if no file differs. Staged changes (``git add``) and untracked files do not affect
    it.
    """
    try:
        project = (root / "pyproject.toml").read_text(encoding="utf-8")
        if not re.search(rf'^name = "{DISTRIBUTION}"$', project, re.MULTILINE):
            return None
        git = root / ".git"
        if git.is_file():  # a worktree has a file with the path of its git folder
            git = root / git.read_text(encoding="utf-8").strip().removeprefix("gitdir: ")
        identity = _commit_at(git, "HEAD")
        if identity is None or not re.fullmatch("[0-9a-f]{40}", identity):  # no commit, or SHA-256
            return None
        return CommitStated(id=identity, changes=_changes(root, git / "index"))
    except (OSError, ValueError, struct.error):  # no repository, or one in an unknown format
        return None


def _commit_at(git: Path, reference: str) -> str | None:
    """Return the commit of a reference, from its file or from the list of packed references.

    The references of branches are in the folder that all worktrees share.
    """
    common = git / "commondir"
    shared = git / common.read_text(encoding="utf-8").strip() if common.is_file() else git
    for folder in (git, shared):
        if (folder / reference).is_file():
            text = (folder / reference).read_text(encoding="utf-8").strip()
            if text.startswith("ref: "):
                return _commit_at(git, text.removeprefix("ref: "))
            return text
    if (packed := shared / "packed-refs").is_file():
        for line in packed.read_text(encoding="utf-8").splitlines():
            if line.endswith(f" {reference}"):
                return line.split()[0]
    return None


def _changes(root: Path, index: Path) -> str:
    """Return a digest of the program's files that differ from the index; "" without any."""
    written = index.stat().st_mtime_ns
    changed = []
    for entry in _entries(index.read_bytes()):
        if entry.mode & 0o170000 != REGULAR or not entry.name.startswith(SOURCES):
            continue
        try:
            here = os.stat(f"{root}/{entry.name}")  # faster than Path.stat for some 500 files
            if (here.st_mtime_ns, here.st_size) == (entry.time, entry.size) and (
                here.st_mtime_ns < written
            ):
                continue  # unchanged since the index was written, as git concludes
            content = (root / entry.name).read_bytes()
        except OSError:
            changed.append(f"{entry.name} missing")
            continue
        blob = b"blob %d\0%b" % (len(content), content)
        if (digest := hashlib.sha1(blob).digest()) != entry.blob:
            changed.append(f"{entry.name} {digest.hex()}")
    return hashlib.sha256("\n".join(changed).encode()).hexdigest()[:12] if changed else ""


class _Entry(NamedTuple):
    """A file in git's index: time of its last change [ns], mode, size [B] and content's SHA-1."""

    name: str
    time: int
    mode: int
    size: int
    blob: bytes


def _entries(data: bytes) -> Iterator[_Entry]:
    """Yield the files in an index of git (versions 2 to 4, SHA-1)."""
    _, form, many = struct.unpack_from(">4sLL", data)
    place, name = 12, b""
    for _ in range(many):
        seconds, ns, mode, size = struct.unpack_from(">8xLL8xL8xL", data, place)
        blob, flags = struct.unpack_from(">20sH", data, place + 40)
        start = place + (64 if flags & 0x4000 else 62)
        strip = 0
        if form == 4:  # the name extends the last entry's name without `strip` bytes
            start, strip = _length(data, start)
        end = data.index(b"\0", start)
        name = (name[: len(name) - strip] if form == 4 else b"") + data[start:end]
        place = end + 1 if form == 4 else place + (end - place + 8) // 8 * 8
        yield _Entry(name.decode(errors="replace"), seconds * 10**9 + ns, mode, size, blob)


def _length(data: bytes, place: int) -> tuple[int, int]:
    """Return the index of the byte after a number of variable length, and the number."""
    number = data[place] & 0x7F
    while data[place] & 0x80:
        place += 1
        number = ((number + 1) << 7) | (data[place] & 0x7F)
    return place + 1, number
