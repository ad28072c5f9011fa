"""A laboratory's logo: a small PNG picture.

It is stored as a ``data:`` address among the particulars, so that records and certificate contain
the complete picture.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from virtual_lab.catalog.specs import ReadEntry
from virtual_lab.errors import InputError
from virtual_lab.files import inside, read_bytes

MOST = 200_000  # largest size of a file [bytes]
MOST_PIXELS = 4_000_000
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
ADDRESS = "data:image/png;base64,"


def logo_of(name: str, folder: Path, where: str) -> str:
    """Return the logo in a PNG file as a ``data:`` URL.

    `name` is the name of the file in `folder`. `where` is the document that states this name, for
    error messages.

    Raises
    ------
    InputError
        The file is missing, is outside the folder, is not a PNG picture, is damaged, or is too
        large.
    """
    key, path = "laboratory.logo", inside(folder, name, where, "laboratory.logo")
    if path.suffix.lower() != ".png":
        allowed = "allowed: a .png file; a drawing program or a browser saves an SVG as PNG"
        raise InputError(where, key, name, allowed)
    data = read_bytes(path, most=2 * MOST)
    try:
        _require_png(data)
    except ValueError as fault:
        raise InputError(where, key, name, str(fault)) from fault
    return ADDRESS + base64.b64encode(data).decode()


def picture_in(address: str) -> bytes:
    """Return the bytes of the PNG picture in a ``data:`` URL.

    Raises `ValueError` if the text is not such a URL, or if the picture is damaged or too large.
    """
    if not address.startswith(ADDRESS):
        raise ValueError("must be a PNG picture embedded by 'reduce' or 'certify'")
    try:
        data = base64.b64decode(address.removeprefix(ADDRESS), validate=True)
    except binascii.Error:
        raise ValueError("must be a picture in base64") from None
    _require_png(data)
    return data


@dataclass(frozen=True, slots=True)
class LogoAddress(ReadEntry):
    """Annotation of a field whose entry is a picture, or empty."""

    def read(self, raw: object) -> object:
        """Return the entry. Raises `ValueError` if it is not such a picture."""
        if isinstance(raw, str) and raw:
            picture_in(raw)
        return raw


Logo = Annotated[str, LogoAddress()]


def _require_png(data: bytes) -> None:
    """Raise `ValueError` if the data are not a small PNG picture."""
    head = data[16:24]
    if not data.startswith(PNG_SIGNATURE) or data[12:16] != b"IHDR" or len(head) < 8:
        raise ValueError("is not a PNG picture")
    if len(data) > MOST:
        raise ValueError(f"has {len(data)} bytes, allowed up to {MOST}")
    width, height = (int.from_bytes(part, "big") for part in (head[:4], head[4:]))
    if not 0 < width * height <= MOST_PIXELS:
        raise ValueError(f"has {width} x {height} pixels, allowed up to {MOST_PIXELS:,} in all")
    import cv2
    import numpy as np

    if cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) is None:
        raise ValueError("is a PNG picture that cannot be read")
