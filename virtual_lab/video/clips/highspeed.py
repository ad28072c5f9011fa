"""Files of high-speed cameras: Phantom's .cine, and Photron's .mraw with its .cihx or .cih.

Their headers are read by cinereader and pyMRAW, the extra ``highspeed``.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError, of_extra
from virtual_lab.units import Array
from virtual_lab.video.clips.source import Frame, Source, Stamped, Wanted, rate_of


@contextmanager
def _library_errors(path: Path, kind: str) -> Iterator[None]:
    """Raise the errors of a library as one `InputError`."""
    try:
        yield
    except Exception as fault:
        why = f"cannot be read (is it cut short?): {fault!r}"
        raise InputError(str(path), kind, None, why) from fault


def cine(path: Path) -> Source:
    """Return the source of the frames in a Phantom .cine file, with time stamps and exposure time.

    The pictures must be grayscale of 8, 10 or 12 bits, stored in 8 or 16 bits or packed as P10 or
    P12L. A raw color file is read as gray values of its color mosaic. Time stamps are NaN if the
    file has none, and the exposure time is None if the file states 0.

    Raises
    ------
    InputError
        The extra `highspeed` is not installed, or the header cannot be read. If the data of a
        picture are damaged, the error is raised later, when this picture is read.
    """
    reader = of_extra("cinereader", "highspeed", f"{path}: .cine")
    with _library_errors(path, ".cine"):
        head = reader.read_metadata(str(path))
        count, first = int(head.ImageCount), int(head.FirstImageNo)
        rate, exposure, stamps = rate_of(head.FrameRate), head.ExposureTime, _stamps(path, head)

    def read(_: Wanted, start: int) -> Stamped:
        for number in range(start, count):
            with _library_errors(path, ".cine"):
                image = reader.read_image(head, str(path), first + number)
            yield np.ascontiguousarray(image), float(stamps[number])

    return Source(path=path, declared=count, rate=rate, exposure=1e-6 * exposure or None, read=read)


def _stamps(path: Path, head: Any) -> Array:
    """Return the time of each image since the first [s]; NaN without a time block in the file."""
    # type number of a block of time stamps: 64 bits each, in units of 2^-32 s
    at, kind_of_stamps = head.OffSetup + head.Length, 1002
    with path.open("rb") as file:
        while at + 8 <= head.OffImageOffsets:
            file.seek(at)
            size, kind = struct.unpack("<IH2x", file.read(8))
            if kind == kind_of_stamps:
                ticks = np.frombuffer(file.read(8 * head.ImageCount), "<u8")
                return np.asarray((ticks - ticks[0]) / 2**32)
            at += max(size, 8)
    return np.full(head.ImageCount, np.nan)


def mraw(path: Path) -> Source:
    """Return the source of the frames in a Photron .mraw file with its header, .cihx or .cih.

    `path` is the path of the data file or of the header, which are in the same folder. The frames
    must be grayscale of 8, 12 or 16 bits. They have no time stamps.

    Raises
    ------
    InputError
        The extra `highspeed` is not installed, a file is missing, the header cannot be read, or the
        frames have another depth.
    """
    reader = of_extra("pyMRAW", "highspeed", f"{path}: .mraw")
    data = path.with_suffix(".mraw")
    headers = [data.with_suffix(each) for each in (".cihx", ".cih")]
    beside = next((each for each in headers if each.is_file()), headers[0])
    for file in (beside, data):
        if not file.is_file():
            raise InputError(str(path), ".mraw", None, f"{file.name} is not beside it")
    with _library_errors(beside, "header of .mraw"):
        head = reader.get_cih(str(beside))
        count, bits = int(head["Total Frame"]), int(head["Color Bit"])
        shape = int(head["Image Height"]), int(head["Image Width"])
        rate = rate_of(float(head["Record Rate(fps)"]))
    if bits not in {8, 12, 16}:
        raise InputError(str(path), ".mraw", f"{bits} bits", "allowed: gray of 8, 12 or 16 bits")
    size = shape[0] * shape[1] * bits // 8
    complete = min(count, data.stat().st_size // size)

    def read_frame(number: int) -> tuple[Frame, float]:
        raw = np.fromfile(data, np.uint8, size, offset=number * size)
        return _grey(raw, bits).reshape(shape), np.nan

    def read(_: Wanted, start: int) -> Stamped:
        return map(read_frame, range(start, complete))

    return Source(path=path, declared=count, rate=rate, read=read)


def _grey(raw: NDArray[np.uint8], bits: int) -> NDArray[Any]:
    """Return gray values from packed data: two of 12 bits per three bytes, high bits first."""
    if bits != 12:
        return raw.view(f"<u{bits // 8}")
    one, two, three = raw.reshape(-1, 3).astype(np.uint16).T
    return np.stack([(one << 4) | (two >> 4), ((two & 15) << 8) | three], axis=1).ravel()


HIGHSPEED: dict[str, Callable[[Path], Source]] = {
    ".cine": cine,
    **dict.fromkeys((".mraw", ".cihx", ".cih"), mraw),
}
