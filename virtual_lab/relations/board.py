"""Calibration boards of cameras: chessboards, plain or with ArUco markers (ChArUco).

The axes of a board are those of OpenCV, with the origin at its center: x along the rows, y down the
columns, z into the board. The first square is black, as in OpenCV since 4.6.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array, to_si

LENGTHS = ("mm", "cm", "m", "in", "um")
SQUARE = (1e-3, 1.0)  # smallest and largest side of a square [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A calibration board, with lengths in meters. A plain chessboard has `marker` = 0."""

    columns: int = 14
    rows: int = 9
    square: float = 0.04
    marker: float = 0.0  # side of a marker with its black border
    dictionary: str = "4X4_1000"  # it contains the markers of 4X4_50, 4X4_100 and 4X4_250
    source: str = ""  # text that describes the board

    @property
    def shape(self) -> tuple[int, int]:
        """Number of inner corners per row, and number of rows of corners."""
        return self.columns - 1, self.rows - 1

    def corners(self) -> Array:
        """Return the inner corners row by row from the board's center, (corner, 3) [m]."""
        across, down = self.shape
        x, y = np.meshgrid(np.arange(across), np.arange(down))
        flat = np.stack([x - (across - 1) / 2, y - (down - 1) / 2], axis=-1)
        return np.pad(self.square * flat.reshape(-1, 2), ((0, 0), (0, 1)))

    def marker_at(self) -> NDArray[np.int_]:
        """Return the number of the marker in each square, -1 for black ones, (row, column)."""
        white = np.indices((self.rows, self.columns)).sum(axis=0) % 2 == 1
        ids = np.full(white.shape, -1)
        ids[white] = np.arange(white.sum())
        return ids


def board_of(text: str) -> Board:
    """Return the board described by a string like ``charuco:14x9:40mm:30mm``.

    The first part is the kind of board, ``charuco`` or ``chessboard``. The other parts are the
    number of squares per row and per column, the side of a square, and the side of a marker. A
    ChArUco board can have one more part, the ArUco dictionary, by default ``4X4_1000``. A
    chessboard has no marker: ``chessboard:14x9:40mm``.

    Raises
    ------
    InputError
        The text has another form, there are fewer than 4 x 3 squares, the side of a square is not
        between 1 mm and 1 m, the board is longer than 10 m, a marker is not smaller than a square,
        or the dictionary is unknown or has too few markers.
    """
    key, (kind, *parts) = "{board}", text.strip().split(":")
    charuco = kind == "charuco"
    if kind not in {"charuco", "chessboard"} or not 2 + charuco <= len(parts) <= 2 + 2 * charuco:
        form = "charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY] or chessboard:COLUMNSxROWS:SQUARE"
        raise InputError("", key, text, f"expected {form}, e.g. charuco:14x9:40mm:30mm")
    counts = re.fullmatch(r"(\d{1,3})x(\d{1,3})", parts[0])
    if not counts:
        raise InputError("", key, parts[0], "expected squares in a row x rows, e.g. 14x9")
    columns, rows = int(counts[1]), int(counts[2])
    if columns < 4 or rows < 3:
        raise InputError("", key, parts[0], "at least 4x3 squares")
    square = length_of(parts[1], key, *SQUARE)
    if max(columns, rows) * square > 10:
        raise InputError("", key, text, "a side is longer than 10 m")
    marker = length_of(parts[2], key, 0.0, square) if charuco else 0.0
    if charuco and marker >= square:
        raise InputError("", key, parts[2], f"a marker is smaller than its square, {parts[1]}")
    dictionary = parts[3].removeprefix("DICT_") if len(parts) == 4 else "4X4_1000"
    allowed = [f"{bits}X{bits}_{count}" for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)]
    if dictionary not in allowed:
        raise InputError("", key, dictionary, f"allowed: {', '.join(allowed)}")
    if charuco and columns * rows // 2 > int(dictionary.split("_")[1]):
        markers = columns * rows // 2
        raise InputError("", key, dictionary, f"the board has {markers} markers")
    return Board(
        columns=columns,
        rows=rows,
        square=square,
        marker=marker,
        dictionary=dictionary,
        source=text.strip(),
    )


def length_of(text: str, key: str, low: float, high: float) -> float:
    """Parse a length with its unit, such as ``25mm``, and return it [m].

    Raises `InputError`, which names `key`, for malformed text and for a length that is not between
    `low` and `high` [m].
    """
    match = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([a-z]+)\s*", text, re.ASCII)
    allowed = f"expected a length with its unit ({', '.join(LENGTHS)}), e.g. 25mm"
    if not match or match[2] not in LENGTHS:
        raise InputError("", key, text, allowed)
    try:
        length = to_si(float(match[1]), match[2], "length")
    except ValueError as fault:
        raise InputError("", key, text, allowed) from fault
    if not low <= length <= high:
        raise InputError("", key, text, f"allowed: {low:g} to {high:g} m")
    return length
