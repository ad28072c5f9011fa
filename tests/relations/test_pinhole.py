"""The lens model against OpenCV's, and its inverse."""

import cv2
import numpy as np
import pytest

from virtual_lab.relations.pinhole import distort, looking_down, undistort

LENSES = [
    [-0.03, 0.02, 1e-4, -2e-4, 0.0],
    [0.08, -0.05, 5e-4, 3e-4, 0.01],
    [0.0, 0.0, 0.0, 0.0, 0.0],
]
PLACES = np.stack(np.meshgrid(np.linspace(-0.35, 0.35, 15), np.linspace(-0.25, 0.25, 11)), axis=-1)


@pytest.mark.parametrize("lens", LENSES)
def test_undistorted_undoes_distorted(lens: list[float]) -> None:
    """The inverse holds to 1e-9 for pictures up to 40 degrees wide."""
    assert np.abs(undistort(distort(PLACES, lens), lens) - PLACES).max() < 1e-9


@pytest.mark.parametrize("lens", LENSES)
def test_opencv_draws_what_was_undistorted_where_it_was(lens: list[float]) -> None:
    """`cv2.projectPoints` of the points found, at z = 1: the points given, to 1e-9."""
    flat = undistort(PLACES, lens).reshape(-1, 2)
    points = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    still = np.zeros(3)
    drawn = cv2.projectPoints(points, still, still, np.eye(3), np.array(lens))[0]
    assert np.abs(drawn.reshape(PLACES.shape) - PLACES).max() < 1e-9


def test_constants_may_be_columns() -> None:
    """Several lenses at once, as in an uncertainty budget."""
    columns = [np.array(values)[:, None] for values in zip(*LENSES, strict=True)]
    row = PLACES.reshape(-1, 2)
    both = undistort(np.broadcast_to(row, (len(LENSES), *row.shape)), columns)
    for lens, found in zip(LENSES, both, strict=True):
        assert found == pytest.approx(undistort(row, lens), abs=1e-15)


def test_looking_down_turns_y_up_and_z_to_the_camera() -> None:
    """Without tilt, X points right, Y up (OpenCV's y points down) and Z toward the camera."""
    assert np.array_equal(looking_down(np.zeros(3)), np.diag([1.0, -1.0, -1.0]))
    several = looking_down(np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.3]]))
    assert several.shape == (2, 3, 3)
    assert np.linalg.det(several) == pytest.approx([1.0, 1.0])
