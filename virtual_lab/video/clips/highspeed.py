"""Files of high-speed cameras: Phantom's .cine, and Photron's .mraw with its .cihx or .cih.

Their headers are read by cinereader and pyMRAW, the extra ``highspeed``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError, with_extra
from virtual_lab.video.clips.picture_size import require_size

HIGHSPEED = (".cine", ".mraw", ".cihx", ".cih")
# frames, rate [1/s], exposure [s], what yields them
Header = tuple[int, float | None, float | None, Any]
CINE_TIMES, CINE_EXPOSURES = 1002, 1003  # blocks of 64 and 32 bits an image, of 2^-32 s


def cine(path: Path) -> Header:
    """Read a .cine file: 8 to 16 bits, grey, P10 and P12L too, with time stamps and exposure."""
    reader = _reader("cinereader", path, ".cine")
    try:
        head = reader.read_metadata(str(path))
        count, first = int(head.ImageCount), int(head.FirstImageNo)
        rate, blocks = float(head.FrameRate), _cine_blocks(path)
        ticks = np.frombuffer(blocks.get(CINE_TIMES, b""), "<u8")
        opened = np.frombuffer(blocks.get(CINE_EXPOSURES, b""), "<u4")
    except Exception as fault:
        raise _unreadable(path, ".cine", fault) from fault

    def read(_: int) -> Iterator[tuple[NDArray[Any], float]]:
        for number in range(first, first + count):
            try:
                image = np.asarray(reader.read_image(head, str(path), number))
            except Exception as fault:
                raise _unreadable(path, ".cine", fault) from fault
            stamp = (ticks[number - first] - ticks[0]) / 2**32 if len(ticks) == count else np.nan
            yield np.ascontiguousarray(image), float(stamp)

    exposure = float(np.median(opened)) / 2**32 if len(opened) == count else None
    return count, _sane(rate), exposure, read


def _cine_blocks(path: Path) -> dict[int, bytes]:
    """Read what stands between a .cine file's setup and its images, by the kind of block."""
    found = {}
    with path.open("rb") as file:
        setup, images = struct.unpack("<28xII8x", file.read(44))
        file.seek(setup)
        at = setup + struct.unpack("<142xH", file.read(144))[0]
        while at + 8 <= images:
            file.seek(at)
            size, kind, _ = struct.unpack("<IHH", file.read(8))
            if not 8 < size <= images - at:
                break
            found[kind], at = file.read(size - 8), at + size
    return found


def mraw(path: Path) -> Header:
    """Read the frames of a .mraw file (8, 12 or 16 bits, grey) by the header beside it."""
    reader = _reader("pyMRAW", path, ".mraw")
    data = path.with_suffix(".mraw")
    headers = [data.with_suffix(each) for each in (".cihx", ".cih")]
    beside = next((each for each in headers if each.is_file()), None)
    if beside is None or not data.is_file():
        missing = headers[0].name if beside is None else data.name
        raise InputError(str(path), ".mraw", None, f"{missing} is not beside it")
    try:
        head = reader.get_cih(str(beside))
        count, bits = int(head["Total Frame"]), int(head["Color Bit"])
        rows, columns = int(head["Image Height"]), int(head["Image Width"])
        rate = float(head["Record Rate(fps)"])
    except Exception as fault:
        raise _unreadable(beside, "header of .mraw", fault) from fault
    if bits not in {8, 12, 16}:
        raise InputError(str(path), ".mraw", f"{bits} bits", "allowed: grey of 8, 12 or 16 bits")
    require_size(path, columns, rows)
    size = rows * columns * bits // 8

    def read(_: int) -> Iterator[tuple[NDArray[Any], float]]:
        with data.open("rb") as file:
            for _ in range(count):
                raw = np.frombuffer(file.read(size), np.uint8)
                if raw.size < size:
                    return
                yield _grey(raw, bits).reshape(rows, columns), np.nan

    return count, _sane(rate), None, read


def _grey(raw: NDArray[np.uint8], bits: int) -> NDArray[Any]:
    """Grey values; two of 12 bits lie in three bytes, the greater digits first."""
    if bits == 8:
        return raw
    if bits == 16:
        return raw.view("<u2")
    one, two, three = raw.reshape(-1, 3).astype(np.uint16).T
    return np.stack([(one << 4) | (two >> 4), ((two & 15) << 8) | three], axis=1).ravel()


def _reader(name: str, path: Path, kind: str) -> ModuleType:
    try:
        return import_module(name)
    except ImportError as fault:
        needed = f"{kind} needs the extra 'highspeed' ({name})"
        raise InputError(str(path), needed, None, with_extra("highspeed")) from fault


def _unreadable(path: Path, kind: str, fault: Exception) -> InputError:
    return InputError(str(path), kind, None, f"cannot be read (is it cut short?): {fault!r}")


def _sane(rate: float) -> float | None:
    return rate if 1 <= rate <= 1e7 else None
