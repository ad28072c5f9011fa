"""The true lens against OpenCV's projection and against closed forms of a sphere's outline."""

import cv2
import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.relations.pinhole import rotation
from virtual_lab.simulation.instruments.camera.ball import render_balls
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.lens import TrueLens
from virtual_lab.simulation.instruments.camera.spec import BallLook, CameraSpec
from virtual_lab.streams import Quiet, Streams

SPEC = catalog.load("instruments", "camera-side-lit", CameraSpec).spec
BARE = TrueLens(
    focal=2000.0,
    centre=np.array([640.0, 400.0]),
    distortion=np.zeros(5),
    tilt=np.zeros(3),
    place=np.array([0.0, 0.0, 2.0]),
)
PLAIN = BallLook(albedo=1.0, seam_contrast=0.0)


def test_the_projection_agrees_with_opencv() -> None:
    """`cv2.projectPoints` with the same pose and distortion agrees to 1e-9 px."""
    lens = Camera.commission(SPEC, Streams(1), "lens").lens
    points = Streams(2).uniform("points", (50, 3)) * [0.8, 0.5, 0.2]
    turn = cv2.Rodrigues(lens.rotation)[0]
    matrix = np.array([[lens.focal, 0, lens.centre[0]], [0, lens.focal, lens.centre[1]], [0, 0, 1]])
    translation = -lens.rotation @ lens.place
    theirs = cv2.projectPoints(points, turn, translation, matrix, lens.distortion)[0].reshape(-1, 2)
    assert np.abs(lens.to_pixels(lens.to_camera(points)) - theirs).max() < 1e-9
    assert np.abs(rotation(turn.ravel()) - lens.rotation).max() < 1e-12


def test_x_runs_right_and_y_up() -> None:
    """Seen from above, the ball flies to the right and the tip of the bat is at the top."""
    lens = Camera.commission(SPEC, Quiet(), "lens").lens
    origin, ahead, tip = lens.to_pixels(lens.to_camera([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]))
    assert ahead[0] - origin[0] > 50
    assert tip[1] - origin[1] < -50


@pytest.mark.parametrize("x", [0.0, 0.3, 0.6])
def test_the_outline_of_a_sphere_agrees_with_its_tangents(x: float) -> None:
    """Center and both half axes from the tangents of the pinhole, at α ± asin(r/D)."""
    radius, depth = 0.0365, 2.0
    far = np.hypot(x, depth)
    alpha, beta = np.arctan2(x, depth), np.arcsin(radius / far)
    ends = 2000 * np.tan([alpha - beta, alpha + beta])
    outline = BARE.outlines([[x, 0.0, 0.0]], radius)
    assert outline.middle[0] == pytest.approx([640 + ends.mean(), 400], abs=1e-4)
    assert outline.centre[0] == pytest.approx([640 + 2000 * x / depth, 400], abs=1e-9)
    # center of the outline: x/(1 - r²/Z²)
    off_centre = (ends.mean() - 2000 * x / depth) / max(2000 * x / depth, 1e-9)
    if x:
        assert off_centre == pytest.approx(radius**2 / depth**2, rel=1e-3)
    assert outline.warp[0, 0, 0] == pytest.approx((ends[1] - ends[0]) / 2, rel=1e-5)
    # half axis across: f r / sqrt(Z² - r²)
    assert outline.warp[0, 1, 1] == pytest.approx(2000 * radius / np.sqrt(4 - radius**2), rel=1e-5)


def test_a_rendered_sphere_lies_where_its_outline_is() -> None:
    """The cover of a ball far off the axis of a distorted lens is that of its traced rim.

    The oracle is the area and centroid of the polygon through 720 projected tangent points.
    """
    lens = Camera.commission(SPEC, Streams(3), "lens").lens
    centre, radius = np.array([[0.22, 0.28, 0.01]]), 0.0365
    outline = lens.outlines(centre, radius)
    place = lens.to_camera(centre)[0]
    far = np.linalg.norm(place)
    axis = place / far
    side = np.cross(axis, [0.3, 0.5, -0.2])
    side /= np.linalg.norm(side)
    angle = np.arange(720)[:, None] * np.pi / 360
    rim = np.cos(angle) * side + np.sin(angle) * np.cross(axis, side)
    # tangent points: a circle nearer than the center
    sine = radius / far
    points = place * (1 - sine**2) + radius * np.sqrt(1 - sine**2) * rim
    px, py = lens.to_pixels(points).T
    cross = px * np.roll(py, -1) - np.roll(px, -1) * py
    area = cross.sum() / 2
    x = ((px + np.roll(px, -1)) * cross).sum() / 6 / area
    y = ((py + np.roll(py, -1)) * cross).sum() / 6 / area
    corner = np.rint(outline.centre - 50)
    ball = render_balls(
        outline.centre[:, None], 1.0, corner, (101, 101), sigma=0.64, look=PLAIN, warp=outline.warp
    )
    cover = ball.cover[0].astype(float)
    total = cover.sum()
    assert total == pytest.approx(abs(area), rel=2e-4)
    assert corner[0, 0] + cover.sum(axis=0) @ np.arange(101) / total == pytest.approx(x, abs=1e-3)
    assert corner[0, 1] + cover.sum(axis=1) @ np.arange(101) / total == pytest.approx(y, abs=1e-3)
    assert np.hypot(x - outline.centre[0, 0], y - outline.centre[0, 1]) > 0.05
    assert outline.middle[0] == pytest.approx([x, y], abs=5e-3)
