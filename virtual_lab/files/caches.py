"""The folder in which numba keeps compiled code, for an account without a folder of its own."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from tempfile import gettempdir, mkdtemp

CACHE = "NUMBA_CACHE_DIR"


def provide_cache(package: Path) -> None:
    """Set numba's cache to a temporary folder if it can write none of its usual ones.

    These are a folder that the user named, ``__pycache__`` beside the code of `package`, and the
    cache of the user's home. A line on stderr names a temporary folder when it is made.
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
        except FileExistsError:  # of somebody else, whose code must not run here
            folder = Path(mkdtemp(prefix="virtual-lab-"))
        words = f"no writable home: compiled code is kept in {folder} ({CACHE} names another)"
        print(f"virtual-lab: {words}", file=sys.stderr)
    os.environ[CACHE] = str(folder)


def _writable(folder: Path) -> bool:
    """Whether a folder can be written to, or be made."""
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    return os.path.isdir(there) and os.access(there, os.W_OK | os.X_OK)


def _private(folder: Path) -> bool:
    """Whether a folder, not a link to one, belongs to this account and nobody else writes there."""
    status = folder.lstat()
    mine = stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid()
    return mine and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
