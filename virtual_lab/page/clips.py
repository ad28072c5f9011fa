"""Frames of a clip, as pictures for the page."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from virtual_lab.errors import InputError
from virtual_lab.video.clips.reading import open_source

QUALITY = 85  # quality of the pictures [0 to 100, scale of JPEG]


def clip_size(path: Path) -> dict[str, object]:
    """Return number, width and height of a clip's frames, and a name of its present state."""
    state = _state(path)
    (height, width), stamps = _shape_and_stamps(path, state)
    return {"count": len(stamps), "width": width, "height": height, "state": str(state)}


def frame_picture(path: Path, number: int) -> bytes:
    """Return a frame of a clip as JPEG. Raises `InputError` if the clip has no such frame."""
    import cv2

    stamps = _shape_and_stamps(path, _state(path))[1]
    if not 0 <= number < len(stamps):
        raise InputError(str(path), "frame", number, "there is no such frame")
    frame = open_source(path).frame(number, stamps)
    shown = frame if frame.dtype == "uint8" else (frame / (frame.max() or 1) * 255)
    return bytes(cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])


@lru_cache(maxsize=1)
def _shape_and_stamps(path: Path, _: int) -> tuple[tuple[int, int], tuple[float, ...]]:
    """Return rows and columns of a clip's frames, and the time stamps of all frames [s]."""
    frames, stamps = zip(*open_source(path).pictures(lambda number: number == 0), strict=True)
    return frames[0].shape[:2], stamps


def _state(path: Path) -> int:
    """Return a number that changes when the file, or a file in the folder, is changed."""
    states = (each.stat() for each in (path, *sorted(path.glob("*"))))
    return hash(tuple((each.st_mtime_ns, each.st_size) for each in states))
