"""What is read and written on disk: documents with errors that name the file, whole folders."""

from __future__ import annotations

import csv
import io
import json
import os
import tomllib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EEXIST
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.drafts import draft_in
from virtual_lab.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "check_new_folder",
    "first_free",
    "new_files",
    "new_folder",
    "parse_table",
    "read_bytes",
    "read_json",
    "read_table",
    "read_text",
    "read_toml",
]

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


def read_bytes(path: Path) -> bytes:
    """Return the content of a file; `InputError` where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as fault:
        raise InputError(str(path), "file", None, f"cannot be read ({fault.strerror})") from fault


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file, with or without its mark; `InputError` where it is none."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(str(path), "file", None, f"is no UTF-8 text ({fault.reason})") from fault


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file; `InputError` where it holds none."""
    data = read_bytes(path)
    try:
        document = json.loads(data)
    except ValueError as fault:
        raise InputError(str(path), "JSON", None, f"cannot be parsed: {fault}") from fault
    if not isinstance(document, dict):
        raise InputError(str(path), "JSON", type(document).__name__, "expected an object")
    return document


def read_toml(path: Path) -> dict[str, Any]:
    """Return the TOML document in a file; `InputError` where it holds none."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as fault:
        raise InputError(str(path), "TOML", None, f"cannot be parsed: {fault}") from fault


def read_table(path: Path, *, delimiter: str = ",", decimal: str = ".") -> pd.DataFrame:
    """Return the table in a CSV file: a header, then rows as long as it.

    Raises `InputError` where the file is empty, no text, of another delimiter, or its rows are
    not as long as the header.
    """
    return parse_table(read_bytes(path), str(path), delimiter=delimiter, decimal=decimal)


def parse_table(
    data: bytes, where: str, *, delimiter: str = ",", decimal: str = "."
) -> pd.DataFrame:
    """Return the table that the bytes of a CSV file hold, as `read_table` does."""
    import pandas as pd

    head = _head(data, where, delimiter)
    with warnings.catch_warnings():
        # a row longer than the header: pandas would drop or shift its cells
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            table = pd.read_csv(
                io.BytesIO(data),
                header=None,
                skiprows=1,
                names=head,
                index_col=False,
                sep=delimiter,
                decimal=decimal,
                skipinitialspace=True,
                encoding="utf-8-sig",
            )
        except pd.errors.ParserWarning as fault:
            why = "rows are longer than the header (decimal commas?)"
            raise InputError(where, "CSV", None, f"cannot be read: {why}") from fault
        except (ValueError, pd.errors.ParserError) as fault:
            why = " ".join(str(fault).split())
            raise InputError(where, "CSV", None, f"cannot be read: {why}") from fault
    if table.empty:
        raise InputError(where, "rows", 0, "a header and nothing below it")
    _require_whole_rows(data, where, delimiter, len(head))
    return table


def _require_whole_rows(data: bytes, where: str, delimiter: str, cells: int) -> None:
    """Refuse a row shorter than the header, which pandas fills up: the file may be cut short."""
    if b'"' in data:
        return  # what parts cells may stand within them
    for number, line in enumerate(data.splitlines(), 1):
        found = line.count(delimiter.encode()) + 1
        if found < cells and line.strip():
            allowed = f"the header has {cells} (is the record cut short?)"
            raise InputError(where, f"line {number}", f"{found} cells", allowed)


def _head(data: bytes, where: str, delimiter: str) -> list[str]:
    """Return the names in the first line of a CSV file, each of them once."""
    if not data.strip():
        raise InputError(where, "CSV", None, "cannot be read: the file is empty")
    line = data.replace(b"\r", b"\n").split(b"\n", 1)[0]
    if b"\0" in data:
        raise InputError(where, "CSV", None, "cannot be read: it is no text (a spreadsheet?)")
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(where, "CSV", None, "cannot be read: it is no UTF-8 text") from fault
    try:
        (names,) = csv.reader([text], delimiter=delimiter, skipinitialspace=True)
    except csv.Error:  # a cell beyond any length
        names = []
    if not names:
        raise InputError(where, "CSV", None, "cannot be read: no header in its first line")
    head = [name.strip() for name in names]
    others = [word for mark, word in SEPARATORS.items() if mark != delimiter and mark in text]
    if len(head) < 2 and others:
        allowed = f"expected {SEPARATORS[delimiter]}s, or a form that names delimiter and decimal"
        raise InputError(where, "delimiter", others[0], allowed)
    for name in head:
        if head.count(name) > 1:
            raise InputError(where, "columns", name, "stands twice in the header")
    return head


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
        with draft_in(target.parent) as draft:
            yield draft
            if target.is_dir():
                target.rmdir()
            draft.rename(target)
    except OSError as fault:
        raise InputError(
            "", "output folder", str(target), f"cannot be written ({fault.strerror})"
        ) from fault


@contextmanager
def new_files(folder: Path) -> Iterator[Path]:
    """Yield a folder to fill; its files move into `folder` only if nothing went wrong.

    `InputError` where `folder` cannot be written, or holds one of them already.
    """
    try:
        with draft_in(folder) as draft:
            yield draft
            for file in draft.iterdir():
                if (folder / file.name).exists():
                    raise FileExistsError(EEXIST, f"{file.name} is there already")
                file.rename(folder / file.name)
    except OSError as fault:
        raise InputError("", "out", str(folder), f"cannot be written ({fault.strerror})") from fault
