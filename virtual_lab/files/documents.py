"""Reading of documents, with errors that name the file, and writing of complete folders."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import stat
import tomllib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from virtual_lab.errors import InputError
from virtual_lab.files.drafts import draft_in
from virtual_lab.parameters import OUT, SETTINGS

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

DEEPEST = 32  # largest nesting depth of a document; the files of this project have six levels
# pattern of a dotted key that is nested too deeply
DOTTED = re.compile(rf"(?<![\w\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){{{DEEPEST}}}")
COMMA = re.compile(r"= *-?\d+,\d")  # a number with a decimal comma
NESTED = f"is nested deeper than {DEEPEST} levels"
EMPTY_CELL = re.compile(rb"(?<=[,\n])(?=[,\r\n])")
LITTER = ("._*", ".DS_Store", "Thumbs.db", "desktop.ini")  # files that a system adds to a folder
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


def read_bytes(path: Path, *, most: float = 2e9, last: int | None = None) -> bytes:
    """Return the content of a file, or only its `last` bytes if stated.

    If the file has fewer than `last` bytes, all of it is returned. Raises `InputError` for a file
    that is missing, unreadable, not a regular file, or larger than `most` bytes in total.
    """
    try:
        status = path.stat()
        # a device or a pipe may never end
        if stat.S_ISREG(status.st_mode) and status.st_size <= most:
            with path.open("rb") as file:
                file.seek(0 if last is None else max(status.st_size - last, 0))
                return file.read()
    except OSError as fault:
        raise InputError(str(path), "file", None, f"cannot be read ({fault.strerror})") from fault
    except ValueError as fault:  # impossible file name
        raise InputError(str(path), "file", None, f"cannot be read ({fault})") from fault
    allowed = f"cannot be read (it is not a file, or has more than {most / 1e6:g} MB)"
    raise InputError(str(path), "file", None, allowed)


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file, without its byte-order mark.

    Raises `InputError` for a file that is not UTF-8 text, is unreadable, or is larger than 20 MB.
    """
    try:
        # our largest file has 0.1 MB
        return read_bytes(path, most=20e6).decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(str(path), "file", None, f"is not UTF-8 text ({fault.reason})") from fault


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises `InputError` if the file cannot be read, is larger than 20 MB, does not contain exactly
    one object, or is nested more than 32 levels deep. Also raises it for a key that occurs twice,
    and for NaN, Infinity or a decimal number too large for a float, such as 1e999.
    """
    return parse_json(read_text(path), str(path))


def parse_json(text: str, where: str) -> dict[str, Any]:
    """Return the JSON object in `text`, as `read_json` does; `where` names the file in errors."""
    try:
        document = json.loads(
            text, object_pairs_hook=_once, parse_constant=_no_number, parse_float=_finite
        )
    except ValueError as fault:
        raise InputError(where, "JSON", None, f"cannot be parsed: {fault}") from fault
    except RecursionError as fault:
        raise InputError(where, "JSON", None, NESTED) from fault
    if not isinstance(document, dict):
        raise InputError(where, "JSON", type(document).__name__, "expected an object")
    _require_shallow(document, where, "JSON")
    return document


def read_toml(path: Path) -> dict[str, Any]:
    """Return the TOML document in a file.

    Raises `InputError` if the file cannot be read, is larger than 20 MB, is not UTF-8 or TOML, or
    is nested more than 32 levels deep.
    """
    return parse_toml(read_text(path), str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the TOML document in `text`, as `read_toml` does; `where` names the file in errors."""
    if DOTTED.search(text):  # the parser would take hours
        raise InputError(where, "TOML", None, NESTED)
    try:
        document = tomllib.loads(text)
    except ValueError as fault:  # syntax error, or an integer with thousands of digits
        hint = "; a decimal point is needed, not a comma" if COMMA.search(text) else ""
        raise InputError(where, "TOML", None, f"cannot be parsed: {fault}{hint}") from fault
    except RecursionError as fault:
        raise InputError(where, "TOML", None, NESTED) from fault
    _require_shallow(document, where, "TOML")
    return document


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object from its pairs, and reject a key that appears twice."""
    document = dict(pairs)
    if len(document) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in document if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r} occurs twice")
    return document


def _no_number(text: str) -> None:
    raise ValueError(f"{text} is not a JSON number")


def _finite(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise ValueError(f"{text} is not finite")
    return value


def _require_shallow(document: dict[str, Any], where: str, kind: str) -> None:
    """Refuse a document so deeply nested that recursive functions would overflow the stack."""
    level: list[Any] = [document]
    for _ in range(DEEPEST):
        parts = (part.values() if isinstance(part, dict) else part for part in level)
        level = [each for part in parts for each in part if isinstance(each, dict | list)]
        if not level:
            return
    raise InputError(where, kind, None, NESTED)


def inside(folder: Path, name: str, where: str, key: str) -> Path:
    """Return the path of the file `name` in a folder. The file need not exist.

    Raises `InputError` if the path leads out of the folder by ``..`` or by a link, or if it cannot
    be resolved. `where` is the document that states `name`, and `key` is the key of the entry with
    `name`. The error message states `where` and `key`.
    """
    path = folder / name
    try:
        if path.resolve().is_relative_to(folder.resolve()):
            return path
    except (OSError, ValueError, RuntimeError) as fault:  # circular links, a NUL character
        raise InputError(where, key, name, f"cannot be read ({fault})") from fault
    raise InputError(where, key, name, f"is outside {folder}; allowed: files in this folder")


KINDS = (
    (stat.S_ISREG, "file"),
    (stat.S_ISDIR, "folder"),
    (stat.S_ISLNK, "link"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
)


def is_litter(name: str) -> bool:
    """Return whether `name` is that of a file that an operating system adds to folders."""
    return any(fnmatchcase(name, pattern) for pattern in LITTER)


def litter(folder: Path) -> list[str]:
    """Return the paths of the litter in a folder and its subfolders (see `is_litter`), sorted."""
    return [
        path.relative_to(folder).as_posix()
        for path in sorted(folder.rglob("*"))
        if is_litter(path.name) and stat.S_ISREG(path.lstat().st_mode)
    ]


def contents(folder: Path) -> dict[str, str]:
    """Return the kind of every file and empty folder in a folder and its subfolders, keyed by path.

    Litter is left out (see `is_litter`). Paths are relative to `folder`, and sorted. A kind is
    ``file``, ``folder``, ``link``, ``pipe``, ``socket`` or ``device``. A link is listed but not
    followed. A folder is listed only if it is empty. The result is empty if `folder` is missing.
    """
    kinds = {}
    for root, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(root, name)
            mode = path.lstat().st_mode
            if stat.S_ISDIR(mode) and any(path.iterdir()):
                continue
            kind = next((word for test, word in KINDS if test(mode)), "device")
            if kind == "file" and is_litter(name):
                continue
            kinds[path.relative_to(folder).as_posix()] = kind
    return dict(sorted(kinds.items()))


def read_table(path: Path, *, delimiter: str = ",", decimal: str = ".") -> pd.DataFrame:
    """Return the table in a CSV file, one column per name in the header.

    `delimiter` is a comma, a semicolon or a tab, and `decimal` is the decimal mark. An empty cell
    is a missing value. Raises `InputError` if the file cannot be read, is not UTF-8 text, has no
    rows, uses another delimiter, has a column name twice, or has a row that is longer or shorter
    than the header. Shorter rows are not detected in a file that contains quotation marks.
    """
    return parse_table(read_bytes(path), str(path), delimiter=delimiter, decimal=decimal)


def parse_table(
    data: bytes, where: str, *, delimiter: str = ",", decimal: str = "."
) -> pd.DataFrame:
    """Return the table in the bytes of a CSV file, as `read_table` does; `where` names the file."""
    import pandas as pd

    head = _head(data, where, delimiter)
    _require_whole_rows(data, where, delimiter, len(head))
    with warnings.catch_warnings():
        # pandas would drop or shift the cells of a row longer than the header
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
        except (ValueError, pd.errors.ParserError, pd.errors.ParserWarning) as fault:
            why = " ".join(str(fault).split())
            raise InputError(where, "CSV", None, f"cannot be read: {why}") from fault
    if table.empty:
        raise InputError(where, "rows", 0, "the table has a header but no rows")
    return table


def parse_numbers(data: bytes, where: str) -> dict[str, NDArray[Any]]:
    """Return the columns of a CSV file of numbers, keyed by name. An empty cell is NaN.

    `data` is the content of the file, and `where` names the file in errors. A column that contains
    other text is returned as an array of Python objects. Raises `InputError` in the same cases as
    `read_table`.
    """
    import numpy as np

    head = _head(data, where, ",")
    body = EMPTY_CELL.sub(b"nan", data.partition(b"\n")[2])
    with suppress(ValueError):  # strings, or rows of different lengths
        if body.strip():
            values = np.loadtxt(io.BytesIO(body), delimiter=",", comments=None, ndmin=2)
            return dict(zip(head, values.T, strict=True))
    table = parse_table(data, where)
    return {str(name): values.to_numpy() for name, values in table.items()}


def _require_whole_rows(data: bytes, where: str, delimiter: str, cells: int) -> None:
    """Refuse a row shorter or longer than the header, which pandas would fill or cut."""
    if b'"' in data:
        return  # quoted cells may contain the delimiter
    for number, line in enumerate(data.splitlines(), 1):
        count = line.count(delimiter.encode()) + 1
        if count != cells and line.strip():
            why = "is the record cut short?" if count < cells else "decimal commas?"
            allowed = f"the header has {cells} ({why})"
            raise InputError(where, f"line {number}", f"{count} cells", allowed)


def _head(data: bytes, where: str, delimiter: str) -> list[str]:
    """Return the column names in the first line of a CSV file. Refuse a name that appears twice."""
    if not data.strip():
        raise InputError(where, "CSV", None, "cannot be read: the file is empty")
    line = data.replace(b"\r", b"\n").split(b"\n", 1)[0]
    if b"\0" in data:
        raise InputError(where, "CSV", None, "cannot be read: it is not text (a spreadsheet?)")
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        raise InputError(where, "CSV", None, "cannot be read: it is not UTF-8 text") from fault
    try:
        (names,) = csv.reader([text], delimiter=delimiter, skipinitialspace=True)
    except csv.Error:  # cell of excessive length
        names = []
    if not names:
        raise InputError(where, "CSV", None, "cannot be read: no header in its first line")
    head = [name.strip() for name in names]
    others = [word for mark, word in SEPARATORS.items() if mark != delimiter and mark in text]
    if len(head) < 2 and others:
        allowed = f"expected {SEPARATORS[delimiter]}s; a form of records can name another delimiter"
        raise InputError(where, "delimiter", others[0], allowed)
    for name in head:
        if head.count(name) > 1:
            raise InputError(where, "columns", name, "occurs twice in the header")
    return head


def check_new_folder(target: Path, *, overwrite: bool = False) -> None:
    """Raise `InputError` unless `target` can become a new folder.

    It must be writable. Either it does not exist yet, or it is an empty folder. With `overwrite` it
    may also be a result folder, which contains a ``settings.toml``. The current folder is never
    allowed.
    """
    try:
        linked = stat.S_ISLNK(target.lstat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        linked = False
    except (OSError, ValueError) as fault:  # name too long, circular links, a NUL character
        allowed = f"cannot be written ({getattr(fault, 'strerror', fault)})"
        raise InputError("", "output folder", str(target), allowed) from fault
    if linked and not target.exists():
        raise InputError("", "output folder", str(target), "is a link to a missing file")
    if target.absolute() == Path.cwd():
        raise InputError(
            "", "output folder", str(target), "is the current folder; name a new folder in it"
        )
    if target.exists() and not target.is_dir():
        raise InputError("", "output folder", str(target), "is a file; name another folder")
    if target.is_dir() and any(target.iterdir()) and not (overwrite and _is_result(target)):
        allowed = f"is not a result folder (it has no {SETTINGS}), so it is not overwritten"
        if not overwrite:
            allowed = "is not empty; name another folder, or empty this one"
        raise InputError("", "output folder", str(target), allowed)
    check_writable(target, "output folder")


def _is_result(folder: Path) -> bool:
    """Return whether a folder holds a result of this program and is not a link."""
    return not folder.is_symlink() and (folder / SETTINGS).is_file()


def check_writable(target: Path, key: str) -> None:
    """Raise `InputError` unless a file or folder can be created at `target`.

    The folder around it must exist, except ``out`` in the current folder, so that a mistyped path
    makes no folders. The check creates a temporary folder and removes it. A system may report a
    folder such as ``/proc`` as writable although no file can be created in it. `key` is the name of
    the target in the error message.
    """
    parent = target.absolute().parent
    if not (parent.is_dir() or target.parent == Path(OUT)):
        allowed = f"cannot be written (there is no folder {target.parent}; make it first)"
        raise InputError("", key, str(target), allowed)
    existing = next(each for each in (target, parent, Path()) if each.exists())
    try:
        with draft_in(existing):
            pass
    except OSError as fault:
        allowed = f"{existing} cannot be written to ({fault.strerror})"
        raise InputError("", key, str(target), allowed) from fault


def first_free(target: Path) -> Path:
    """Return the first of `target`, target-2, target-3 … that is missing or an empty folder.

    The number of a file is before its suffix.
    """
    candidate, number = target, 1
    while candidate.exists() and (not candidate.is_dir() or any(candidate.iterdir())):
        number += 1
        suffix = target.suffix if target.is_file() else ""
        candidate = target.with_name(f"{target.name.removesuffix(suffix)}-{number}{suffix}")
    return candidate


@contextmanager
def new_folder(target: Path, settings: str = "", *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary folder to fill, which is renamed to `target` if no error occurs.

    `settings` is the text of the file ``settings.toml``, which holds the arguments of the call that
    made the result. If it is empty, no such file is written. With `overwrite`, the new folder
    replaces an earlier result folder as a whole. After an error no new file is left, and the
    earlier folder is unchanged.

    Raises
    ------
    InputError
        `target` is the current folder, is a file, or cannot be written. `target` is a folder with
        files, and either `overwrite` is False or the folder has no ``settings.toml``. An `OSError`
        occurs within the context.
    """
    check_new_folder(target, overwrite=overwrite)
    try:
        with draft_in(target.parent) as draft:
            if settings:
                (draft / SETTINGS).write_text(settings, encoding="utf-8")
            yield draft
            if overwrite and target.is_dir():
                _exchange(draft, target)
            else:
                if target.is_dir():
                    target.rmdir()
                draft.rename(target)
    except OSError as fault:
        raise InputError(
            "", "output folder", str(target), f"cannot be written ({fault.strerror})"
        ) from fault


