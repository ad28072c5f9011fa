"""Boards drawn by OpenCV and placed in a picture by a known homography, without our renderer."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.relations.board import board_of
from virtual_lab.video.calibration.board_finding import BoardView, find_board

SQUARE = 160  # pixels of the drawing per square
LAID = np.array([[0.24, 0.03, 60.0], [-0.02, 0.26, 70.0], [2e-5, 3e-5, 1.0]])
SIZE = (680, 480)


def drawn(columns: int, rows: int, marker: float, *, legacy: bool = False) -> NDArray[np.uint8]:
    """Return OpenCV's picture of a board with squares of about 38 pixels, blurred by 0.7 pixels."""
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
    board = cv2.aruco.CharucoBoard((columns, rows), 1.0, marker, words)
    board.setLegacyPattern(legacy)
    sheet = board.generateImage((columns * SQUARE, rows * SQUARE))
    sheet = cv2.copyMakeBorder(sheet, 80, 80, 80, 80, cv2.BORDER_CONSTANT, value=255)
    soft = cv2.GaussianBlur(sheet, (0, 0), 0.7 * 4)
    move = np.array([[1.0, 0, -80], [0, 1, -80], [0, 0, 1]])
    return cv2.warpPerspective(soft, LAID @ move, SIZE, flags=cv2.INTER_CUBIC, borderValue=128)


def true_places(columns: int, rows: int) -> NDArray[np.float64]:
    """Return the inner corners in the picture, row by row."""
    x, y = np.meshgrid(np.arange(1, columns), np.arange(1, rows))
    flat = np.stack([x.ravel(), y.ravel()], axis=1) * SQUARE - 0.5
    return cv2.perspectiveTransform(flat[None].astype(float), LAID)[0]


def off(view: BoardView | None, columns: int, rows: int) -> NDArray[np.float64]:
    assert view is not None
    return view.places - true_places(columns, rows)[view.ids]


@pytest.mark.parametrize("legacy", [False, True])
def test_a_board_drawn_by_opencv_is_found_in_place(legacy: bool) -> None:
    """The board has an even number of rows; its first square is black or, as before 4.6, white."""
    view = find_board(drawn(14, 8, 0.72, legacy=legacy), board_of("charuco:14x8:40mm:28.8mm"))
    error = off(view, 14, 8)
    assert len(error) == 91
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.abs(error).max() < 0.08


def test_part_of_a_board_is_found_in_uneven_light_and_jpeg() -> None:
    """The board's right side is cut off, light falls by half, and the picture is a noisy JPEG."""
    picture = drawn(14, 9, 0.72)[:, :400]
    light = np.linspace(1.0, 0.5, 400)
    noise = np.random.default_rng(3).normal(0, 2, picture.shape)
    dim = np.clip(picture * light + noise, 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", dim, [cv2.IMWRITE_JPEG_QUALITY, 90])
    view = find_board(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), board_of("charuco:14x9:1cm:7.2mm"))
    error = off(view, 14, 9)
    assert 50 < len(error) < 104
    assert np.sqrt(np.mean(error**2)) < 0.04


def test_another_board_is_not_found() -> None:
    """A board with more squares, another dictionary, or no markers is not taken for this one."""
    picture = drawn(9, 6, 0.72)
    assert find_board(picture, board_of("charuco:9x6:1m:0.72m:6X6_50")) is None
    assert find_board(picture, board_of("chessboard:10x6:1m")) is None
    view = find_board(picture, board_of("chessboard:9x6:1m"))
    assert view is None or len(view.ids) == 40
