"""Calibration of a camera with pictures of a board: lens, pose and scale in a plane, with u.

In one of the pictures, the plane view, the board is in the plane in which lengths are measured, or
parallel to it. The axes are those of the board in that view. The origin is the middle of the board,
X is the axis of the board that points most nearly to the right of the picture, Y is down, and Z is
away from the camera. Lens and pose have one joint covariance because their errors are correlated: a
focal length that is too long, together with a camera that is too high, does not change the scale.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import approx_fprime

from virtual_lab.errors import InputError, name_parameters
from virtual_lab.relations.board import Board
from virtual_lab.units import Array
from virtual_lab.video.calibration.board_finding import BoardView, find_board
from virtual_lab.video.calibration.lens_blur import lens_blur_of
from virtual_lab.video.calibration.plane import on_plane
from virtual_lab.video.clips.calibration_file import CameraFit, CameraModel

LEAST_VIEWS = 3  # smallest number of pictures that show a board
# largest relative u of the focal length; parallel views do not determine it
GREATEST_FOCAL_U = 0.02
# rms of the residuals that raises a warning, and largest rms of the residuals [pixels]
ROUGH_RMS_PX, GREATEST_RMS_PX = 0.3, 1.5
# smallest share of the picture within the outermost corners that raises no warning
LEAST_COVERED = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The board, the u of its squares, and the height of the plane in which the ball flies."""

    board: Board
    square_u: float  # u of the side of the squares, common to all of them [m]
    height: float  # height of the ball's plane above the plane view's board, toward the camera [m]
    height_u: float  # u of `height` [m]
    plane: str | None = None  # name of the plane view; None: the first picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """Solution for all views: lens and pose, with their covariance.

    Values are fx, fy, cx, cy [pixels], k1, k2, p1, p2, k3 (0 if not significant), and the pose of
    the plane view: Rodrigues vector [rad] and shift [m] from the plane's axes.
    """

    values: Array  # (15,)
    covariance: Array  # covariance of `values`, (15, 15)
    view: NDArray[np.intp]  # number of the view that shows each corner, (corner,)
    places: Array  # (corner, 2) [pixels]
    residuals: Array  # (corner, 2) [pixels]
    left_out: NDArray[np.intp]  # number of corners left out of the fit, (view,)

    @property
    def u(self) -> Array:
        """Standard uncertainties of the values."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    @property
    def rms(self) -> float:
        """Root mean square of the residuals along each axis [pixels]."""
        return float(np.sqrt(np.mean(self.residuals**2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """A calibrated camera with its solution, residuals and warnings."""

    model: CameraModel
    solved: Solved
    views: dict[str, float]  # pictures that show the board, rms of their residuals [pixels]
    plane: str  # the plane view
    lens_blur: float  # standard deviation of the lens's blur in the plane view [pixels]
    length_u: Array  # relative u of lengths across and down the middle of the plane, (2,)
    warnings: tuple[str, ...]


def calibrate_camera(pictures: Iterable[tuple[str, NDArray[Any]]], plan: Plan) -> Calibrated:
    """Return the calibration of a camera from pictures of a board.

    Parameters
    ----------
    pictures
        Pairs of name and gray values, (row, column). They are iterated only once.
    plan
        The board, and the plane in which the ball flies. In one picture, the plane view, the board
        is in this plane or parallel to it.

    Raises
    ------
    InputError
        The pictures differ in size, or fewer than three of them show the board. The plane view is
        not one of the pictures, or shows no board. The pictures do not determine the camera, for
        example because all boards are parallel, or the residuals are too large. The ball's plane is
        behind the camera.
    """
    looked, size, plane, blur = _find_boards(pictures, plan)
    views = {name: view for name, view in looked.items() if view}
    if len(views) < LEAST_VIEWS:
        many = f"{plan.board.columns}x{plan.board.rows} squares, not inner corners"
        allowed = f"at least {LEAST_VIEWS} pictures must show the board; does it have {many}?"
        raise InputError("", "pictures with a board", len(views), allowed)
    if plane is None:  # a requested plane view is not replaced by another one
        raise InputError("", "{plane}", plan.plane, f"allowed: {', '.join(looked)}")
    if plane not in views:
        allowed = "this picture shows no board; name a picture with the board in the ball's plane"
        raise InputError(plane, "plane view", None, allowed)
    solved = _solve(plan.board.corners(), [*views.values()], size, [*views].index(plane))
    _require_sound(solved)
    if not plan.height < (far := float(solved.values[-1])):
        allowed = f"allowed: less than the height of the camera above the board, {far:.3g} m"
        raise InputError("", "{height}", f"{plan.height:g} m", allowed)
    length_u = _length_u(solved, size, plan)
    relative = float(np.hypot(length_u.max(), plan.square_u / plan.board.square))
    squares = np.bincount(solved.view, (solved.residuals**2).mean(axis=1))
    rms = np.sqrt(squares / np.bincount(solved.view))
    u: list[Any] = solved.u.tolist()
    fit = CameraFit(
        board=plan.board.source,
        views=len(views),
        corners=len(solved.residuals),
        rms_px=solved.rms,
        focal_u_px=tuple(u[:2]),
        centre_u_px=tuple(u[2:4]),
        distortion_u=tuple(u[4:9]),
        rotation_u=tuple(u[9:12]),
        translation_u_m=tuple(u[12:]),
    )
    return Calibrated(
        model=replace(_model(solved.values, size, plan), relative_scale_u=relative, fit=fit),
        solved=solved,
        views=dict(zip(views, rms.tolist(), strict=True)),
        plane=plane,
        lens_blur=blur,
        length_u=length_u,
        warnings=tuple(map(name_parameters, _warnings(solved, looked, size, plan))),
    )


def lengths_of(model: CameraModel) -> Array:
    """Return half the width and half the height of the picture in the ball's plane [m], (2,).

    Half the width is the distance between two points of the ball's plane. In the picture, one point
    is a quarter of the width to the left of the middle. The other is a quarter of the width to the
    right. Half the height is the distance between the points a quarter of the height above and
    below.
    """
    wide, high = model.image_size
    middle = np.array([(wide - 1) / 2, (high - 1) / 2])
    reach = np.array([[wide / 4, 0.0], [0.0, high / 4]])
    ends = on_plane(np.concatenate([middle - reach, middle + reach]), model, None)
    return np.asarray(np.hypot(*(ends[2:] - ends[:2]).T))


def _find_boards(
    pictures: Iterable[tuple[str, NDArray[Any]]], plan: Plan
) -> tuple[dict[str, BoardView | None], tuple[int, int], str | None, float]:
    """Return the board's corners by picture, the picture size, the plane view's name and blur."""
    looked: dict[str, BoardView | None] = {}
    plane, blur = None, np.nan
    size: tuple[int, int] | None = None
    for name, picture in pictures:
        picture_size = (picture.shape[1], picture.shape[0])
        size = size or picture_size
        if picture_size != size:
            allowed = f"the first is {size[0]} x {size[1]}; all pictures must be of one camera"
            raise InputError(name, "size", f"{picture_size[0]} x {picture_size[1]}", allowed)
        view = find_board(picture, plan.board)
        if plane is None and plan.plane in (None, name, Path(name).name):
            plane, blur = name, lens_blur_of(picture, view, plan.board) if view else np.nan
        looked[name] = view
    if size is None:
        raise InputError("", "pictures", 0, f"needs at least {LEAST_VIEWS} of a board")
    return looked, size, plane, blur


def _require_sound(solved: Solved) -> None:
    if solved.rms > GREATEST_RMS_PX:
        why = "check the size of the board, and that all pictures are of one camera"
        allowed = f"allowed: less than {GREATEST_RMS_PX:g}; {why}"
        raise InputError("", "residuals, pixels", f"{solved.rms:.2g}", allowed)
    vague = float((solved.u[:2] / solved.values[:2]).max())
    if not vague < GREATEST_FOCAL_U:
        why = "add pictures of the board tilted by about 30 deg"
        allowed = f"allowed: less than {GREATEST_FOCAL_U:g}; {why}"
        raise InputError("", "relative u of the focal length", f"{vague:.2g}", allowed)


def _model(values: Array, size: tuple[int, int], plan: Plan) -> CameraModel:
    """Return the camera model with `values` in the order of `Solved`."""
    others: list[Any]
    fx, fy, cx, cy, *others = values.tolist()
    return CameraModel(
        image_size=size,
        matrix=((fx, 0.0, cx), (0.0, fy, cy), (0.0, 0.0, 1.0)),
        distortion=tuple(others[:5]),
        rotation=tuple(others[5:8]),
        translation_m=tuple(others[8:]),
        plane_height_m=0.0 - plan.height,  # 0.0 for a height of 0, not -0.0
        plane_height_u_m=plan.height_u,
    )


def _length_u(solved: Solved, size: tuple[int, int], plan: Plan) -> Array:
    """Return the relative u of `lengths_of`, from the covariance of lens and pose."""

    def logs(values: Array) -> Array:
        return np.log(lengths_of(_model(values, size, plan)))

    steps = np.maximum(solved.u, np.finfo(float).tiny)
    slopes = approx_fprime(solved.values, logs, steps)
    return np.asarray(np.sqrt(np.diagonal(slopes @ solved.covariance @ slopes.T)))


def _warnings(
    solved: Solved, looked: dict[str, BoardView | None], size: tuple[int, int], plan: Plan
) -> Iterator[str]:
    if without := [name for name, view in looked.items() if not view]:
        yield f"no board was found in {', '.join(without)}"
    if solved.rms > ROUGH_RMS_PX:
        yield f"residuals of {solved.rms:.2g} pixels are large; check that the board is flat"
    names = [name for name, view in looked.items() if view]
    for name, lost in zip(names, solved.left_out, strict=True):
        if lost:
            yield f"{name}: corners with large residuals were left out, {lost} in all"
    share = cv2.contourArea(cv2.convexHull(solved.places.astype(np.float32))) / (size[0] * size[1])
    if share < LEAST_COVERED:
        yield f"the boards cover {100 * share:.0f} % of the picture; the lens is unknown elsewhere"
    if plan.square_u == 0:
        yield "the side of the squares is assumed to be exact; state its u with {square_u}"
    if plan.height_u == 0:
        yield "the height of the ball's plane is assumed to be exact; state its u with {height_u}"


def _solve(corners: Array, views: list[BoardView], size: tuple[int, int], plane: int) -> Solved:
    """Fit the lens and the poses to the corners (corner, 3) [m] of a board in each view.

    `size` is width and height of the pictures, and `plane` the number of the plane view. Raises
    `InputError` if OpenCV finds no camera that fits them.
    """
    view = np.repeat(np.arange(len(views)), [len(each.ids) for each in views])
    points = corners[np.concatenate([each.ids for each in views])]
    places = np.concatenate([each.places for each in views])
    inliers = np.ones(len(view), bool)
    while True:
        solved = _fit(points[inliers], places[inliers], view[inliers], size, plane)
        off = np.hypot(*solved.residuals.T)
        usual = 1.4826 / 1.177 * float(np.median(off))  # Rayleigh's median
        # One wrong corner distorts the lens for the others, so only the worst corners are removed
        # in each round.
        good = off <= max(6 * usual, 0.5 * float(off.max()))
        if good.all():
            return replace(solved, left_out=np.bincount(view) - np.bincount(solved.view))
        inliers[inliers] = good
        if np.bincount(view[inliers], minlength=len(views)).min() < 6:
            why = "one of the pictures does not fit the lens of the others"
            raise InputError("", "camera", None, why)


def _fit(
    points: Array,
    places: Array,
    view: NDArray[np.intp],
    size: tuple[int, int],
    plane: int,
    flags: int = 0,
) -> Solved:
    """Fit lens and poses; the distortion k3 is left out if it is less than 3 u."""
    views = [view == k for k in range(int(view.max()) + 1)]
    try:
        _, matrix, distortion, turns, shifts = cv2.calibrateCamera(
            [points[rows].astype(np.float32) for rows in views],
            [places[rows].astype(np.float32) for rows in views],
            size,
            np.eye(3),
            np.zeros(5),
            flags=flags,
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12),
        )
    except cv2.error as fault:
        why = "OpenCV finds no lens that fits; the views may be too similar, or of another board"
        raise InputError("", "camera", None, why) from fault
    rotations = [np.asarray(cv2.Rodrigues(each)[0], np.float64) for each in turns]
    axes = _axes(rotations[plane])
    poses = [cv2.Rodrigues(each @ axes)[0] for each in rotations]
    residuals, lens, bodies = places.copy(), [], []
    for rows, pose, shift in zip(views, poses, shifts, strict=True):
        drawn, slopes = cv2.projectPoints(points[rows] @ axes, pose, shift, matrix, distortion)
        residuals[rows] -= drawn.reshape(-1, 2)
        lens.append(slopes[:, 6:])
        bodies.append(slopes[:, :6])
    whole = np.asarray(np.hstack([np.concatenate(lens), block_diag(*bodies)]), np.float64)
    whole[:, 8] *= not flags
    scale = np.linalg.norm(whole, axis=0)
    fitted, inverse = scale > 0, np.zeros(whole.T.shape)
    inverse[fitted] = np.linalg.pinv(whole[:, fitted] / scale[fitted]) / scale[fitted, None]
    free = max(int(residuals.size - fitted.sum()), 1)
    part = inverse[[*range(9), *range(9 + 6 * plane, 15 + 6 * plane)]]
    focal_centre = matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    values = focal_centre, distortion, poses[plane], shifts[plane]
    solved = Solved(
        values=np.concatenate([np.ravel(each) for each in values]),
        covariance=part @ part.T * float((residuals**2).sum()) / free,
        view=view,
        places=places,
        residuals=residuals,
        left_out=np.zeros(len(views), np.intp),
    )
    if not flags and not abs(solved.values[8]) > 3 * solved.u[8]:
        return _fit(points, places, view, size, plane, cv2.CALIB_FIX_K3)
    return solved


def _axes(rotation: Array) -> Array:
    """Return the rotation, in quarter turns, from a board's axes to the axes of this module."""
    facing = np.diag([1.0, np.sign(rotation[2, 2]), np.sign(rotation[2, 2])])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = [facing @ np.linalg.matrix_power(quarter, n) for n in range(4)]
    return max(turns, key=lambda each: float((rotation @ each)[0, 0]))
