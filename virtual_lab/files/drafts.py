"""Drafts: a result appears completely or not at all, however the program ends.

A draft is a hidden folder beside the final folder. The process that made it holds a lock, which the
system releases when the process ends. A draft without a lock was left by a killed process; the next
process that writes to the same folder removes it.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX, RANDOM_BYTES = ".virtual-lab-draft-", 8
open_drafts: set[Path] = set()  # drafts of this process, removed if it must end at once


@contextmanager
def draft_in(folder: Path) -> Iterator[Path]:
    """Yield a new temporary folder within `folder`, which is created in an existing folder.

    When the context ends, the temporary folder is deleted with all files that were not moved out of
    it. Temporary folders of processes that have ended are deleted at the start. Raises `OSError` if
    `folder` cannot be written.
    """
    folder.mkdir(exist_ok=True)
    _sweep(folder)
    draft = folder / f"{PREFIX}{os.urandom(RANDOM_BYTES).hex()}"
    young = draft.with_suffix(".new")  # name that `_sweep` ignores until the draft is locked
    open_drafts.update((young, draft))
    young.mkdir()
    lock = _lock(young)
    try:
        yield young.rename(draft)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
        open_drafts.difference_update((young, draft))
        if lock is not None:
            os.close(lock)


def remove_drafts() -> None:
    """Remove all temporary folders of this process. Errors are ignored.

    It is called before the process ends.
    """
    for draft in tuple(open_drafts):
        shutil.rmtree(draft, ignore_errors=True)


def _sweep(folder: Path) -> None:
    """Remove the drafts in `folder` whose processes have ended."""
    for draft in folder.glob(PREFIX + "[0-9a-f]" * 2 * RANDOM_BYTES):
        lock = _lock(draft)
        if lock is not None:
            shutil.rmtree(draft, ignore_errors=True)
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Return a lock on a folder; None if another process has it or the system has no locks."""
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
