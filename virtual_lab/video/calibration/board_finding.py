"""A calibration board in a picture: OpenCV finds its corners, a fit to their pixels places them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.board import Board
from virtual_lab.video.calibration.corners import fit_crossings

__all__ = ["BoardView", "find_board"]

Array = NDArray[np.float64]

LEAST = 8  # corners that show where a board is
BRIGHT = 99.9  # per cent of the pixels: what is brighter is a glint


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardView:
    """A board's corners in one picture."""

    ids: NDArray[np.intp]  # which of `Board.corners` they are, (corner,)
    places: Array  # (corner, 2) [pixels]
    u: Array  # (corner,) from the pixels' noise, each way


def find_board(picture: NDArray[Any], board: Board) -> BoardView | None:
    """Return a board's corners in a grey picture; None where there are not enough.

    A chessboard must be seen whole, of a board with markers any part. One whose first square is
    white, as OpenCV printed those of an even number of rows before 4.6, is found too.
    """
    grey = picture.astype(np.float32)
    dark, bright = float(grey.min()), float(np.percentile(grey, BRIGHT))
    if bright <= dark:
        return None
    plain = np.clip((grey - dark) * (255 / (bright - dark)), 0, 255).astype(np.uint8)
    ids, places = _charuco(plain, board) if board.marker else _chessboard(plain, board)
    if len(ids) < LEAST:
        return None
    along, down = _steps(ids, places, board)
    clear = (1 - board.marker / board.square) / 2 if board.marker else 0.5
    fitted = fit_crossings(grey, places, along, down, clear)
    good = np.isfinite(fitted.u)
    if good.sum() < LEAST:
        return None
    return BoardView(ids=ids[good], places=fitted.places[good], u=fitted.u[good])


def _chessboard(plain: NDArray[np.uint8], board: Board) -> tuple[NDArray[np.intp], Array]:
    import cv2

    # where the light is even, a picture made flat is found less often than the picture itself
    for flags in (0, cv2.CALIB_CB_NORMALIZE_IMAGE):
        found, corners = cv2.findChessboardCornersSB(plain, board.shape, flags=flags)
        if found:
            places = np.asarray(corners, np.float64).reshape(-1, 2)
            return np.arange(len(places)), places
    return np.empty(0, np.intp), np.empty((0, 2))


def _charuco(plain: NDArray[np.uint8], board: Board) -> tuple[NDArray[np.intp], Array]:
    from cv2 import aruco

    words = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{board.dictionary}"))
    ids, places = np.empty(0, np.intp), np.empty((0, 2))
    for legacy in (False, True)[: 2 - board.rows % 2]:
        pattern = aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, words)
        pattern.setLegacyPattern(legacy)
        corners, numbers, _, _ = aruco.CharucoDetector(pattern).detectBoard(plain)
        if numbers is not None and len(numbers) > len(ids):
            ids = np.asarray(numbers, np.intp).ravel()
            places = np.asarray(corners, np.float64).reshape(-1, 2)
    return ids, places


def _steps(ids: NDArray[np.intp], places: Array, board: Board) -> tuple[Array, Array]:
    """Return how far the next corners along rows and columns are, (corner, 2) each [pixels]."""
    import cv2

    flat = board.corners()[:, :2] / board.square
    matrix, _ = cv2.findHomography(flat[ids], places)

    def at(points: Array) -> Array:
        return np.asarray(cv2.perspectiveTransform(points[None], matrix)[0])

    half = np.array([[0.5, 0.0], [0.0, 0.5]])
    along, down = (at(flat[ids] + each) - at(flat[ids] - each) for each in half)
    return along, down
