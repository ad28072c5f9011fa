"""What a container states: lengths, by which a truncated file is detected, and tracks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# parts of MP4, MOV and 3GP files, keyed by name
BOXES = b"ftyp moov mdat moof mfra free skip wide pnot styp sidx uuid meta udta".split()
EBML, SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"  # parts of MKV and WebM files
ENDS = {b"GIF8": b";", b"\x89PNG": b"IEND\xaeB`\x82"}  # last bytes of a file, by its first


def is_cut_short(path: Path) -> bool:
    """Return whether a video or picture file is truncated.

    A file is truncated if it is shorter than its container states. A GIF or PNG file is truncated
    if its end marker is missing. The result is False if the file states no lengths.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        if end := ENDS.get(file.read(4)):
            file.seek(max(0, size - 1024))
            return not file.read().rstrip(b"\0").endswith(end)
    # Some AVI writers count the 8 bytes of the header as content.
    return any(at + length > size + 8 for _, at, length in _parts(path))


def _parts(path: Path) -> Iterator[tuple[bytes, int, int]]:
    """Yield the first 16 bytes of each part of a file, its position and its length [bytes]."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < size and (length := _length_of_part(head := file.read(16))):
            yield head, at, length
            at += length
            file.seek(min(at, size))  # a stated length may be larger than any file


@dataclass(frozen=True, kw_only=True)
class VideoTrack:
    """A video track by the header of an MP4 or MOV file."""

    codec: str  # four characters
    mirrored: bool  # whether a player must mirror the pictures
    shown: float  # share of its duration that a player shows; the rest is hidden by an edit list


def video_tracks(path: Path) -> list[VideoTrack]:
    """Return the video tracks of an MP4 or MOV file; the list is empty for other files."""
    header = b""
    for head, at, length in _parts(path):
        if head[4:8] == b"moov":
            with path.open("rb") as file:
                file.seek(at)
                header = file.read(length)
    _, *tracks = header.split(b"trak")
    pictures = [each for each in tracks if re.search(rb"hdlr.{8}vide", each, re.DOTALL)]
    return [_track(header, each) for each in pictures]


def _track(header: bytes, track: bytes) -> VideoTrack:
    """Return a video track from its part of the header."""

    def numbers(name: bytes, place: int, within: bytes) -> list[int]:
        """Return the signed numbers of 32 bits from a place in a part on (format version 0)."""
        at = within.find(name) + 4
        late = 12 if within[at] and name == b"tkhd" else 8 * within[at]
        cells = within[at + late + place :][: 4 * 17]
        return [int.from_bytes(cells[k : k + 4], "big", signed=True) for k in range(0, 68, 4)]

    duration, *more = numbers(b"tkhd", 20, track)
    right, down, _, left, below = more[4:9]
    (clock, *_), (tick, length, *_) = numbers(b"mvhd", 12, header), numbers(b"mdhd", 12, track)
    shown = duration / clock / (length / tick) if clock and length and tick else 1.0
    code = track[track.find(b"stsd") + 16 :][:4].decode("latin-1")
    return VideoTrack(codec=code, mirrored=right * below < left * down, shown=shown)


def _length_of_part(head: bytes) -> int:
    """Return the length [bytes] of the file part that begins with `head`, 0 if not stated."""
    if head[:4] == b"RIFF":
        return 8 + int.from_bytes(head[4:8], "little")
    if head[:4] in (EBML, SEGMENT):
        width = 9 - head[4].bit_length()  # width of the number that states the length [bytes]
        largest = (1 << 7 * width) - 1  # value that means an unknown length
        content = int.from_bytes(head[4 : 4 + width], "big") & largest
        return 4 + width + content if content < largest else 0
    if head[4:8] in BOXES:
        short = int.from_bytes(head[:4], "big")
        return int.from_bytes(head[8:16], "big") if short == 1 else short
    return 0
