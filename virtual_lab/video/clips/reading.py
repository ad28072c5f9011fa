"""Frames from files: video, folders of images, TIFF stacks, arrays."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import is_litter, litter
from virtual_lab.video.clips.containers import is_cut_short, video_tracks
from virtual_lab.video.clips.highspeed import HIGHSPEED
from virtual_lab.video.clips.source import Frame, Source, Stamped, Wanted, rate_of

if TYPE_CHECKING:
    import cv2

IMAGES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".webp")
KINDS = (
    "a video (MP4, MOV, AVI, MKV, WebM, GIF, CINE, MRAW), a folder of images, a TIFF stack, an "
    "animated WebP or PNG, or a .npy array"
)
LARGEST = 50e6  # largest number of pixels of a picture: a film of 8K has 33 million


def open_source(path: Path | Frame) -> Source:
    """Return the source of the frames of a clip, without reading them.

    `path` is a file, a folder of pictures, or an array of frames, (frame, row, column). Color
    frames have a last axis with the channels blue, green and red, as in OpenCV.

    Raises
    ------
    InputError
        The file or folder is missing, is truncated or is of an unknown kind, a folder has no images
        or images of several kinds, or a picture is larger than 50 million pixels. Other faults are
        raised while the frames are read.
    """
    import cv2

    if isinstance(path, np.ndarray):
        return _array(Path("array"), lambda: path)
    if path.is_dir():
        return _images(path, _image_files(path))
    if not path.is_file():
        raise InputError(str(path), "clip", None, f"no such file or folder, expected {KINDS}")
    kind = path.suffix.lower()
    if kind == ".npy":
        # The file is mapped again for each frame, because one map keeps in memory all pages that
        # were read from it.
        return _array(path, partial(np.lib.format.open_memmap, path, "r"))
    if kind in HIGHSPEED:
        return HIGHSPEED[kind](path)
    if kind not in IMAGES or (kind == ".png" and cv2.imcount(str(path)) > 1):
        return _video(path)
    return _images(path, [path])


def _image_files(folder: Path) -> list[Path]:
    """Return the images in a folder by number: image-9 (before a trigger), image9, image10.

    A minus is the sign of a number if a separator or nothing is before it (image_-9), or if another
    image has a digit or a plus at the same position. Raises `InputError` if there are no images.
    """
    entries = (each for each in folder.iterdir() if not is_litter(each.name))
    images = [each for each in entries if each.suffix.lower() in IMAGES]
    names = [each.name.lower() for each in images]
    pairs = zip(min(names, default=""), max(names, default=""), strict=False)
    start = "".join(first for first, last in takewhile(lambda pair: pair[0] == pair[1], pairs))
    signs = r"(?<![^\W_])"
    if any(re.match(r"\+?\d", name[len(start) :]) for name in names):
        signs = f"(?:{signs}|(?<=^{re.escape(start)}))"
    number = re.compile(rf"{signs}[-+]\d+|\d+")

    def sort_key(file: Path) -> str:
        return number.sub(lambda digits: f"{10**19 + int(digits[0]):020d}", file.name.lower())

    files = sorted(images, key=sort_key)
    if not files:
        raise InputError(str(folder), "images", 0, f"a folder holds {', '.join(IMAGES)}")
    return files


def _images(path: Path, files: list[Path]) -> Source:
    """Return the source of a TIFF stack, or of the images in a folder."""
    import cv2

    if len(kinds := sorted({each.suffix.lower() for each in files})) > 1:
        raise InputError(str(path), "images", ", ".join(kinds), "one kind of image in a folder")
    for file in files:
        _require_sizes(file)
    pages = [cv2.imcount(str(file), cv2.IMREAD_UNCHANGED) for file in files]

    def read(_: Wanted, start: int) -> Stamped:
        for file, count in zip(files, pages, strict=True):
            if start < max(count, 1):
                # OpenCV 5.0 can only read a WebP from its first picture on, so all its pictures are
                # read at once.
                some = _pages(file, count, count if file.suffix.lower() == ".webp" else 8)
                yield from ((page, np.nan) for page in islice(some, start, None))
            start = max(start - count, 0)

    return Source(path=path, declared=sum(pages), ignored=litter(path), read=read)


def _pages(file: Path, count: int, at_once: int) -> Iterator[Frame]:
    """Yield the pictures in an image file. Raises `InputError` if there are none."""
    import cv2

    for start in range(0, max(count, 1), max(at_once, 1)):
        some, flags = min(at_once, count - start), cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
        read = count and cv2.imreadmulti(str(file), start=start, count=some, flags=flags)[1]
        if not read:
            raise InputError(str(file), "image", None, "cannot be read (is it cut short?)")
        yield from read


def _array(path: Path, load: Callable[[], Frame]) -> Source:
    """Return the source of the frames in an array."""
    try:
        shape = load().shape
    except (ValueError, OSError, EOFError, OverflowError) as fault:
        why = f"cannot be read as an array (is it cut short?): {fault}"
        raise InputError(str(path), "array", None, why) from fault
    if len(shape) not in {3, 4}:
        allowed = "expected (frame, row, column) or (frame, row, column, color)"
        raise InputError(str(path), "array", f"shape {shape}", allowed)
    _require_size(path, (shape[2], shape[1]))

    def read(_: Wanted, start: int) -> Stamped:
        return ((np.array(load()[k], order="C"), np.nan) for k in range(start, shape[0]))

    return Source(path=path, declared=shape[0], read=read)


def _video(path: Path) -> Source:
    import cv2

    if is_cut_short(path):
        allowed = "it ends before the last of its parts does (was it cut short?)"
        raise InputError(str(path), "video", None, allowed)
    capture = _capture(path)
    wide, high = capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
    _require_size(path, (int(wide), int(high)))
    rate, turn = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_ORIENTATION_META)
    tracks = video_tracks(path)
    if any(each.mirrored for each in tracks):
        allowed = "its header asks to mirror the pictures; convert it, with ffmpeg -i CLIP NEW"
        raise InputError(str(path), "video", "mirrored", allowed)
    wider = capture.get(cv2.CAP_PROP_SAR_NUM) / max(capture.get(cv2.CAP_PROP_SAR_DEN), 1)
    # factors that make pixels square
    stretch = (wider or 1.0, 1.0)[:: 1 if turn % 180 == 0 else -1]
    jpegs = _is_motion_jpeg(path, capture, (int(high), int(wide)))

    def read(wanted: Wanted, start: int) -> Stamped:
        capture = cv2.VideoCapture(str(path), cv2.CAP_OPENCV_MJPEG) if jpegs else _capture(path)
        if start:
            capture.set(cv2.CAP_PROP_POS_FRAMES, start)
        number = start
        while capture.grab():
            frame = capture.retrieve()[1] if wanted(number) else None
            if frame is None and wanted(number):
                allowed = "cannot be decoded (is the file damaged?)"
                raise InputError(str(path), f"frame {number}", None, allowed)
            if frame is not None and wider not in {0, 1}:
                frame = cv2.resize(frame, None, fx=stretch[0], fy=stretch[1])
            yield frame, number / rate if jpegs else capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            number += 1

    return Source(
        path=path,
        declared=max(int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0),
        estimated=not jpegs,
        rate=rate_of(rate),
        rotation=turn % 360 if np.isfinite(turn) else None,
        tracks=tracks,
        read=read,
    )


def _is_motion_jpeg(path: Path, capture: cv2.VideoCapture, size: tuple[int, int]) -> bool:
    """Return whether OpenCV's MJPEG reader gives the same frames.

    This reader only decodes requested frames.
    """
    import cv2

    if int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") != b"MJPG":
        return False
    decoder = cv2.VideoCapture(str(path), cv2.CAP_OPENCV_MJPEG)
    if decoder.get(cv2.CAP_PROP_FRAME_COUNT) != capture.get(cv2.CAP_PROP_FRAME_COUNT):
        return False
    success, first = decoder.read()
    # The size is compared because this reader returns only one field of an interlaced frame.
    return bool(success and first.shape[:2] == size and capture.get(cv2.CAP_PROP_FPS) > 0)


def _capture(path: Path) -> cv2.VideoCapture:
    """Open a video. Raises `InputError` if this fails."""
    import cv2

    # FFmpeg takes the part before a colon, as in 12:30:05.mp4, for a protocol
    capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        codec = ", ".join(each.codec for each in video_tracks(path)) or None
        allowed = f"cannot be opened (cut short, unknown codec, or no clip?), expected {KINDS}"
        raise InputError(str(path), "video", codec, allowed)
    # codes of FFmpeg for gray of 8 and 16 bits; an unknown format is -1
    greys = [int.from_bytes(name, "little") for name in (b"Y800", b"Y1\0\x10")]
    if capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT) in greys:
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # otherwise 16 bits are reduced to 8
    return capture


def _require_size(path: Path, size: tuple[int, int] | None) -> None:
    """Raise `InputError` if a picture is too large for a clip. A `size` of None is far too large.

    The size is read from the header, because a file of a few kilobytes may contain gigabytes of
    pixels.
    """
    if size is None or size[0] * size[1] > LARGEST:
        allowed = f"allowed: up to {LARGEST / 1e6:.0f} million pixels in a picture"
        raise InputError(str(path), "size", size and f"{size[0]} x {size[1]}", allowed)


def _require_sizes(path: Path) -> None:
    """Raise `InputError` if a page of an image file is too large, according to its header.

    A file that Pillow cannot read is left to the decoder.
    """
    from PIL import Image, ImageSequence

    sizes: list[tuple[int, int] | None] = []
    with suppress(OSError, SyntaxError, ValueError), warnings.catch_warnings(action="ignore"):
        try:
            with Image.open(path) as image:
                sizes += [page.size for page in ImageSequence.Iterator(image)]
        except Image.DecompressionBombError:
            sizes.append(None)
    for size in sizes:
        _require_size(path, size)


def grey_of(frame: Frame) -> Frame:
    """Return the gray values of a frame, (row, column), with the same number of bits.

    The channels of a color frame are blue, green and red, as in OpenCV. A fourth channel is
    ignored.
    """
    import cv2

    if frame.ndim == 2 or frame.shape[2] == 1:
        return frame.reshape(frame.shape[:2])
    return cv2.cvtColor(np.ascontiguousarray(frame[..., :3]), cv2.COLOR_BGR2GRAY)


def read_pictures(paths: Iterable[Path]) -> Iterator[tuple[str, Frame]]:
    """Yield the name and the gray values, (row, column), of every picture in files and folders.

    The name of a picture in a stack or a clip includes its number, such as ``clip.mp4:12``. Raises
    `InputError` if a file is missing or cannot be read, or if a folder has no images.
    """
    for file in chain.from_iterable(_image_files(e) if e.is_dir() else (e,) for e in paths):
        source = open_source(file)
        for number, (frame, _) in enumerate(source.pictures()):
            yield str(file) if source.declared == 1 else f"{file}:{number}", grey_of(frame)
