"""Pictures of a calibration board out of files: images, folders of them, stacks, clips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from virtual_lab.errors import InputError
from virtual_lab.video.clips.reading import (
    IMAGES,
    Frame,
    grey_of,
    image_files,
    open_source,
)

__all__ = ["read_pictures"]


def read_pictures(paths: Iterable[Path]) -> Iterator[tuple[str, Frame]]:
    """Yield name and grey values (row, column) of every picture in some files and folders.

    A picture out of a stack or a clip is named by its number, ``clip.mp4:12``.

    Raises
    ------
    InputError
        No such file, none that can be read, a folder without images.
    """
    for path in paths:
        for file in image_files(path) if path.is_dir() else (path,):
            yield from _pictures(file)


def _pictures(file: Path) -> Iterator[tuple[str, Frame]]:
    import cv2

    if file.suffix.lower() in IMAGES and file.is_file():
        pictures = cv2.imreadmulti(str(file), flags=cv2.IMREAD_UNCHANGED)[1]
        if not pictures:
            raise InputError(str(file), "image", None, "cannot be read (is it cut short?)")
        for number, picture in enumerate(pictures):
            name = str(file) if len(pictures) == 1 else f"{file}:{number}"
            yield name, grey_of(picture, name)
    else:
        for number, (frame, _) in enumerate(open_source(file).frames()):
            yield f"{file}:{number}", frame
