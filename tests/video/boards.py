"""Views of boards by a camera with a known lens: noisy corners, and rendered pictures."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulation.instruments.camera.scenes import camera_of, spec_of
from virtual_lab.relations.board import Board
from virtual_lab.relations.pinhole import rotation
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.lens import TrueLens
from virtual_lab.simulation.instruments.camera.views import board_views
from virtual_lab.streams import Streams
from virtual_lab.video.calibration.board_finding import BoardView
from virtual_lab.video.clips.calibration_file import CameraModel

Array = NDArray[np.float64]
SIZE = (1280, 800)
DOWN = np.diag([1.0, -1.0, -1.0])


def camera_with(seed: int) -> Camera:
    """Return a camera of the catalog with a randomly drawn lens."""
    return camera_of(spec_of("camera-overhead"), Streams(seed))


def small_camera(seed: int) -> Camera:
    """Return a camera with a quarter of the pixels, each twice as large, which renders quickly."""
    spec = spec_of("camera-overhead", window=64)
    sensor = replace(spec.sensor, columns=640, rows=400, pixel=2 * spec.sensor.pixel)
    lens = replace(spec.lens, blur=2 * spec.lens.blur)
    return camera_of(replace(spec, sensor=sensor, lens=lens), Streams(seed))


def corners_seen(
    lens: TrueLens, board: Board, views: int, seed: int, noise: float, lean: float = 0.6
) -> list[BoardView]:
    """Return the corners in each view as the lens draws them, plus noise; view 0 is flat."""
    draws, corners = Streams(seed), []
    turns, off = draws.uniform("turns", (views, 3)), draws.uniform("off", (views, 3))
    for view in range(views):
        turned = rotation((view > 0) * 2 * lean * turns[view]) @ DOWN
        place = [*lens.place[:2], 0.0] + (view > 0) * np.array([0.25, 0.25, 0.35]) * off[view]
        drawn = lens.to_pixels(lens.to_camera(board.corners() @ turned.T + place))
        ids = np.flatnonzero(((drawn > 5) & (drawn < np.array(SIZE) - 6)).all(axis=1))
        places = drawn[ids] + noise * draws.normal(f"noise {view}", (len(ids), 2))
        corners.append(BoardView(ids=ids, places=places))
    return corners


def pictures_of(camera: Camera, board: Board, views: int, seed: int) -> list[tuple[str, Array]]:
    """Return rendered pictures of the board with their names, which are numbers."""
    rendered = board_views(camera, board, views, Streams(seed), "board")
    return [(f"{number}.png", picture) for number, (picture, _) in enumerate(rendered)]


def true_model(lens: TrueLens, model: CameraModel) -> CameraModel:
    """Return the model of a perfect calibration. Its axes start at the point under the camera."""
    shift = lens.to_camera([*lens.place[:2], 0.0])
    turn = cv2.Rodrigues(lens.rotation @ DOWN)[0].ravel()
    return replace(
        model,
        matrix=((lens.focal, 0.0, lens.centre[0]), (0.0, lens.focal, lens.centre[1]), (0, 0, 1)),
        distortion=tuple(lens.distortion),
        rotation=tuple(turn),
        translation_m=tuple(shift),
    )
