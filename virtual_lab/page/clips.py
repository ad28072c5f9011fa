"""Frames of a clip, as pictures for the page."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from virtual_lab.errors import InputError
from virtual_lab.video.clips.reading import open_source

QUALITY = 85  # quality of the pictures [0 to 100, scale of JPEG]


@lru_cache(maxsize=1)
def clip_size(path: Path) -> dict[str, int]:
    """Return number, width and height of the frames of a clip."""
    shape, count = (0, 0), 0
    for frame, _ in open_source(path).pictures(lambda number: number == 0):
        shape, count = shape if frame is None else frame.shape, count + 1
    return {"count": count, "width": shape[1], "height": shape[0]}


@lru_cache(maxsize=300)
def frame_picture(path: Path, number: int) -> bytes:
    """Return a frame of a clip as JPEG. Raises `InputError` if the clip has no such frame."""
    import cv2

    for at, (frame, _) in enumerate(open_source(path).pictures(lambda each: each == number)):
        if at == number:
            shown = frame if frame.dtype == "uint8" else (frame / (frame.max() or 1) * 255)
            return bytes(cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])
    raise InputError(str(path), "frame", number, "there is no such frame")
