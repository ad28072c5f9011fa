"""Positions of the ball in regions or frames of a clip, the result of every method to locate it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntFlag
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.clips.source import Frame

MARGIN = 16.0  # width of the background around the ball [pixels]


class PlaceFlag(IntFlag):
    """A fault of the ball's picture in a frame."""

    NOT_FOUND = 1
    SATURATED = 2  # pixels at full scale within the ball or at its edge
    CLIPPED = 4  # part of the ball is out of the frame
    OVERLAP = 8  # another object touches or covers the ball
    POOR_FIT = 16  # the image does not agree with the model
    OFF_WAY = 32  # not on the path of its flight: contact, or an unseen object at the rim


USELESS = PlaceFlag.NOT_FOUND | PlaceFlag.CLIPPED | PlaceFlag.OVERLAP | PlaceFlag.POOR_FIT


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """The ball in each region or frame, arrays of shape (region,); NaN if it was not found.

    Positions are in pixels of the full frame, in OpenCV's convention. Fields that end in `_u` are
    standard uncertainties.
    """

    x: Array
    y: Array
    radius: Array
    x_u: Array
    y_u: Array
    blur_x: Array  # shift of the ball during the exposure [pixels]
    blur_y: Array
    chi_square: Array  # chi^2 per degree of freedom; NaN if the method has none
    flags: NDArray[np.uint16]  # bits of `PlaceFlag`
    # u of the position from the pattern of the ball, correlated in neighboring frames [pixels]
    pattern_u: Array

    @classmethod
    def start(cls, places: Array, radius: float, blur: Array) -> Located:
        """Return the start of a fit: positions (region, 2), radius, blurs (region, 2) [pixels]."""
        columns = {each.name: np.full(len(places), np.nan) for each in fields(cls)}
        columns |= zip(("x", "y"), places.T, strict=True)
        columns |= zip(("blur_x", "blur_y"), np.broadcast_to(blur, places.shape).T, strict=True)
        columns["radius"] = np.full(len(places), radius)
        return cls(**columns | {"flags": np.zeros(len(places), np.uint16)})

    @property
    def places(self) -> Array:
        """Position of the ball, (region, 2)."""
        return np.stack([self.x, self.y], axis=1)

    @property
    def u(self) -> Array:
        """Standard uncertainty of x, and of y, from noise, (region,)."""
        return np.asarray(np.hypot(self.x_u, self.y_u) / np.sqrt(2))

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Mask of the regions in which the ball was found whole and round, (region,)."""
        return np.asarray((self.flags & np.uint16(USELESS)) == 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Regions:
    """Pictures of the ball and of the background behind it, both (region, row, col) [DN]."""

    pixels: Frame
    background: NDArray[np.float32]
    corners: Array  # (region, 2): x, y of each first pixel in the frame


Parts = TypeVar("Parts", Located, Regions)


def part_of(whole: Parts, which: NDArray[np.intp] | slice) -> Parts:
    """Return the same arrays as `whole`, but only for the regions with the indices `which`.

    The arrays have one row per region. `which` is (region,) or a slice.
    """
    return replace(whole, **{each.name: getattr(whole, each.name)[which] for each in fields(whole)})


def squares(start: Located, shape: tuple[int, int]) -> tuple[Array, tuple[int, int]]:
    """Return the corners of square regions around the balls, and the shape of a region.

    The corners, (region, 2), are x and y of the upper left pixel in the frame. All regions have the
    same shape, (rows, columns), which contains the largest ball with a margin. A region that would
    extend beyond the frame is moved inside, and the ball is then not in its middle. `shape` is the
    shape of the frame, (rows, columns).
    """
    blur = np.hypot(start.blur_x, start.blur_y)
    half = float(np.nanmax(1.1 * start.radius + blur / 2)) + MARGIN
    side = min(2 * int(np.ceil(half)) + 1, *shape)
    last = np.array(shape[::-1]) - side
    return np.clip(np.round(start.places - side / 2 + 0.5), 0, last), (side, side)


def cut(picture: Frame, corners: Array, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return regions of a gray picture, (region, row, column).

    `corners`, (region, 2), are x and y of the upper left pixel of each region, and `shape` is the
    number of rows and columns of a region. Each region must be inside the picture.
    """
    left, top = corners.astype(int).T
    views = np.lib.stride_tricks.sliding_window_view(picture, shape)
    return np.asarray(views[top, left], np.float32)
