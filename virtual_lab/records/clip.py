"""Camera records: image windows with time stamps, or tracked positions of the ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records.record import Order, Record, RecordColumn, rising
from virtual_lab.units import Array

FRAMES = ("shot", "frame")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipRecord(Record):
    """Square image windows around the ball, (shot, frame); NaN after the last frame of a shot.

    The time of a frame is the middle of its exposure. `left` and `top` are the frame coordinates of
    the first pixel of a window. A lost frame has no entry, so the times show a gap.
    """

    times: Array
    left: Array
    top: Array
    pixels: NDArray[np.generic] | None = None  # gray values, (shot, frame, row, column)
    background: NDArray[np.generic] | None = None  # mean of whole empty frames, (row, column)
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s", FRAMES, "middle of the exposure; empty: no more frames", may_be_missing=True
        ),
        "left": RecordColumn(
            "left_px",
            FRAMES,
            "column of the window's first pixel in the frame; empty: no more frames",
            may_be_missing=True,
        ),
        "top": RecordColumn(
            "top_px",
            FRAMES,
            "row of the window's first pixel in the frame; empty: no more frames",
            may_be_missing=True,
        ),
    }
    attached: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "pixels": (*FRAMES, "row", "column"),
        "background": ("row of the frame", "column of the frame"),
    }

    def join_attached(self, parts: list[ClipRecord]) -> dict[str, NDArray[np.generic] | None]:
        pixels = [part.pixels for part in parts if part.pixels is not None]
        whole = np.concatenate(pixels) if len(pixels) == len(parts) else None
        return {"pixels": whole, "background": self.background}

    def orders(self) -> tuple[Order, ...]:
        return (rising(self.times, FRAMES),)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRecord(Record):
    """Record of a tracking camera: the ball's center in each frame, (shot, frame) [px].

    Positions are in pixels of the frame in OpenCV's convention, not corrected for distortion. `u`
    is the standard uncertainty of each coordinate.
    """

    times: Array
    x: Array
    y: Array
    u: Array
    columns: ClassVar[Mapping[str, RecordColumn]] = {
        "times": RecordColumn(
            "time_s", FRAMES, "middle of the exposure; empty: no more frames", may_be_missing=True
        ),
        "x": RecordColumn(
            "x_px",
            FRAMES,
            "column of the ball's center, not corrected for distortion; empty: no position",
            may_be_missing=True,
        ),
        "y": RecordColumn(
            "y_px",
            FRAMES,
            "row of the ball's center, not corrected for distortion; empty: no position",
            may_be_missing=True,
        ),
        "u": RecordColumn(
            "u_px",
            FRAMES,
            "standard uncertainty of each coordinate of the ball's center; empty: no position",
            may_be_missing=True,
        ),
    }

    def orders(self) -> tuple[Order, ...]:
        return (rising(self.times, FRAMES),)