def _exchange(draft: Path, target: Path) -> None:
    """Replace a folder by a draft. The folder is deleted, or restored after an error."""
    with draft_in(target.parent) as aside:
        earlier = target.rename(aside / target.name)
        try:
            draft.rename(target)
        except OSError:
            earlier.rename(target)
            raise


@contextmanager
def new_files(folder: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary folder to fill. Its files are moved into `folder` if no error occurs.

    With `overwrite`, the files replace files of the same name in `folder`. Otherwise, if `folder`
    already contains one of them, `InputError` is raised and no file is moved. `InputError` is also
    raised if `folder` cannot be written, or for an `OSError` within the context.
    """
    check_writable(folder / "file", "out")
    try:
        with draft_in(folder) as draft:
            yield draft
            targets = {file: folder / file.name for file in draft.iterdir()}
            for target in targets.values():
                if target.exists() and not overwrite:
                    raise InputError(str(target), "file", None, "exists already; name another file")
            for file, target in targets.items():
                file.replace(target)
    except OSError as fault:
        raise InputError("", "out", str(folder), f"cannot be written ({fault.strerror})") from fault


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """Yield a temporary file to write, which replaces `path` if no error occurs.

    The folder of `path` is created if it is missing. All content is written to disk before the file
    is renamed, so `path` never holds part of the content. Raises `OSError` if the folder cannot be
    written.
    """
    with draft_in(path.parent) as draft:
        with open(draft / path.name, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(draft / path.name, path)
