"""Small pictures about the ball, and what takes them to its place: a `Locator`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import Frame
from virtual_lab.video.locate.located import Located

__all__ = ["Locator", "Regions", "Square", "squares"]

Array = NDArray[np.float64]
Square = tuple[slice, slice]  # rows, columns

MARGIN = 16.0  # pixels of background about the ball


@dataclass(frozen=True, slots=True, kw_only=True)
class Regions:
    """Pictures of the ball and of what is behind it, both (region, row, col) [DN]."""

    pixels: Frame
    background: NDArray[np.float32]
    corners: Array  # (region, 2): x, y of each first pixel in the frame

    def part(self, which: NDArray[np.intp]) -> Regions:
        """Return some of the regions."""
        return Regions(
            pixels=self.pixels[which],
            background=self.background[which],
            corners=self.corners[which],
        )


class Locator(Protocol):
    """Where the ball is in each region, from where it is to a tenth of its radius or so."""

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        ...


def squares(start: Located, shape: tuple[int, int]) -> list[Square]:
    """Return where to cut one square region about the ball of each frame.

    A region that would leave the frame is moved back into it: the frame's edge cuts the ball.
    """
    rows, columns = shape
    blur = np.hypot(start.blur_x, start.blur_y)
    half = float(np.nanmax(1.1 * start.radius + blur / 2)) + MARGIN
    side = min(2 * int(np.ceil(half)) + 1, rows, columns)
    left = np.clip(np.round(start.x - side / 2 + 0.5), 0, columns - side).astype(int)
    top = np.clip(np.round(start.y - side / 2 + 0.5), 0, rows - side).astype(int)
    return [np.s_[y : y + side, x : x + side] for x, y in zip(left, top, strict=True)]
