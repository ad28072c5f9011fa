"""Sizes of pictures by their headers: a file of a few kilobytes may hold gigabytes of pixels."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from virtual_lab.errors import InputError

LARGEST = 50e6  # pixels of a picture: a film of 8K has 33 million
PNG = b"\x89PNG\r\n\x1a\n"
TIFF = {  # order of bytes and mark: struct's sign of the order, and whether offsets have 8 bytes
    b"II*\0": ("<", False),
    b"MM\0*": (">", False),
    b"II+\0": ("<", True),
    b"MM\0+": (">", True),
}
TIFF_WIDTH, TIFF_HEIGHT, TIFF_SHORT = 256, 257, 3
MOST_PAGES = 100_000  # a chain of pages may be a ring
JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # markers that begin with a size


def require_size(path: Path, wide: int, high: int) -> None:
    """Raise `InputError` where a picture of a file is larger than a clip's can be."""
    if wide * high > LARGEST:
        allowed = f"allowed: up to {LARGEST / 1e6:.0f} million pixels in a picture"
        raise InputError(str(path), "size", f"{wide} x {high}", allowed)


def require_sizes(path: Path) -> None:
    """Raise `InputError` where a header of an image file says that a picture is too large.

    PNG, TIFF with all its pages, JPEG, BMP; what cannot be read is left to the decoder.
    """
    with path.open("rb") as file:
        try:
            for wide, high in _sizes(file):
                require_size(path, wide, high)
        except (struct.error, OverflowError):
            return


def _sizes(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Yield width and height of each picture [pixels]."""
    head = file.read(26)
    if head.startswith(PNG):
        yield struct.unpack(">II", head[16:24])
    elif head[:4] in TIFF:
        yield from _tiff_sizes(file, *TIFF[head[:4]])
    elif head.startswith(b"\xff\xd8"):
        yield from _jpeg_size(file)
    elif head.startswith(b"BM"):
        wide, high = struct.unpack("<ii", head[18:26])
        yield wide, abs(high)


def _tiff_sizes(file: BinaryIO, order: str, big: bool) -> Iterator[tuple[int, int]]:
    def number(form: str) -> int:
        (value,) = struct.unpack(order + form, file.read(struct.calcsize(form)))
        return int(value)

    offset, count, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
    file.seek(8 if big else 4)
    for _ in range(MOST_PAGES):
        page = number(offset)
        if page == 0:
            return
        file.seek(page)
        found = {TIFF_WIDTH: 0, TIFF_HEIGHT: 0}
        entries = number(count)
        first = page + struct.calcsize("=" + count)
        for at in range(first, first + entries * entry, entry):
            file.seek(at)
            tag, kind = number("H"), number("H")
            if tag > TIFF_HEIGHT:  # tags rise
                break
            number(offset)  # of values: one
            if tag in found:
                found[tag] = number("H" if kind == TIFF_SHORT else "I")
        yield found[TIFF_WIDTH], found[TIFF_HEIGHT]
        file.seek(first + entries * entry)


def _jpeg_size(file: BinaryIO) -> Iterator[tuple[int, int]]:
    file.seek(2)
    while True:
        mark, kind, length = struct.unpack(">BBH", file.read(4))
        if mark != 0xFF:
            return
        if kind in JPEG_FRAMES:
            high, wide = struct.unpack(">xHH", file.read(5))
            yield wide, high
            return
        file.seek(length - 2, 1)
