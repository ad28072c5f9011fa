"""Sources of a clip's frames, which yield one frame at a time, all of one size and depth.

Frames are read in order and not stored, so a clip may be larger than the memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.clips.containers import VideoTrack

Frame = NDArray[Any]  # pixels of 8 or 16 bits, unsigned
# pairs of a frame (None: not wanted) and its time stamp [s] (NaN: none)
Stamped = Iterator[tuple[Any, float]]
Wanted = Callable[[int], bool]  # whether the frame with a number must be decoded


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A source of a clip's frames: a file, a folder or an array."""

    path: Path
    declared: int  # number of frames that the file states
    # True if `declared` is computed from a duration, or includes frames that are never shown
    estimated: bool = False
    rate: float | None = None  # frame rate that the file states [1/s]
    exposure: float | None = None  # exposure time of a frame that the file states [s]
    # clockwise rotation of the frames that the file requests, already applied [degrees]
    rotation: float | None = None
    tracks: Sequence[VideoTrack] = ()  # video tracks of an MP4 or MOV file
    ignored: Sequence[str] = ()  # litter in a folder, see `virtual_lab.files.is_litter`
    read: Callable[[Wanted, int], Stamped]  # frames from a number on, in a video approximately

    def pictures(self, wanted: Wanted = lambda _: True) -> Stamped:
        """Yield frames, gray or in color, with their time stamps; None for a frame not wanted.

        Raises `InputError` if a frame has another size or depth than the first, if fewer frames can
        be read than the file states, or if there is none.
        """
        first, count = "", 0
        for frame, stamp in self.read(wanted, 0):
            size = "" if frame is None else _size(frame, f"{self.path}: frame {count}")
            first = first or size
            if size and size != first:
                allowed = f"the first frame is {first}; all frames need the same size and depth"
                raise InputError(str(self.path), f"frame {count}", size, allowed)
            count += 1
            yield frame, stamp
        if count == 0:
            raise InputError(str(self.path), "frames", 0, "no frame can be read")
        if count < self.declared and not self.estimated:
            allowed = f"the file states {self.declared} frames (is it cut short?)"
            raise InputError(str(self.path), "frames that can be read", count, allowed)

    def frame(self, number: int, stamps: Sequence[float]) -> Any:
        """Return the frame with a number. The frames far before it are not read, if possible.

        `stamps` are the time stamps of all frames. They identify a frame of a video, because a
        search by number may end at another frame.
        """
        stamp = stamps[number]
        known = not isnan(stamp) and stamps.count(stamp) == 1
        back = 1 if known else number
        while back < number:
            frames = self.read(lambda _: True, number - back)
            frame, at = next((each for each in frames if each[1] >= stamp), (None, nan))
            if at == stamp:
                return frame
            back *= 4
        start = number if isnan(stamp) else 0
        return next(islice(self.read(lambda each: each == number, start), number - start, None))[0]


def _size(frame: Frame, where: str) -> str:
    """Return size and depth of a frame. Raises `InputError` if unusable or too small for a ball."""
    colours = frame.shape[2:] in ((), (1,), (3,), (4,))
    if frame.dtype not in (np.uint8, np.uint16) or not colours or min(frame.shape[:2]) < 8:
        allowed = "expected 8 or 16 bits, gray, 3 colors or 4 channels, at least 8 x 8 pixels"
        raise InputError(where, "picture", f"{frame.shape} of {frame.dtype}", allowed)
    return f"{frame.shape[1]} x {frame.shape[0]} of {8 * frame.dtype.itemsize} bits"


def rate_of(said: float) -> float | None:
    """Return a frame rate [1/s] unchanged, or None if it is not between 1 and 1e7.

    `said` is the frame rate that a file states [1/s].
    """
    return said if 1 <= said <= 1e7 else None
