"""Numba's cache of compiled code: its folder, and a lock so that one process writes at a time."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

Decorator = Callable[[Callable[..., None]], Any]

CACHE = "NUMBA_CACHE_DIR"


def provide_cache(package: Path) -> None:
    """Set numba's cache to a temporary folder if none of the usual folders is writable.

    The usual folders are the folder named by the variable ``NUMBA_CACHE_DIR``, ``__pycache__`` in
    the folder `package`, and the cache in the user's home. When the temporary folder is created, a
    line on stderr names it. On Windows nothing is done.
    """
    named, home = os.environ.get(CACHE), Path("~/.cache").expanduser()
    usual = [package / "__pycache__", Path(os.environ.get("XDG_CACHE_HOME") or home, "numba")]
    usual = [*([Path(named)] if named else []), *(path for path in usual if path.is_absolute())]
    if sys.platform == "win32" or any(map(_writable, usual)):
        return
    folder = Path(gettempdir()) / f"virtual-lab-{os.geteuid()}"
    if not (os.path.lexists(folder) and _private(folder)):
        try:
            folder.mkdir(mode=0o700)
        except FileExistsError:  # another user's folder, whose code must not run here
            folder = Path(mkdtemp(prefix="virtual-lab-"))
        words = f"no writable home folder: compiled code is in {folder} ({CACHE} sets another)"
        print(f"virtual-lab: {words}", file=sys.stderr)
    os.environ[CACHE] = str(folder)


def one_process_at_a_time(compiled: Decorator) -> Decorator:
    """Return a decorator that compiles like `compiled`, but in only one process at a time.

    Other processes with the same folder of compiled code wait for a lock. Numba stores a
    generalized ufunc (`guvectorize`) in two files, one for its loop and one for the wrapper that
    calls it. If two processes compile it at the same time, the files may come from different
    processes, and every later call ends in a segmentation fault. On Windows, and where a file
    system has no locks, no process waits.
    """

    def decorate(function: Callable[..., None]) -> Any:
        with _lock(Path(function.__code__.co_filename)):
            return compiled(function)

    return decorate


@contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Lock a source file, which may be read-only, or a file in the `CACHE` of compiled code."""
    mode = "rb"
    if folder := os.environ.get(CACHE):
        Path(folder).mkdir(parents=True, exist_ok=True)
        path, mode = Path(folder) / f"{path.stem}.lock", "ab"
    with path.open(mode) as file:
        with suppress(ImportError, OSError):
            from fcntl import LOCK_EX, flock

            flock(file, LOCK_EX)
        yield


def _writable(folder: Path) -> bool:
    """Return whether a folder can be written to, or can be created."""
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    return os.path.isdir(there) and os.access(there, os.W_OK | os.X_OK)


def _private(folder: Path) -> bool:
    """Return whether a folder is not a link and only this account, its owner, can write to it."""
    status = folder.lstat()
    mine = stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid()
    return mine and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
