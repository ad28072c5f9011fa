"""Calibrated cameras against true lenses: errors over stated uncertainties, and bad pictures."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.video.boards import (
    SIZE,
    camera_with,
    corners_seen,
    pictures_of,
    small_camera,
    true_model,
)
from tests.video.calibration.test_plane import located
from virtual_lab.errors import InputError
from virtual_lab.relations.board import Board, board_of
from virtual_lab.simulation.instruments.camera.views import board_views
from virtual_lab.streams import Streams
from virtual_lab.video.calibration import calibrating
from virtual_lab.video.calibration.board_finding import BoardView, find_board
from virtual_lab.video.calibration.calibrating import (
    Calibrated,
    Plan,
    calibrate_camera,
    lengths_of,
)
from virtual_lab.video.calibration.lens_blur import lens_blur_of
from virtual_lab.video.calibration.plane import plane_of
from virtual_lab.video.clips.calibration_file import read_calibration
from virtual_lab.video.show.calibration import calibration_toml

BOARD = board_of("charuco:14x9:40mm:30mm")
SMALL = board_of("charuco:9x6:60mm:44mm")
NOISE = 0.01  # standard deviation of a corner [pixels]


def plan_of(board: Board = BOARD, height: float = 0.0, **options: Any) -> Plan:
    return Plan(board=board, height=height, **{"square_u": 0.0, "height_u": 0.0} | options)


def calibrated(
    monkeypatch: pytest.MonkeyPatch, views: list[BoardView], plan: Plan | None = None
) -> Calibrated:
    """Return the calibration from these corners; no picture is searched, and the blur is 0.7 px."""
    waiting: Iterator[BoardView] = iter(views)
    monkeypatch.setattr(calibrating, "find_board", lambda *_: next(waiting))
    monkeypatch.setattr(calibrating, "lens_blur_of", lambda *_: 0.7)
    names = (f"{number}.png" for number in range(len(views)))
    blank = np.zeros(SIZE[::-1], np.uint8)
    return calibrate_camera(((name, blank) for name in names), plan or plan_of())


@pytest.mark.parametrize("name", ["charuco:14x9:40mm:30mm", "chessboard:14x9:40mm"])
def test_corners_are_located_well_below_a_pixel(name: str) -> None:
    """The 104 corners are right within a thirtieth of a pixel (rms), without a common shift."""
    cv2.setNumThreads(1)
    board, camera = board_of(name), camera_with(1)
    picture, corners = next(board_views(camera, board, 1, Streams(2), "views"))
    view = find_board(picture, board)
    assert view is not None
    assert len(view.ids) == 104
    true = camera.lens.to_pixels(camera.lens.to_camera(corners))
    # nearest corners, because a bare chessboard does not show which of its ends is the first
    order = np.linalg.norm(true[None] - view.places[:, None], axis=2).argmin(axis=1)
    assert not board.marker or np.array_equal(order, view.ids)
    off = view.places - true[order]
    assert np.sqrt(np.mean(off**2)) < 0.03
    assert lens_blur_of(picture, view, board) == pytest.approx(camera.spec.blur, rel=0.02)
    assert np.abs(off.mean(axis=0)).max() < 0.004


def test_errors_are_as_large_as_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """For 40 lenses and Gaussian noise, each z-score has variance 1 within 4 standard errors."""
    scores, errors = [], []
    for seed in range(40):
        lens = camera_with(seed).lens
        result = calibrated(monkeypatch, corners_seen(lens, BOARD, 6, seed + 100, NOISE))
        fit, model = result.model.fit, result.model
        assert fit is not None
        true = true_model(lens, model)
        relative = lengths_of(model) / lengths_of(true) - 1
        turn = (
            cv2.Rodrigues(np.array(model.rotation))[0] @ cv2.Rodrigues(np.array(true.rotation))[0].T
        )
        off = np.array(model.matrix)[[0, 1, 0, 1], [0, 1, 2, 2]] - [
            lens.focal,
            lens.focal,
            *lens.centre,
        ]
        shift = np.array(model.translation_m) - true.translation_m
        u = np.array([*fit.focal_u_px, *fit.centre_u_px])
        scores.append(
            np.concatenate(
                [
                    off / u,
                    relative / result.length_u,
                    cv2.Rodrigues(turn)[0].ravel() / fit.rotation_u,
                    shift / np.array(fit.translation_u_m),
                ]
            )
        )
        errors.append(relative)
    squares = np.mean(np.square(scores), axis=0)
    bound = 4 * np.sqrt(2 / 40)
    assert np.all(np.abs(squares - 1) < bound), squares
    assert np.sqrt(np.mean(np.square(errors))) < 1.5e-5  # 0.0015 % of a length


def test_rendered_pictures_give_the_true_lens() -> None:
    """Rendered pictures give the lens within 5 stated u, and lengths within 0.02 %."""
    cv2.setNumThreads(1)
    camera = small_camera(4)
    result = calibrate_camera(pictures_of(camera, SMALL, 6, 5), plan_of(board=SMALL))
    model, lens = result.model, camera.lens
    assert model.fit is not None
    assert (model.fit.views, len(result.warnings)) == (6, 3), result.warnings
    assert abs(model.matrix[0][0] - lens.focal) < 5 * model.fit.focal_u_px[0] < 8e-3 * lens.focal
    relative = lengths_of(model) / lengths_of(true_model(lens, model)) - 1
    assert np.all(np.abs(relative) < 4 * result.length_u)
    assert result.length_u.max() < 1.5e-4
    assert model.fit.rms_px < 0.04
    assert result.lens_blur == pytest.approx(camera.spec.blur, rel=0.02)


def test_track_reads_what_calibrate_writes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The true lens draws points 30 mm above the board; the calibration file gives them back."""
    lens = camera_with(7).lens
    plan = plan_of(board=BOARD, square_u=2e-6, height=0.03, height_u=0.001)
    result = calibrated(monkeypatch, corners_seen(lens, BOARD, 8, 8, 1e-4), plan)
    path = tmp_path / "cal.toml"
    path.write_text("frames_per_second = 5000\n" + calibration_toml(result))
    calibration = read_calibration(path)
    assert calibration.camera == result.model
    assert calibration.lens_blur_px == pytest.approx(result.lens_blur, rel=0.01)
    ends = np.array([[-0.2, 0.0, 0.03], [0.2, 0.1, 0.03]])
    ends[:, :2] += lens.place[:2]
    x, y = lens.to_pixels(lens.to_camera(ends)).T
    plane = plane_of(located(x, y), calibration, "clip")
    off = plane.places * [1, -1] - (ends - lens.place)[:, :2]  # sign of Y: down in the file
    np.testing.assert_allclose(off, 0, atol=2e-6)
    above = lens.place[2] - 0.03
    relative_u = np.hypot(result.length_u.max(), 2e-6 / 0.04)
    assert plane.relative_u == pytest.approx(np.hypot(relative_u, 0.001 / above), rel=1e-4)
    assert plane.relative_u == pytest.approx(5.1e-4, rel=0.02)


