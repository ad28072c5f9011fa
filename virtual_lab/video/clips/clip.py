"""Opening of a clip: one pass counts and times its frames, and samples them for the background."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.reading import grey_of, open_source
from virtual_lab.video.clips.source import Frame, Source
from virtual_lab.video.clips.timing import frame_times

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Limits for the parts of a clip that stay in memory."""

    samples: int = 25  # largest number of frames from which the background is found
    least_samples: int = 9
    most_sampled: float = 50e6  # largest size of all samples [bytes]
    # largest size of a clip that stays in memory while it is followed, so that it is decoded only
    # once [bytes]. Storing 1.3e9 bytes (216 frames of 1080p) takes as much processor time as
    # decoding them again.
    most_bytes: float = 5e8


MEMORY = Memory()


@dataclass(frozen=True, slots=True, kw_only=True)
class Clip:
    """Frames of a clip, and the results of one pass over them.

    A large clip is read again for each use.
    """

    source: Source
    held: Sequence[Frame] = ()  # all frames; empty for a clip that does not stay in memory
    times: NDArray[np.float64]  # (frame,) time [s]
    shape: tuple[int, int]  # rows, columns
    full_scale: float  # largest gray value of this number of bits [DN]
    samples: Frame  # (sample, row, column), or (…, 3) with colors, as stored
    sampled: NDArray[np.intp]  # numbers of the frames that were sampled
    warnings: tuple[str, ...]

    @property
    def count(self) -> int:
        """The number of frames."""
        return len(self.times)

    def grey_samples(self, every: int = 1) -> Frame:
        """Return the gray values of every `every`-th row and column, (sample, row, column)."""
        return np.stack([grey_of(each) for each in self.samples[:, ::every, ::every]])

    def pictures(self) -> Iterator[Frame]:
        """Return an iterator over all frames as stored, gray or in color."""
        return (picture for _, picture in self.numbered_frames(np.arange(self.count)))

    def numbered_frames(self, wanted: NDArray[np.intp]) -> Iterator[tuple[int, Frame]]:
        """Yield number and frame, as stored, of the frames with the `wanted` numbers, in order.

        Frames after the last wanted frame are not read.
        """
        numbers = set(map(int, wanted))
        if self.held:
            yield from ((number, self.held[number]) for number in sorted(numbers))
            return
        frames = ahead(self.source.pictures(numbers.__contains__))
        for number, (frame, _) in islice(enumerate(frames), max(numbers, default=-1) + 1):
            if number in numbers:
                yield number, frame

    def trim_memory(self) -> Clip:
        """Return the clip with two samples, and with its frames only if they take little memory."""
        small = sum(each.nbytes for each in self.held) <= MEMORY.most_sampled
        return replace(self, samples=self.samples[:2].copy(), held=self.held if small else ())


def open_clip(file: Path | Frame, calibration: ClipCalibration) -> Clip:
    """Return a clip after reading all its frames once.

    `file` is a file, a folder of pictures, or an array of frames. The result has a warning if time
    stamps in the file repeat or decrease.

    Raises
    ------
    InputError
        One of these conditions is met:

        * The file is not a clip, is truncated or has no frames.
        * A frame is smaller than 8 x 8 pixels or larger than 50 million pixels.
        * A frame does not have 8 or 16 bits.
        * The frames differ in size or depth.
        * The size of the frames is not the size of the calibrated camera's frames.
        * Neither the clip nor the calibration states a frame rate, and the calibration has no time
          stamps.
        * The time stamps of the calibration cannot be read, do not increase, or are not one per
          frame.
    """
    source = open_source(file)
    first, _ = next(source.pictures())
    camera, size = calibration.camera, (first.shape[1], first.shape[0])
    if camera and camera.image_size != size:
        wide, high = camera.image_size
        allowed = f"the calibrated camera's are {wide} x {high}: is it another camera's?"
        raise InputError(str(source.path), "frames", f"{size[0]} x {size[1]}", allowed)
    return _read(source, first, calibration)


def _read(source: Source, first: Frame, calibration: ClipCalibration) -> Clip:
    """Read a clip once. The samples are evenly spaced if the file states its length correctly."""
    room, deep = MEMORY.most_bytes / first.nbytes, first.dtype != np.uint8
    count = int(np.clip(MEMORY.most_sampled / first.nbytes, MEMORY.least_samples, MEMORY.samples))
    most, every = room, 1
    if not 0 < source.declared <= room:
        most, every = 2 * count, max(1, -(-source.declared // count))
    stamps: list[float] = []
    by_number: dict[int, Frame] = {}
    brightest = 255
    frames = source.pictures(lambda number: deep or number % every == 0)
    for number, (frame, stamp) in enumerate(frames):
        stamps.append(stamp)
        if number % every == 0:
            by_number[number] = frame
        while len(by_number) > most:  # the file states too few frames, or none
            most, every = 2 * count, 2 * every
            by_number = {k: by_number[k] for k in by_number if k % every == 0}
        if deep:
            brightest = max(brightest, int(frame.max()))
    counted = len(stamps)
    if 2 * len(by_number) < min(count, counted) and counted < source.declared:
        return _read(replace(source, declared=counted), first, calibration)
    times, warnings = frame_times(source, np.array(stamps), calibration)
    sampled = np.array([*by_number])[:: -(-counted // count) if every == 1 else 1]
    return Clip(
        source=source,
        held=list(by_number.values()) if every == 1 else (),
        times=times,
        shape=(first.shape[0], first.shape[1]),
        full_scale=float(2 ** brightest.bit_length() - 1),
        samples=np.stack([by_number[k] for k in sampled.tolist()]),
        sampled=sampled,
        warnings=warnings,
    )


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield the items of an iterator in order; a thread already prepares the next item.

    The iteration ends at the first item that is None. Errors of the iterator are raised here.
    """
    with ThreadPoolExecutor(1) as worker:
        coming = worker.submit(next, items, None)
        while (item := coming.result()) is not None:
            coming = worker.submit(next, items, None)
            yield item
