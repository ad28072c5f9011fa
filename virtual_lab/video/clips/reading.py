"""Frames out of files: video, folders of images, TIFF stacks, arrays; one at a time, grey.

Frames are read in order and never kept, so a clip may be longer than the memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.clips.highspeed import HIGHSPEED, cine, mraw
from virtual_lab.video.clips.picture_size import require_size, require_sizes

if TYPE_CHECKING:
    import cv2

Frame = NDArray[Any]  # of 8 or 16 bits without sign

IMAGES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp")
KINDS = "a video (MP4, MOV, AVI, MKV, CINE, MRAW), a folder of images, a TIFF stack or a .npy array"


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where a clip's frames come from."""

    path: Path
    declared: int  # frames the file says it holds
    estimated: bool = False  # estimated from the duration, not counted
    rate: float | None = None  # frames a second the file says
    exposure: float | None = None  # of a frame [s], that the file says
    rotation: int = 0  # degrees clockwise that frames were turned as the file asks for
    # every so manieth picture at least, others may be None; each with its time [s], NaN: none
    read: Callable[[int], Iterator[tuple[Frame | None, float]]]

    def pictures(self) -> Iterator[tuple[Frame, float]]:
        """Yield each frame, grey or in colour, with its own time stamp [s] (NaN: it has none).

        Raises as `skimmed` does.
        """
        return ((frame, stamp) for frame, stamp in self.skimmed(1) if frame is not None)

    def skimmed(self, every: int) -> Iterator[tuple[Frame | None, float]]:
        """Yield the same, of which every so manieth at least is a picture, others may be None.

        Raises `InputError` where a frame has another size or depth than the first, where
        fewer can be read than the file says it holds, or where there is none.
        """
        first: Frame | None = None
        count = 0
        for frame, stamp in self.read(every):
            if frame is not None:
                _require_picture(frame, f"{self.path}: frame {count}")
                first = frame if first is None else first
                if (frame.shape[:2], frame.dtype) != (first.shape[:2], first.dtype):
                    allowed = f"the first is {_size(first)}: all have one size and depth"
                    raise InputError(str(self.path), f"frame {count}", _size(frame), allowed)
            count += 1
            yield frame, stamp
        if count == 0:
            raise InputError(str(self.path), "frames", 0, "no frame in it can be read")
        # an estimate may be one frame too many
        if count < self.declared - int(self.estimated):
            allowed = f"the file says it holds {self.declared} (is it cut short?)"
            raise InputError(str(self.path), "frames that can be read", count, allowed)


def open_source(path: Path | Frame) -> Source:
    """Frames of a clip; `InputError` where there is none that can be read.

    `path`: a file or a folder; or the frames, (frame, row, column) or with a last axis of colours,
    blue first as OpenCV has them.
    """
    if isinstance(path, np.ndarray):
        _require_frames(path.shape, "array")
        return Source(
            path=Path("array"),
            declared=len(path),
            read=lambda _: ((np.ascontiguousarray(each), np.nan) for each in path),
        )
    if path.is_dir():
        return _folder(path)
    if not path.is_file():
        raise InputError(str(path), "clip", None, f"no such file or folder, expected {KINDS}")
    if path.suffix.lower() == ".npy":
        return _array(path)
    if path.suffix.lower() in HIGHSPEED:
        read = cine if path.suffix.lower() == ".cine" else mraw
        count, rate, exposure, frames = read(path)
        return Source(path=path, declared=count, rate=rate, exposure=exposure, read=frames)
    return _stack(path) if path.suffix.lower() in IMAGES else _video(path)


def _image_files(path: Path) -> list[Path]:
    """Images in a folder, image9 before image10; `InputError` where there are none."""

    def counted(file: Path) -> list[tuple[int, str]]:
        parts = re.split(r"(\d+)", file.name.lower())
        return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]

    shown = (each for each in path.iterdir() if not each.name.startswith("."))
    files = sorted((each for each in shown if each.suffix.lower() in IMAGES), key=counted)
    if not files:
        raise InputError(str(path), "images", 0, f"a folder holds {', '.join(IMAGES)}")
    return files


def _folder(path: Path) -> Source:
    files = _image_files(path)
    if len(kinds := sorted({each.suffix.lower() for each in files})) > 1:
        raise InputError(str(path), "images", ", ".join(kinds), "one kind of image in a folder")
    for file in files:
        require_sizes(file)
    return Source(
        path=path,
        declared=len(files),
        read=lambda _: ((next(_pages(file)), np.nan) for file in files),
    )


def _stack(path: Path) -> Source:
    import cv2

    require_sizes(path)
    pages = cv2.imcount(str(path), cv2.IMREAD_UNCHANGED)
    return Source(
        path=path, declared=pages, read=lambda _: ((page, np.nan) for page in _pages(path))
    )


def _pages(file: Path, at_once: int = 8) -> Iterator[Frame]:
    """Yield the pictures in an image file; `InputError` where there is none."""
    import cv2

    count, path = cv2.imcount(str(file), cv2.IMREAD_UNCHANGED), str(file)
    for start in range(0, max(count, 1), at_once):
        some, flags = min(at_once, count - start), cv2.IMREAD_UNCHANGED
        read = count and cv2.imreadmulti(path, start=start, count=some, flags=flags)[1]
        if not read:
            raise InputError(str(file), "image", None, "cannot be read (is it cut short?)")
        yield from read


