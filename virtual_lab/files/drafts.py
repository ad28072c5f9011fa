"""Drafts: what is written takes its place whole or not at all, however the program ends.

A draft is a hidden folder beside that place. Its maker holds a lock on it which the system takes
back with the process, so a draft that nobody holds was left by a process that was killed: the
next one that writes to the same folder removes it.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX, RANDOM_BYTES = ".virtual-lab-draft-", 8
own: set[Path] = set()  # drafts of this process, for who must end it at once


@contextmanager
def draft_in(folder: Path) -> Iterator[Path]:
    """Yield a new draft in `folder`, which is made where missing; what is not moved out goes.

    Raises `OSError` where `folder` cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _sweep(folder)
    draft = folder / f"{PREFIX}{os.urandom(RANDOM_BYTES).hex()}"
    young = draft.with_suffix(".new")  # not a draft by its name, until it is locked
    own.update((young, draft))
    young.mkdir()
    lock = _lock(young)
    try:
        yield young.rename(draft)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        own.difference_update((young, draft))
        if lock is not None:
            os.close(lock)


def remove_drafts() -> None:
    """Remove the drafts of this process, which is about to end."""
    for draft in tuple(own):
        shutil.rmtree(draft, ignore_errors=True)


def _sweep(folder: Path) -> None:
    """Remove the drafts in `folder` whose makers are no more."""
    for draft in folder.glob(PREFIX + "[0-9a-f]" * 2 * RANDOM_BYTES):
        lock = _lock(draft)
        if lock is not None:
            shutil.rmtree(draft, ignore_errors=True)
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Return a lock on a folder, None where another has it or the system has none to give."""
    if sys.platform == "win32":
        return None
    import fcntl

    with suppress(OSError):
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            raise
        return lock
    return None
