"""Detection of truncated files, by the lengths that a container states or by an end marker."""

from __future__ import annotations

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
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        head = file.read(16)
        if end := ENDS.get(head[:4]):
            file.seek(max(0, size - 1024))
            return not file.read().rstrip(b"\0").endswith(end)
        while at < size and (length := _length_of_part(head)):
            at += length
            file.seek(min(at, size))  # a stated length may be larger than any file
            head = file.read(16)
    return at > size + 8  # some AVI writers count the 8 bytes of the header as content


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
