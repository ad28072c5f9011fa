"""Reading JSON documents and raw bytes with errors that name the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError

__all__ = ["read_bytes", "read_json", "read_text"]


def read_bytes(path: Path) -> bytes:
    """Return the content of a file; `InputError` where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as fault:
        raise InputError(str(path), "file", None, f"cannot be read ({fault.strerror})") from fault


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file; `InputError` where it is none."""
    try:
        return read_bytes(path).decode()
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
