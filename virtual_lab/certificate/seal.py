"""The seal on a finished test: digests of all written files, stored with the truth.

The seal holds the SHA-256 of every file. JSON and TOML files are different, because their layout
may change. For them the seal holds a digest of each value with its key, which also shows which key
was changed. The truth has a single digest, because digests of single values would reveal them.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import contents, read_json, read_toml

TRUTH, SEAL = "truth/truth.json", "truth/seal.json"


@dataclass(frozen=True, slots=True)
class Alteration:
    """A file, or a key in it, that was altered, removed or added since the seal."""

    file: str
    key: str
    change: str

    def __str__(self) -> str:
        where = f"{self.file}, {self.key}" if self.key else self.file
        return f"{where}: {self.change} since it was sealed"


def write_seal(folder: Path) -> None:
    """Write ``truth/seal.json``, with a digest of every file of a test in `folder`.

    An existing seal is replaced. Raises `InputError` if a JSON or TOML file outside ``truth``
    cannot be read, and `FileNotFoundError` if there is no folder ``truth``.
    """
    files = (name for name, kind in contents(folder).items() if kind == "file" and name != SEAL)
    content = {name: _content(folder, name) for name in files}
    document = {"schema": 1, "digest": _digest(content), "content": content}
    (folder / SEAL).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def alterations(folder: Path) -> list[Alteration]:
    """Return the files and keys that were altered, removed or added since `folder` was sealed.

    The list is empty if nothing was changed. Added files are reported only below ``records`` and
    ``truth``. If the seal itself was altered, nothing else is reported. Raises `InputError` if
    there is no seal.
    """
    path = folder / SEAL
    if path.is_symlink():
        return [Alteration(SEAL, "", "replaced by a link")]
    if not path.exists():
        allowed = "is missing: taken away, or the test is older than seals; certify the bat again"
        raise InputError(str(path), "seal", None, allowed)
    try:
        seal = read_json(path)
    except InputError:
        seal = {}
    sealed = seal.get("content")
    if not isinstance(sealed, dict) or seal.get("digest") != _digest(sealed):
        return [Alteration(SEAL, "", "altered")]
    complete = {"records", "truth"}  # folders to which no file may be added
    present = contents(folder)
    present.pop(SEAL, None)
    additions = {
        name: kind
        for name, kind in present.items()
        if name not in sealed and complete & {*name.split("/")}
    }
    return [
        *(
            each
            for name, content in sealed.items()
            for each in _compare_file(folder, name, content, present.get(name))
        ),
        *(
            Alteration(name, "", "added" if kind == "file" else f"added, a {kind},")
            for name, kind in additions.items()
        ),
    ]


def _content(folder: Path, name: str) -> str | dict[str, str]:
    """Return the digest of a file, or of each of its keys if it is JSON or TOML.

    Raises `InputError` for a file of these kinds that cannot be read.
    """
    path = folder / name
    readers = {} if "truth" in name.split("/") else {".json": read_json, ".toml": read_toml}
    if reader := readers.get(path.suffix):  # 16 digits suffice against an accidental change
        return {key: _digest(value)[:16] for key, value in _values(reader(path))}
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _compare_file(
    folder: Path, name: str, sealed: str | dict[str, str], kind: str | None
) -> Iterator[Alteration]:
    """Yield the alterations of a sealed file; `kind` is its present kind, None if it is missing."""
    if kind != "file":
        yield Alteration(name, "", f"replaced by a {kind}" if kind else "removed")
        return
    try:
        content = _content(folder, name)
    except (ValueError, RecursionError):  # for example, a truncated file
        content = ""
    if not (isinstance(content, dict) and isinstance(sealed, dict)):
        if content != sealed:
            yield Alteration(name, "", "altered")
        return
    for key in sealed | content:
        if key not in content:
            yield Alteration(name, key, "removed")
        elif key not in sealed:
            yield Alteration(name, key, "added")
        elif content[key] != sealed[key]:
            yield Alteration(name, key, "altered")


def _values(document: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a document with keys such as ``budget[3].u``."""
    if isinstance(document, dict) and document:
        for name, value in document.items():
            # an unquoted name with a dot could be mistaken for two keys
            plain = name if re.fullmatch(r"[\w /-]+", name) else json.dumps(name)
            yield from _values(value, f"{key}.{plain}" if key else plain)
    elif isinstance(document, list) and document:
        for number, value in enumerate(document):
            yield from _values(value, f"{key}[{number}]")
    else:
        yield key, document


def _digest(value: Any) -> str:
    """Return the SHA-256 of a JSON value; 60 and 60.0 have the same digest."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()
