"""Two digests in the footer of a Parquet file, one of the data and one of the footer itself.

A Parquet file ends with a footer (the columns and the positions of their data), the length of the
footer in four bytes, and a mark. The digest of the footer is stored in the footer itself and is
computed with zeros at its position. A changed footer is therefore detected from the footer alone.
Any other change is detected from data and footer together.
"""

from __future__ import annotations

import re
from hashlib import sha256
from pathlib import Path

from virtual_lab.files import read_bytes

PARQUET_MARK = b"PAR1"  # first and last bytes of a Parquet file
TAIL_BYTES = 4 + len(PARQUET_MARK)  # size of the footer's length and the mark [B]
LARGEST_PART = 2e8  # largest size of a part [B]; with 8192 tests a part has 3e6
FIRST_LOOK = 65536  # size of the first read [B]; most footers fit into it
NO_DIGEST = "0" * 64  # placeholder of a digest
DATA, FOOTER = "data", "footer"  # keys of the digests
CHANGED_LATER = "it was changed after it was made"


class ChangedPartError(Exception):
    """Error: the file of a part is changed or unreadable; the message is the reason."""


def with_digests(file: bytes) -> bytes:
    """Return a Parquet file with the digests of its data and of its footer filled in.

    The footer of `file` must have zeros as placeholders. The digests replace them. Raises
    `ChangedPartError` if `file` is not a Parquet file or its footer has no placeholders.
    """
    data, footer, tail = _split_file(file)
    footer = _with_digest(footer, DATA, sha256(data).hexdigest())
    return data + _with_digest(footer, FOOTER, sha256(footer).hexdigest()) + tail


def checked_file(path: Path) -> bytes:
    """Return the bytes of a Parquet file after a check of its two digests.

    The footer of the file contains the digest of the data and the digest of the footer itself. To
    compute the digest of the footer, zeros are put in the place of this digest. Raises `InputError`
    if the file cannot be read. Raises `ChangedPartError` if the data or the footer were changed.
    """
    file = read_bytes(path, most=LARGEST_PART)
    data, footer, _ = _split_file(file)
    _require_unchanged(footer)
    if _digest_in(footer, DATA) != sha256(data).hexdigest():
        raise ChangedPartError(f"{CHANGED_LATER} (its data)")
    return file


def checked_footer(path: Path) -> bytes:
    """Check the footer of a Parquet file, and return a file that has this footer but no data.

    The footer is the last part of the file. It is checked with the digest (check sum) that it
    contains. The returned bytes begin and end with ``PAR1``, as the Parquet format requires.

    Raises `InputError` if the file cannot be read. Raises `ChangedPartError` if the footer was
    changed.
    """
    end = read_bytes(path, most=LARGEST_PART, last=FIRST_LOOK)
    if len(end) == FIRST_LOOK and _length(end) + TAIL_BYTES > FIRST_LOOK:
        end = read_bytes(path, most=LARGEST_PART)
    _, footer, tail = _split_file(end)
    _require_unchanged(footer)
    return PARQUET_MARK + footer + tail


def _require_unchanged(footer: bytes) -> None:
    if _digest_in(footer, FOOTER) != sha256(_with_digest(footer, FOOTER, NO_DIGEST)).hexdigest():
        raise ChangedPartError(f"{CHANGED_LATER} (its footer)")


def _length(end: bytes) -> int:
    return int.from_bytes(end[-TAIL_BYTES : -len(PARQUET_MARK)], "little")


def _split_file(file: bytes) -> tuple[bytes, bytes, bytes]:
    """Return data, footer and tail of a Parquet file, or of the last bytes of one."""
    start = len(file) - TAIL_BYTES - _length(file)
    if not file.endswith(PARQUET_MARK) or start < 0:
        raise ChangedPartError("it cannot be read (it is not a Parquet file, or was cut short)")
    return file[:start], file[start:-TAIL_BYTES], file[-TAIL_BYTES:]


def _place(footer: bytes, key: str) -> tuple[int, int]:
    """Return the positions of the first byte of a digest in a footer, and of the byte after it."""
    digest = rb'"%b": "([0-9a-f]{64})"' % key.encode()
    places = [match.span(1) for match in re.finditer(digest, footer)]
    if len(places) != 1:
        raise ChangedPartError(f"{CHANGED_LATER} (its footer)")
    return places[0]


def _digest_in(footer: bytes, key: str) -> str:
    begin, end = _place(footer, key)
    return footer[begin:end].decode()


def _with_digest(footer: bytes, key: str, digest: str) -> bytes:
    begin, end = _place(footer, key)
    return footer[:begin] + digest.encode() + footer[end:]
