"""Calibration boards against OpenCV's layout, and texts that describe no board."""

import cv2
import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.relations.board import Board, board_of, length_of


@pytest.mark.parametrize("rows", [6, 7])
def test_a_board_is_laid_out_as_opencv_does(rows: int) -> None:
    """Corners are ordered by rows; markers fill the white squares in the order of their ids."""
    board = board_of(f"charuco:9x{rows}:25mm:18mm")
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
    theirs = cv2.aruco.CharucoBoard((9, rows), 0.025, 0.018, words)
    middle = np.array([4.5 * 0.025, rows / 2 * 0.025, 0.0])
    corners = theirs.getChessboardCorners() - middle
    np.testing.assert_allclose(board.corners(), corners, atol=1e-7)
    own = board.marker_at()
    for number, points in zip(theirs.getIds().ravel(), theirs.getObjPoints(), strict=True):
        column, row = (np.asarray(points).mean(axis=0)[:2] / 0.025).astype(int)
        assert own[row, column] == number
    assert own[0, 0] == -1


def test_a_board_is_read_from_its_name() -> None:
    assert board_of("chessboard:14x9:1.5in") == Board(
        columns=14, rows=9, square=pytest.approx(0.0381), source="chessboard:14x9:1.5in"
    )
    marked = board_of("charuco:5x4:3cm:20mm:DICT_5X5_100")
    assert (marked.marker, marked.dictionary) == (0.02, "5X5_100")
    assert length_of("-3mm", "--height", -1, 1) == -0.003


@pytest.mark.parametrize(
    ("text", "metres"),
    [("73mm", 0.073), ("7.3 cm", 0.073), (".073m", 0.073), ("2.875in", 0.073025)],
)
def test_lengths_are_read_with_their_units(text: str, metres: float) -> None:
    assert length_of(text, "--ball", 0, 1) == pytest.approx(metres)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("checker:9x6:25mm", "expected charuco:"),
        ("charuco:9x6:25mm", "expected charuco:"),
        ("chessboard:9x6:25mm:18mm", "expected charuco:"),
        ("chessboard:9,6:25mm", "squares in a row x rows"),
        ("chessboard:3x3:25mm", "at least 4x3"),
        ("chessboard:9x6:25", "a length with its unit"),
        ("chessboard:9x6:0mm", "0.001 to 1 m"),
        ("chessboard:9x6:-5mm", "0.001 to 1 m"),
        ("chessboard:9x6:2.5.1mm", "a length with its unit"),
        ("chessboard:14x9:40m", "0.001 to 1 m"),
        ("chessboard:999x999:40mm", "longer than 10 m"),
        ("charuco:9x6:25mm:25mm", "smaller than its square"),
        ("charuco:9x6:25mm:18mm:9X9_50", "allowed: 4X4_50"),
        ("charuco:14x9:25mm:18mm:5X5_50", "the board has 63 markers"),
    ],
)
def test_an_invalid_board_is_refused(text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        board_of(text)
    assert words in str(caught.value)