@pytest.mark.parametrize(
    ("views_of", "words"),
    [
        (
            lambda lens: corners_seen(lens, BOARD, 2, 1, NOISE),
            "at least 3 pictures must show the board",
        ),
        (lambda lens: corners_seen(lens, BOARD, 6, 1, NOISE, lean=0.0), "tilted by about 30 deg"),
        (lambda lens: corners_seen(lens, BOARD, 6, 1, 4.0), "residuals, pixels"),
        (lambda lens: corners_seen(lens, BOARD, 6, 1, 1.0, lean=0.14), "focal length"),
    ],
)
def test_views_with_too_little_information_are_refused(
    views_of, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=words):
        calibrated(monkeypatch, views_of(camera_with(1).lens))


def test_a_view_that_does_not_fit_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Single wild corners are left out and counted, and a picture of a bent board is named."""
    lens = camera_with(1).lens
    views = corners_seen(lens, BOARD, 7, 1, NOISE)
    wild = views[1].places.copy()
    wild[3] += 5.0
    views[1] = replace(views[1], places=wild)
    result = calibrated(monkeypatch, views)
    assert "1.png: corners with large residuals were left out, 1 in all" in result.warnings
    assert abs(result.model.matrix[0][0] - lens.focal) < 5 * result.solved.u[0]
    shaken = corners_seen(lens, BOARD, 7, 1, NOISE)
    x = BOARD.corners()[shaken[4].ids, 0]
    bent = shaken[4].places + np.outer(np.cos(20 * x), [0.3, 0.2])
    shaken[4] = replace(shaken[4], places=bent)
    result = calibrated(monkeypatch, shaken)
    assert any(each.startswith("4.png: corners with large residuals") for each in result.warnings)
    assert np.array_equal(np.flatnonzero(result.solved.left_out), [4])


def test_a_wide_lens_keeps_its_sixth_power(monkeypatch: pytest.MonkeyPatch) -> None:
    """The coefficient k3 is fitted if the corners show it, and is 0 otherwise."""
    lens = replace(camera_with(1).lens, focal=900.0, distortion=np.array([-0.2, 0.1, 0, 0, -0.15]))
    lens = replace(lens, place=lens.place * [1, 1, 0.45])
    wide = calibrated(monkeypatch, corners_seen(lens, BOARD, 8, 3, NOISE, lean=0.4))
    assert wide.model.distortion[4] == pytest.approx(-0.15, abs=5 * wide.solved.u[8])
    narrow = calibrated(monkeypatch, corners_seen(camera_with(1).lens, BOARD, 8, 3, NOISE))
    assert narrow.model.distortion[4] == 0.0


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_axes_run_with_the_picture_however_the_board_lies(
    turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """X points to the right and Y down, whichever corner of the board is the first."""
    lens = camera_with(1).lens
    board = board_of("chessboard:11x11:40mm")
    views = corners_seen(lens, board, 6, 3, 1e-4)
    order = np.rot90(np.arange(100).reshape(10, 10), turns).ravel()
    views = [replace(each, ids=order[each.ids]) for each in views]
    result = calibrated(monkeypatch, views, plan_of(board=board))
    axes = cv2.Rodrigues(np.array(result.model.rotation))[0]
    assert np.diagonal(axes).min() > 0.99


def test_pictures_that_do_not_belong_together_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each picture has its own gray level; the brightest one shows no board."""
    views = corners_seen(camera_with(1).lens, BOARD, 6, 1, NOISE)
    monkeypatch.setattr(
        calibrating, "find_board", lambda picture, _: [*views, None][int(picture[0, 0])]
    )
    pictures = [(f"in/{grey}.png", np.full(SIZE[::-1], grey, np.uint8)) for grey in range(7)]
    with pytest.raises(InputError, match=r"5\.png: size = '1279 x 800'; the first is 1280 x 800"):
        calibrate_camera([*pictures[:5], ("5.png", pictures[5][1][:, 1:])], plan_of(board=BOARD))
    with pytest.raises(InputError, match=r"6\.png: plane view; this picture shows no board"):
        calibrate_camera(pictures, plan_of(board=BOARD, plane="6.png"))
    with pytest.raises(InputError, match=r"6\.png: plane view; this picture shows no board"):
        calibrate_camera(
            pictures[::-1], plan_of(board=BOARD)
        )  # plane view by default: the first picture
    with pytest.raises(
        InputError, match=r"^height = '9 m'; allowed: less than the height of the camera"
    ):
        calibrate_camera(pictures, plan_of(board=BOARD, height=9.0))
    with pytest.raises(InputError, match=r"^plane = 'flat.png'; allowed: in/0\.png"):
        calibrate_camera(pictures, plan_of(board=BOARD, plane="flat.png"))
    with pytest.raises(InputError, match="does it have 14x9 squares"):
        calibrate_camera(pictures[:2] + pictures[6:], plan_of(board=BOARD))
    with pytest.raises(InputError, match="pictures = 0"):
        calibrate_camera([], plan_of(board=BOARD))
    result = calibrate_camera(pictures[::-1], plan_of(board=BOARD, plane="1.png"))
    assert "no board was found in in/6.png" in result.warnings
    assert result.plane == "in/1.png"


def test_a_picture_without_a_board_shows_none() -> None:
    blank = np.full((200, 300), 7, np.uint8)
    assert find_board(blank, BOARD) is None
    blank[50:100, 60:120] = 200
    assert find_board(blank, BOARD) is None
    assert find_board(blank, board_of("chessboard:9x6:25mm")) is None
