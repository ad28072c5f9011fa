"""Conversion of pixels to meters, compared with OpenCV's projection from meters to pixels."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.calibration.plane import plane_of
from virtual_lab.video.clips.calibration_file import CameraModel, ClipCalibration
from virtual_lab.video.locate.located import Located, PlaceFlag

Array = NDArray[np.float64]

CAMERA = CameraModel(
    image_size=(1280, 800),
    matrix=((1800.0, 0.0, 645.0), (0.0, 1795.0, 402.0), (0.0, 0.0, 1.0)),
    distortion=(-0.12, 0.05, 0.001, -0.0005, 0.0),
    rotation=(3.0, 0.1, 0.05),
    translation_m=(0.05, -0.02, 2.0),
    plane_height_m=0.03,
    relative_scale_u=2e-4,
)


def located(x: Array, y: Array, radius: float = 30.0, flags: int = 0) -> Located:
    start = Located.start(np.stack([x, y], axis=1), radius, np.zeros(2))
    return replace(start, flags=start.flags + np.uint16(flags), pattern_u=np.zeros(len(x)))


def test_a_slanted_camera_gives_positions_in_the_plane() -> None:
    rng = np.random.default_rng(5)
    world = np.column_stack(
        [rng.uniform(-0.4, 0.4, 20), rng.uniform(-0.25, 0.25, 20), np.full(20, 0.03)]
    )
    pixels, _ = cv2.projectPoints(
        world,
        np.array(CAMERA.rotation),
        np.array(CAMERA.translation_m),
        np.array(CAMERA.matrix),
        np.array(CAMERA.distortion),
    )
    x, y = pixels[:, 0].T
    plane = plane_of(located(x, y), ClipCalibration(camera=CAMERA), "clip")
    np.testing.assert_allclose(plane.places, world[:, :2], atol=2e-6)
    assert (plane.source, plane.relative_u) == ("camera", 2e-4)
    assert plane.metres_per_pixel == pytest.approx(2.0 / 1800, rel=0.05)


def test_a_spheres_outline_lies_farther_out_than_its_centre() -> None:
    """The outline of a sphere, drawn ray by ray, is corrected to the sphere's center."""
    straight = CameraModel(
        image_size=(1280, 800),
        matrix=((1800.0, 0.0, 640.0), (0.0, 1800.0, 400.0), (0.0, 0.0, 1.0)),
        distortion=(0.0, 0.0, 0.0, 0.0),
        rotation=(0.0, 0.0, 0.0),
        translation_m=(0.0, 0.0, 2.0),
    )
    radius, centre = 0.0365, np.array([0.6, 0.1, 2.0])
    # tangent cone: unit rays at the half angle asin(r/d) about the center's direction
    away = float(np.linalg.norm(centre))
    axis = centre / away
    side = np.cross(axis, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    turn = np.linspace(0, 2 * np.pi, 3601)[:-1, None]
    half = np.arcsin(radius / away)
    rays = np.cos(half) * axis + np.sin(half) * (np.cos(turn) * side + np.sin(turn) * other)
    outline = 1800 * rays[:, :2] / rays[:, 2:] + [640, 400]
    wide, narrow = outline[:, 0], outline[:, 1]
    x = np.array([(wide.max() + wide.min()) / 2])
    y = np.array([(narrow.max() + narrow.min()) / 2])
    calibration = ClipCalibration(camera=straight, ball_diameter_m=2 * radius)
    corrected = plane_of(located(x, y), calibration, "clip").places[0]
    plain = plane_of(located(x, y), ClipCalibration(camera=straight), "clip").places[0]
    np.testing.assert_allclose(corrected, centre[:2], atol=2e-6)
    assert plain[0] - centre[0] > 1e-4


def test_the_ball_sets_the_scale_where_nothing_else_does() -> None:
    x = np.arange(5.0)
    calibration = ClipCalibration(ball_diameter_m=0.06, ball_diameter_m_u=6e-5)
    plane = plane_of(located(x, x), calibration, "clip")
    assert plane.metres_per_pixel == pytest.approx(1e-3)
    assert plane.relative_u == pytest.approx(np.hypot(1e-3, 0.05 / 30))
    with pytest.raises(InputError, match="no frame shows the whole ball"):
        plane_of(located(x, x, flags=PlaceFlag.CLIPPED), calibration, "clip")
    sized = ClipCalibration(metres_per_pixel=2e-3, metres_per_pixel_u=4e-6, ball_diameter_m=0.06)
    by_scale = plane_of(located(x, x), sized, "clip")
    assert (by_scale.metres_per_pixel, by_scale.relative_u, by_scale.source) == (
        2e-3,
        2e-3,
        "given",
    )


def test_the_size_of_a_ball_follows_its_outline_across_the_picture() -> None:
    """Outlines of equal spheres in the plane, projected by OpenCV, give the sizes within 2e-4."""
    rotation = cv2.Rodrigues(np.array(CAMERA.rotation))[0]
    shift = np.array(CAMERA.translation_m)
    world = np.array([[x, y, 0.03] for x in (-0.5, -0.2, 0.1, 0.4) for y in (-0.25, 0.0, 0.25)])
    turn = np.linspace(0, 2 * np.pi, 721)[:-1]
    middles, areas = [], []
    for centre in world @ rotation.T + shift:
        far = np.linalg.norm(centre)
        way = centre / far
        first = np.cross(way, [0.0, 1.0, 0.0])
        first /= np.linalg.norm(first)
        second = np.cross(way, first)
        opening = 0.01 / np.sqrt(far**2 - 0.01**2)
        rim = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
        still = np.zeros(3)
        drawn = cv2.projectPoints(
            way + opening * rim, still, still, np.array(CAMERA.matrix), np.array(CAMERA.distortion)
        )[0][:, 0]
        x, y = drawn.T
        areas.append(abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2)
        middles.append(drawn.mean(axis=0))
    plane = plane_of(located(*np.transpose(middles)), ClipCalibration(camera=CAMERA), "clip")
    radius = np.sqrt(areas)
    assert np.ptp(radius) / np.median(radius) > 0.05
    assert plane.sizes == pytest.approx(radius / np.median(radius), rel=2e-4)
