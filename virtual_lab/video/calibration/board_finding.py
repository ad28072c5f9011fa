"""Detection of a calibration board in a picture, and location of its corners, by OpenCV."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.board import Board
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardView:
    """A board's corners in one picture."""

    ids: NDArray[np.intp]  # indices into `Board.corners`, (corner,)
    places: Array  # (corner, 2) [pixels]


def find_board(picture: NDArray[Any], board: Board) -> BoardView | None:
    """Return the corners of a board in a gray picture; None if fewer than eight are found.

    A chessboard must be completely visible. A board with markers may be partly hidden. Its first
    square may be black or white: OpenCV before 4.6 printed a white one if the number of rows was
    even.
    """
    grey = picture.astype(np.float32)
    # gray levels above the 99.9th percentile are glints
    dark, bright = float(grey.min()), float(np.percentile(grey, 99.9))
    if bright <= dark:
        return None
    plain = np.clip((grey - dark) * (255 / (bright - dark)), 0, 255).astype(np.uint8)
    ids, places = _charuco(plain, board) if board.marker else _chessboard(plain, board)
    if len(ids) < 8:
        return None
    side = float(np.median(np.hypot(*(places[1:] - places[:-1])[np.diff(ids) == 1].T)))
    clear = (1 - board.marker / board.square) / 2 if board.marker else 0.5
    # half width of the window in which a corner is refined [pixels]. The window ends one pixel
    # before the markers. With more than five pixels the errors of 0.024 pixels do not become
    # smaller, and the window contains markers and neighboring corners.
    reach = int(np.clip(clear * side - 1.0, 2, 5))
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    start = places.astype(np.float32)
    placed = cv2.cornerSubPix(plain, start, (reach, reach), (-1, -1), stop)
    return BoardView(ids=ids, places=np.asarray(placed, np.float64).reshape(-1, 2))


def _chessboard(plain: NDArray[np.uint8], board: Board) -> tuple[NDArray[np.intp], Array]:
    # The unchanged picture is tried first, because in even light OpenCV finds a board in it more
    # often than in a normalized picture.
    for flags in (0, cv2.CALIB_CB_NORMALIZE_IMAGE):
        success, corners = cv2.findChessboardCornersSB(plain, board.shape, flags=flags)
        if success:
            lines = np.asarray(corners, np.float64).reshape(*board.shape[::-1], 2)
            bend = max(np.abs(np.diff(lines, 2, axis=axis)).max() for axis in (0, 1))
            # If the board has one column less than assumed, OpenCV adds a false column beside it, a
            # quarter of a square off. The spacing of true corners changes less along a line.
            if bend < 0.15 * np.hypot(*np.diff(lines, axis=1).reshape(-1, 2).T).mean():
                return np.arange(lines.size // 2), lines.reshape(-1, 2)
    return np.empty(0, np.intp), np.empty((0, 2))


def _charuco(plain: NDArray[np.uint8], board: Board) -> tuple[NDArray[np.intp], Array]:
    from cv2 import aruco

    words = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{board.dictionary}"))
    ids, places = np.empty(0, np.intp), np.empty((0, 2))
    markers = marked = None  # the second pattern has the same markers
    for legacy in (False, True)[: 2 - board.rows % 2]:
        pattern = aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, words)
        pattern.setLegacyPattern(legacy)
        find = aruco.CharucoDetector(pattern).detectBoard
        corners, numbers, markers, marked = find(plain, None, None, markers, marked)
        if numbers is not None and len(numbers) > len(ids):
            ids = np.asarray(numbers, np.intp).ravel()
            places = np.asarray(corners, np.float64).reshape(-1, 2)
    return ids, places
