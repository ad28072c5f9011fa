"""The seal on a finished test: SHA-256 digests of its files, stored with the truth.

Whoever changes a file can make the digests again, unless the truth and its seal are kept elsewhere.
Then the seal also protects what no other check does: the date and the texts of a report.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from virtual_lab.certificate.comparing import FolderFinding
from virtual_lab.certificate.signing import compared_digests, digest_of_file, list_files
from virtual_lab.errors import InputError
from virtual_lab.files import read_json

TRUTH, SEAL = "truth/truth.json", "truth/seal.json"


def write_seal(folder: Path) -> None:
    """Write ``truth/seal.json``, with the digest of every file of a test in `folder`.

    An existing seal is replaced. Raises `FileNotFoundError` if there is no folder ``truth``.
    """
    files = {name: digest_of_file(folder / name) for name in list_files(folder) if name != SEAL}
    text = json.dumps({"schema": 2, "files": files}, indent=1) + "\n"
    (folder / SEAL).write_text(text, encoding="utf-8")


def compared_seal(folder: Path) -> Iterator[FolderFinding]:
    """Yield one finding per file that was altered or removed since `folder` was sealed.

    Added files are not reported. Raises `InputError` if there is no seal, or if it is no list of
    digests.
    """
    files = read_json(folder / SEAL).get("files")
    if not isinstance(files, dict):
        raise InputError(str(folder / SEAL), "files", None, "this key is missing: no seal")
    yield from compared_digests(folder, files.items())
