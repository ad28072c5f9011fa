"""Findings about a result folder, and the comparison of its files with those made here."""

from __future__ import annotations

import csv
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import zip_longest
from math import isclose
from pathlib import Path
from typing import Any, Literal, NamedTuple

from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.output.tables import column

TOLERANCE = 1e-9  # largest relative difference of a number between processors
# The same for a line of a budget, which is a difference of two results (measured: 7e-8).
TOLERANCE_OF_BUDGET = 1e-6
NUMBER = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")  # number in a cell of a table
RowState = Literal["altered", "differs"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """A file, or a key in it, that differs from the rest of the folder or from this program."""

    file: str = column("file", form="")
    key: str = column("key", form="")
    stated: str = column("in the folder", form="")  # value found, or what is wrong
    expected: str = column("expected", form="")  # value by the rest of the folder or this program
    state: RowState = "altered"  # "differs" if another program, which may be right, made it


class Unchecked(NamedTuple):
    """A part of a folder that could not be checked, and why."""

    text: str


class Remark(NamedTuple):
    """A remark on a folder that does not affect its state."""

    text: str


FolderFinding = Mismatch | Unchecked | Remark


def within(prefix: str, findings: Iterable[FolderFinding]) -> Iterator[FolderFinding]:
    """Yield the findings with ``prefix/`` in front of their file names; remarks stay unchanged."""
    for each in findings:
        if isinstance(each, Mismatch):
            yield replace(each, file=f"{prefix}/{each.file}")
        elif isinstance(each, Unchecked):
            yield Unchecked(f"{prefix}/{each.text}")
        else:
            yield each


def at(document: Any, *keys: str) -> Any:
    """Return the value under nested keys of a JSON document.

    The result is None if a key is missing or a value on the path is not an object.
    """
    for key in keys:
        document = document.get(key) if isinstance(document, Mapping) else None
    return document


def same_text(path: Path) -> str:
    """Return the text of a file with Unix line ends; bytes that are not UTF-8 become U+FFFD.

    Raises `InputError` if the file cannot be read.
    """
    return read_bytes(path).replace(b"\r\n", b"\n").decode(errors="replace")


def compared_json(path: Path, here: Mapping[str, Any], text: str) -> Iterator[Mismatch]:
    """Compare the values in a JSON file with `here`, and yield one mismatch per different value.

    Numbers that differ only by rounding are equal. If all values agree, the text of the file is
    compared with `text`. In this case, the first different line is the only mismatch. Nothing is
    yielded if values and text agree. A file that cannot be read is one mismatch.

    Parameters
    ----------
    path
        The JSON file.
    here
        Expected values.
    text
        Text that this program writes for the expected values.
    """
    try:
        stated = read_json(path)
        layout = same_text(path)
    except InputError as fault:
        yield Mismatch(file=path.name, key=fault.key, stated=fault.allowed, expected="")
        return
    rows = list(differences(stated, here, path.name))
    yield from rows or compared_text(path.name, layout, text)


def compared_text(file: str, stated: str, here: str) -> Iterator[Mismatch]:
    """Yield a mismatch for the first line that differs between two texts; nothing if they agree.

    A missing line is a difference too. `file` is the file name that the mismatch states.
    """
    lines = zip_longest(stated.split("\n"), here.split("\n"))
    for number, (there, expected) in enumerate(lines, start=1):
        if there != expected:
            words = [cut_short((line or "").strip(" ")) for line in (there, expected)]
            if words[0] == words[1]:  # they differ in blanks only
                words = [repr(there), repr(expected)]
            yield Mismatch(file=file, key=f"line {number}", stated=words[0], expected=words[1])
            return


def compared_table(path: Path, here: str) -> Iterator[Mismatch]:
    """Yield one mismatch per cell that differs between a CSV file and the CSV text `here`.

    Cells that differ only by rounding are equal. If the numbers of rows or columns differ, or if
    the file cannot be read, this is the only mismatch.
    """
    try:
        stated, found = (list(csv.reader(text.split("\n"))) for text in (same_text(path), here))
    except InputError as fault:
        yield Mismatch(file=path.name, key=fault.key, stated=fault.allowed, expected="")
        return
    except csv.Error as fault:
        yield Mismatch(file=path.name, key="CSV", stated=f"cannot be read: {fault}", expected="")
        return
    if [len(row) for row in stated] != [len(row) for row in found]:
        shapes = (f"{len(rows) - 2} rows of {len(rows[0])} columns" for rows in (stated, found))
        there, expected = shapes
        yield Mismatch(file=path.name, key="", stated=there, expected=expected)
        return
    for number, (row, right) in enumerate(zip(stated, found, strict=True)):
        for cell, expected, name in zip(row, right, found[0], strict=False):
            if not _same_cell(cell, expected):
                key = f"row {number - 1}, {name}" if number else "columns"
                yield Mismatch(
                    file=path.name, key=key, stated=cut_short(cell), expected=cut_short(expected)
                )


def _same_cell(stated: str, expected: str) -> bool:
    if stated == expected:
        return True
    numbers = all(NUMBER.fullmatch(each) for each in (stated, expected))
    return numbers and _same(float(stated), float(expected))


def differences(stated: Any, expected: Any, file: str, key: str = "") -> Iterator[Mismatch]:
    """Yield one mismatch per key with different values in two JSON documents.

    Nothing is yielded if all agree. Numbers that differ only by rounding are equal. `stated` is the
    document in the file `file`. `expected` is the document that this program computes. Both may
    also be single values of a document. `key` is then their path in the document. Lists of
    different lengths are one mismatch.
    """
    if isinstance(stated, Mapping) and isinstance(expected, Mapping):
        for name in [*expected, *(name for name in stated if name not in expected)]:
            inner = f"{key}.{name}" if key else name
            if name not in stated or name not in expected:
                there, here = (
                    _value(each[name]) if name in each else "" for each in (stated, expected)
                )
                yield Mismatch(file=file, key=inner, stated=there, expected=here)
            else:
                yield from differences(stated[name], expected[name], file, inner)
    elif isinstance(stated, list) and isinstance(expected, list) and len(stated) == len(expected):
        for number, (there, here) in enumerate(zip(stated, expected, strict=True)):
            yield from differences(there, here, file, f"{key}[{number}]")
    elif not _same(stated, expected, key):
        yield Mismatch(file=file, key=key, stated=_value(stated), expected=_value(expected))


def _same(stated: Any, expected: Any, key: str = "") -> bool:
    if isinstance(stated, float) and isinstance(expected, float):
        tolerance = TOLERANCE_OF_BUDGET if key.startswith("budget[") else TOLERANCE
        return isclose(stated, expected, rel_tol=tolerance, abs_tol=1e-15)
    return type(stated) is type(expected) and bool(stated == expected)


def _value(value: Any) -> str:
    """Return a value of JSON to be printed: a string in quotes, a number to twelve digits."""
    return cut_short(f"{value:.12g}" if isinstance(value, float) else json.dumps(value))


def cut_short(text: str) -> str:
    """Return a string, shortened if it has more than 60 characters.

    A shortened string has the first 48 characters, an ellipsis, and the first 8 hexadecimal digits
    of the SHA-256 of the whole string.
    """
    cut = f"{text[:48]}… {hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return text if len(text) <= 60 else cut
