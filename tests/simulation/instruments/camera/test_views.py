"""Rendered chessboards, detected and solved by OpenCV, against the true lens."""

import cv2
import numpy as np
import pytest

from tests.simulation.instruments.camera.scenes import camera_of, spec_of
from virtual_lab.relations.board import Board
from virtual_lab.simulation.instruments.camera.views import board_views
from virtual_lab.streams import Streams

BOARD = Board()
SIZE = (1280, 800)


def found(picture: np.ndarray, full_scale: float) -> np.ndarray | None:
    """Return the corners that OpenCV finds, (corner, 2), in OpenCV's order, or None."""
    grey = np.clip(picture * (340 / full_scale), 0, 255).astype(np.uint8)
    flags = cv2.CALIB_CB_ACCURACY
    good, corners = cv2.findChessboardCornersSB(grey, BOARD.shape, flags=flags)
    return corners.reshape(-1, 2) if good else None


def test_opencv_finds_the_corners_and_the_lens() -> None:
    """Corners to 0.06 px rms without bias, focal length to 0.02 %, scale of the plane to 1e-4."""
    cv2.setNumThreads(1)
    camera = camera_of(spec_of("camera-overhead"), Streams(1))
    lens, plane, images, flat = camera.lens, [], [], []
    for picture, places in board_views(camera, BOARD, 6, Streams(2), "views"):
        corners = found(picture, camera.spec.sensor.full_scale)
        if corners is None:
            assert plane  # tilted board: may leave the picture; the flat one (first) may not
            continue
        # order of the corners: may start at any of the four outer ones
        true = lens.to_pixels(lens.to_camera(places))
        order = np.linalg.norm(true[:, None] - corners, axis=2).argmin(axis=1)
        assert len(set(order)) == len(order)
        deviation = corners[order] - true
        assert deviation.std() < 0.06
        assert np.abs(deviation.mean(axis=0)).max() < 0.06
        plane.append(BOARD.corners().astype(np.float32))
        images.append(corners[order].astype(np.float32))
        flat.append(places)
    assert len(plane) >= 5
    guess = np.array([[2000.0, 0, 639.5], [0, 2000.0, 399.5], [0, 0, 1]])
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
    rms, matrix, bent, turns, ways = cv2.calibrateCamera(
        plane, images, SIZE, guess, np.zeros(5), flags=flags
    )
    assert rms < 0.06
    assert matrix[0, 0] == pytest.approx(lens.focal, rel=2e-4)
    assert matrix[1, 1] == pytest.approx(lens.focal, rel=2e-4)
    # distance of two points of the plane, a third of a meter apart, in the solved camera
    ends = np.array([[-0.17, 0.0, 0.0], [0.17, 0.05, 0.0]])
    middle = flat[0].mean(axis=0)
    solved = cv2.projectPoints(ends, turns[0], ways[0], matrix, bent)[0].reshape(-1, 2)
    true = lens.to_pixels(lens.to_camera(ends * [1, -1, 1] + middle))  # y axis of the board: down
    assert np.linalg.norm(np.diff(solved, axis=0)) == pytest.approx(
        np.linalg.norm(np.diff(true, axis=0)), rel=1e-4
    )
