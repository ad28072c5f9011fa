"""Where the ball is in each region or frame of a clip: what every way of locating it returns."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Flag", "Located", "chosen", "part_of", "put"]

Array = NDArray[np.float64]


class Flag(IntFlag):
    """What is wrong with the ball in a frame."""

    NOT_FOUND = 1
    SATURATED = 2  # pixels at full scale within the ball or at its edge
    CLIPPED = 4  # part of the ball is out of the frame
    OVERLAP = 8  # something else touches the ball or covers it
    POOR_FIT = 16  # the model of the image does not hold
    JUMP = 32  # not where its neighbours in time say
    CONTACT = 64  # the ball is being struck: it flies neither in nor out


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """The ball in each region or frame, arrays of shape (region,); NaN where it was not found.

    Pixels of the full frame, OpenCV's convention; `u`s are one standard uncertainty each.
    """

    x: Array
    y: Array
    radius: Array
    x_u: Array
    y_u: Array
    blur_x: Array  # the ball's shift during the exposure, pixels
    blur_y: Array
    chi_square: Array  # per degree of freedom; NaN where the method has none
    flags: NDArray[np.uint16]  # bits of `Flag`
    # what the ball's own pattern may shift it by, alike in neighbouring frames [pixels]
    pattern_u: Array | None = None


def part_of(all_: Located, which: NDArray[np.intp]) -> Located:
    """Return some of the regions."""
    return Located(**{name: given[which] for name, given in _given(all_).items()})


def chosen(which: NDArray[np.bool_], one: Located, other: Located) -> Located:
    """Return the regions of one where `which` says so, of the other elsewhere."""
    first, second = _given(one), _given(other)
    both = first.keys() & second.keys()
    return Located(**{name: np.where(which, first[name], second[name]) for name in both})


def put(some: Located, where: NDArray[np.intp], all_: Located) -> Located:
    """Return all regions with some of them replaced."""
    taken = _given(all_)
    for name in taken.keys() & _given(some).keys():
        taken[name] = taken[name].copy()
        taken[name][where] = getattr(some, name)
    return Located(**taken)


def _given(located: Located) -> dict[str, Any]:
    values = {each.name: getattr(located, each.name) for each in fields(Located)}
    return {name: value for name, value in values.items() if value is not None}