def _require_frames(shape: tuple[int, ...], where: Path | str) -> None:
    """Raise `InputError` unless an array of that shape is one of frames."""
    if len(shape) not in {3, 4}:
        allowed = "expected (frame, row, column) or (frame, row, column, colour)"
        raise InputError(str(where), "array", f"shape {shape}", allowed)
    require_size(Path(where), shape[2], shape[1])


def _array(path: Path) -> Source:
    try:
        whole = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(whole, np.ndarray):
            whole.close()
            raise ValueError("it is an archive of arrays")
    except (ValueError, OSError, EOFError, OverflowError) as fault:
        why = f"cannot be read as an array (is it cut short?): {fault}"
        raise InputError(str(path), "array", None, why) from fault
    shape = whole.shape
    del whole
    _require_frames(shape, path)

    def read(_: int) -> Iterator[tuple[Frame, float]]:
        for index in range(shape[0]):  # mapped anew: pages read would count as memory
            yield np.array(np.load(path, mmap_mode="r")[index], order="C"), np.nan

    return Source(path=path, declared=shape[0], read=read)


def _video(path: Path) -> Source:
    import cv2

    capture = _open(path)
    size = [capture.get(k) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    require_size(path, *map(int, size))
    declared = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    turn = capture.get(cv2.CAP_PROP_ORIENTATION_META)
    pixels = int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)).to_bytes(4, "little")
    grey = pixels in (b"Y800", b"Y1\0\x10")  # FFmpeg's own grey of 8 and 16 bits
    jpegs = rate > 0 and not grey and _is_motion_jpeg(path, capture)
    capture.release()
    if declared == 0:
        raise InputError(str(path), "frames", 0, "no frame in it can be read")

    def read(every: int) -> Iterator[tuple[Frame | None, float]]:
        capture = cv2.VideoCapture(str(path), cv2.CAP_OPENCV_MJPEG) if jpegs else _open(path)
        if grey:
            capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # else 16 bits are cut to 8
        try:
            number = 0
            while capture.grab():
                frame = None if number % every else capture.retrieve()[1]
                if frame is None and number % every == 0:
                    break
                stamp = number / rate if jpegs else capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
                yield frame, stamp
                number += 1
        finally:
            capture.release()

    return Source(
        path=path,
        declared=max(declared, 0),
        estimated=path.suffix.lower() in {".mkv", ".webm"},
        rate=rate if np.isfinite(rate) and rate > 0 else None,
        rotation=int(turn) % 360 if np.isfinite(turn) else 0,
        read=read,
    )


def _is_motion_jpeg(path: Path, capture: cv2.VideoCapture) -> bool:
    """Whether OpenCV's own reader shows the same: it decodes only the pictures asked for."""
    import cv2

    if int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") != b"MJPG":
        return False
    own = cv2.VideoCapture(str(path), cv2.CAP_OPENCV_MJPEG)
    if own.get(cv2.CAP_PROP_FRAME_COUNT) != capture.get(cv2.CAP_PROP_FRAME_COUNT):
        return False
    shown, first = own.read()
    size = (capture.get(cv2.CAP_PROP_FRAME_HEIGHT), capture.get(cv2.CAP_PROP_FRAME_WIDTH))
    return shown and first.shape[:2] == size  # of interlaced fields it shows one


def _open(path: Path) -> cv2.VideoCapture:
    import cv2

    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        allowed = f"cannot be opened (cut short, or no clip?), expected {KINDS}"
        raise InputError(str(path), "video", None, allowed)
    return capture


def _require_picture(frame: Frame, where: str) -> None:
    """Raise `InputError` unless a frame is grey or of 3 or 4 channels, of 8 or 16 bits."""
    if frame.dtype not in (np.uint8, np.uint16):
        raise InputError(where, "depth", str(frame.dtype), "expected 8 or 16 bits without sign")
    if frame.ndim != 2 and (frame.ndim != 3 or frame.shape[2] not in {1, 3, 4}):
        raise InputError(where, "shape", str(frame.shape), "expected grey, 3 colours or 4 channels")
    if min(frame.shape[:2]) < 8:  # less shows no ball
        raise InputError(where, "shape", str(frame.shape), "a frame has at least 8 x 8 pixels")


def grey_of(frame: Frame) -> Frame:
    """Frame as grey of its own depth."""
    import cv2

    if frame.ndim == 2:
        return frame
    if frame.shape[2] == 1:
        return frame[..., 0]
    code = cv2.COLOR_BGR2GRAY if frame.shape[2] == 3 else cv2.COLOR_BGRA2GRAY
    return cv2.cvtColor(frame, code)


def _size(frame: Frame) -> str:
    return f"{frame.shape[1]} x {frame.shape[0]} of {8 * frame.dtype.itemsize} bits"


def read_pictures(paths: Iterable[Path]) -> Iterator[tuple[str, Frame]]:
    """Yield name and grey values (row, column) of every picture in some files and folders.

    A picture out of a stack or a clip is named by its number, ``clip.mp4:12``. Raises `InputError`
    where there is no such file, none that can be read, or a folder without images.
    """
    for file in chain.from_iterable(_image_files(e) if e.is_dir() else (e,) for e in paths):
        source = open_source(file)
        for number, (frame, _) in enumerate(source.pictures()):
            yield str(file) if source.declared == 1 else f"{file}:{number}", grey_of(frame)
