"""An output folder appears whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from virtual_lab.errors import InputError

__all__ = ["check_new_folder", "first_free", "new_folder"]


def check_new_folder(target: Path) -> None:
    """Raise `InputError` unless `target` can become a new folder: absent or empty, writable."""
    if target.exists() and not target.is_dir():
        raise InputError("", "output folder", str(target), "is a file; name another folder")
    if target.is_dir() and any(target.iterdir()):
        raise InputError(
            "", "output folder", str(target), "is not empty; name another or empty it first"
        )
    existing = next(parent for parent in (target, *target.absolute().parents) if parent.exists())
    if not (existing.is_dir() and os.access(existing, os.W_OK)):
        raise InputError("", "output folder", str(target), f"{existing} cannot be written to")


def first_free(target: Path) -> Path:
    """Return `target`, or target-2, target-3 … : the first that is absent or empty."""
    candidate, number = target, 1
    while candidate.exists() and (not candidate.is_dir() or any(candidate.iterdir())):
        number += 1
        candidate = target.with_name(f"{target.name}-{number}")
    return candidate


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """Yield a folder to fill beside `target`; it becomes `target` only if nothing went wrong."""
    check_new_folder(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as fault:
        raise InputError(
            "", "output folder", str(target), f"cannot be written ({fault.strerror})"
        ) from fault
    try:
        yield draft
        draft.chmod(0o755)
        if target.is_dir():
            target.rmdir()
        draft.rename(target)
    except OSError as fault:
        shutil.rmtree(draft, ignore_errors=True)
        raise InputError(
            "", "output folder", str(target), f"cannot be written ({fault.strerror})"
        ) from fault
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
