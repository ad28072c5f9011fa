"""A camera calibrated with pictures of a board: lens, pose, the scale in a plane, each with its u.

In one of the pictures, the plane view, the board lies in the plane that lengths are measured in,
or parallel to it. Axes are the board's there: from its middle, X along the line of the board that
is nearest to the picture's right, Y down, Z away from the camera. What was found of the corners
has one covariance for lens and pose together, for they are wrong together: a focal length that is
too long with a camera that is too high leaves the scale as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.relations.board import Board
from virtual_lab.units import DEGREE, Array
from virtual_lab.video.calibration.board_finding import BoardView, find_board
from virtual_lab.video.calibration.lens_blur import lens_blur_of
from virtual_lab.video.calibration.plane import on_plane
from virtual_lab.video.clips.calibration_file import CameraFit, CameraModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Demands:
    """What pictures must show for a calibration, and what is warned of."""

    least_views: int = 3  # with a board
    views: int = 6  # leave little to chance
    least_angle_rad: float = 8 * DEGREE  # of views: parallel ones do not show the focal length
    greatest_focal_u: float = 0.02  # relative: more is no calibration
    rough_rms_px: float = 0.3  # a warning
    greatest_rms_px: float = 1.5  # no calibration
    least_covered: float = 0.4  # of the picture, within the outermost corners


DEMANDS = Demands()


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is known of the board and of the plane."""

    board: Board
    square_u: float  # of every square's side alike [m]
    height: float  # of the ball's plane over the plane view's board, toward the camera [m]
    height_u: float  # [m]
    plane: str | None = None  # name of the plane view; None: the first picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """What fits all views; values are fx, fy, cx, cy, k1, k2, p1, p2 and, where it shows, k3."""

    values: Array
    rotations: Array  # (view, 3, 3) from the board's axes to the camera's
    translations: Array  # (view, 3) [m]
    covariance: Array  # of values, then turn [rad] and shift [m] of the plane view's pose
    view: NDArray[np.intp]  # of each corner
    places: Array  # (corner, 2) [pixels]
    residuals: Array  # (corner, 2) [pixels]
    left_out: NDArray[np.intp]  # corners, (view,)

    @property
    def u(self) -> Array:
        """Standard uncertainties of what the covariance is of."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    @property
    def rms(self) -> float:
        """Of the residuals, each way [pixels]."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def view_rms(self) -> Array:
        """Of each view's residuals, each way [pixels]."""
        squares = (self.residuals**2).mean(axis=1)
        return np.asarray(np.sqrt(np.bincount(self.view, squares) / np.bincount(self.view)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """A calibrated camera and what speaks for it."""

    model: CameraModel
    solved: Solved
    views: tuple[str, ...]  # pictures that show the board
    plane: int  # which of them is the plane view
    lens_blur: float  # there, standard deviation [pixels]
    length_u: Array  # relative, of lengths across and down the middle of the plane, (2,)
    warnings: tuple[str, ...]


def calibrate_camera(pictures: Iterable[tuple[str, NDArray[Any]]], plan: Plan) -> Calibrated:
    """Calibrate the camera that took some pictures: name and grey values (row, column), read once.

    Raises `InputError`: pictures of several sizes, fewer than three with a board, none in the
    plane view, boards all parallel, residuals that no lens leaves, a plane behind the camera.
    """
    looked, size = _found(pictures, plan.board)
    names = tuple(name for name, found in looked if found)
    without = tuple(name for name, found in looked if not found)
    seen = [found for _, found in looked if found]
    if len(seen) < DEMANDS.least_views:
        many = f"{plan.board.columns}x{plan.board.rows} squares, not inner corners"
        allowed = f"at least {DEMANDS.least_views} must show the board (is it {many}?)"
        raise InputError("", "pictures with a board", len(seen), allowed)
    plane = _plane_view(looked, plan)
    solved = _solved(plan.board.corners(), seen, size, plane)
    _require_sound(solved)
    rotation, translation = _turned(solved.rotations[plane]), solved.translations[plane]
    if not plan.height < (far := float(translation[2])):
        allowed = f"the camera itself is {far:.3g} m over the board"
        raise InputError("", "--height", f"{plan.height:g} m", allowed)
    model = _model(solved, size, rotation, translation, plan)
    shares = _length_u(solved, model)
    relative = float(np.hypot(shares.max(), plan.square_u / plan.board.square))
    return Calibrated(
        model=replace(model, relative_scale_u=relative),
        solved=solved,
        views=names,
        plane=plane,
        lens_blur=seen[plane].lens_blur,
        length_u=shares,
        warnings=_warnings(solved, seen, names, without, size, plan),
    )


def lengths_of(model: CameraModel) -> Array:
    """Lengths in the plane that half the picture's width and height show, (2,) [m]."""
    wide, high = model.image_size
    middle = np.array([(wide - 1) / 2, (high - 1) / 2])
    reach = np.array([[wide / 4, 0.0], [0.0, high / 4]])
    ends = on_plane(np.concatenate([middle - reach, middle + reach]), model, None)
    return np.asarray(np.hypot(*(ends[2:] - ends[:2]).T))


def _found(
    pictures: Iterable[tuple[str, NDArray[Any]]], board: Board
) -> tuple[list[tuple[str, BoardView | None]], tuple[int, int]]:
    """Corners of the board in each picture, and width and height."""
    looked: list[tuple[str, BoardView | None]] = []
    size: tuple[int, int] | None = None
    for name, picture in pictures:
        own = (picture.shape[1], picture.shape[0])
        size = size or own
        if own != size:
            allowed = f"the first is {size[0]} x {size[1]}: all must be one camera's"
            raise InputError(name, "size", f"{own[0]} x {own[1]}", allowed)
        found = find_board(picture, board)
        if found:
            found = replace(found, lens_blur=lens_blur_of(picture, found, board))
        looked.append((name, found))
    if size is None:
        raise InputError("", "pictures", 0, f"at least {DEMANDS.least_views} of a board")
    return looked, size


def _plane_view(looked: list[tuple[str, BoardView | None]], plan: Plan) -> int:
    """Find the number of the plane view among pictures with a board; never another unasked."""
    names = [name for name, _ in looked]
    wanted = [n for n, name in enumerate(names) if plan.plane in (None, name, Path(name).name)]
    if not wanted:
        raise InputError("", "--plane", plan.plane, f"allowed: {', '.join(names)}")
    name, found = looked[wanted[0]]
    if found is None:
        allowed = "no board was found in it; name one that shows it flat with --plane"
        raise InputError(name, "plane view", None, allowed)
    return sum(each is not None for _, each in looked[: wanted[0]])


def _require_sound(solved: Solved) -> None:
    normals = solved.rotations[:, :, 2]
    apart = float(np.arccos(np.clip(np.abs(normals @ normals.T), 0, 1)).max())
    if apart < DEMANDS.least_angle_rad:
        least = f"{DEMANDS.least_angle_rad / DEGREE:g} deg"
        allowed = f"hold it askew in some, by {least} at least, better 30"
        raise InputError("", "angle between boards", f"{apart / DEGREE:.2g} deg", allowed)
    if solved.rms > (most := DEMANDS.greatest_rms_px):
        allowed = f"less than {most:g} (another board, or pictures of several cameras?)"
        raise InputError("", "residuals, pixels", f"{solved.rms:.2g}", allowed)
    vague = float((solved.u[:2] / solved.values[:2]).max())
    if not vague < DEMANDS.greatest_focal_u:
        allowed = f"less than {DEMANDS.greatest_focal_u:g}: more pictures, more askew"
        raise InputError("", "relative u of the focal length", f"{vague:.2g}", allowed)


def _turned(rotation: Array) -> Array:
    """Turn of a pose by axes as the module has them: quarter turns of the board's own."""
    facing = np.diag([1.0, np.sign(rotation[2, 2]), np.sign(rotation[2, 2])])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = [rotation @ facing @ np.linalg.matrix_power(quarter, n) for n in range(4)]
    return max(turns, key=lambda each: float(each[0, 0]))


def _lens_and_pose(values: Array, rotation: Array, translation: Array) -> dict[str, Any]:
    """Camera as `CameraModel` has it; `values` as in `Solved`."""
    fx, fy, cx, cy, *bent = map(float, values)
    return {
        "matrix": ((fx, 0.0, cx), (0.0, fy, cy), (0.0, 0.0, 1.0)),
        "distortion": (*bent, *[0.0] * (5 - len(bent))),
        "rotation": tuple(cv2.Rodrigues(rotation)[0].ravel().tolist()),
        "translation_m": tuple(map(float, translation)),
    }


def _model(
    solved: Solved, size: tuple[int, int], rotation: Array, translation: Array, plan: Plan
) -> CameraModel:
    *lens_u, rx, ry, rz, x, y, z = map(float, solved.u)
    return CameraModel(
        image_size=size,
        **_lens_and_pose(solved.values, rotation, translation),
        plane_height_m=0.0 - plan.height,  # never -0.0
        plane_height_u_m=plan.height_u,
        fit=CameraFit(
            board=plan.board.source,
            views=len(solved.rotations),
            corners=len(solved.residuals),
            rms_px=solved.rms,
            focal_u_px=(lens_u[0], lens_u[1]),
            centre_u_px=(lens_u[2], lens_u[3]),
            distortion_u=(*lens_u[4:], *[0.0] * (9 - len(lens_u))),
            rotation_u=(rx, ry, rz),
            translation_u_m=(x, y, z),
        ),
    )


def _length_u(solved: Solved, model: CameraModel) -> Array:
    """Relative u of `lengths_of`, from the covariance of lens and pose."""
    rotation = cv2.Rodrigues(np.array(model.rotation))[0]

    def logs(step: Array) -> Array:
        turned = np.asarray(cv2.Rodrigues(step[-6:-3])[0] @ rotation, np.float64)
        moved = _lens_and_pose(
            solved.values + step[:-6], turned, np.array(model.translation_m) + step[-3:]
        )
        return np.log(lengths_of(replace(model, **moved)))

    steps = np.diag(solved.u)
    slopes = np.array([(logs(each) - logs(-each)) / 2 for each in steps]) / solved.u[:, None]
    return np.asarray(np.sqrt(np.einsum("il,ij,jl->l", slopes, solved.covariance, slopes)))


def _warnings(
    solved: Solved,
    seen: list[BoardView],
    names: tuple[str, ...],
    without: tuple[str, ...],
    size: tuple[int, int],
    plan: Plan,
) -> tuple[str, ...]:
    found = []
    if without:
        found.append(f"no board was found in {', '.join(without)}")
    if len(seen) < (many := DEMANDS.views):
        found.append(f"only {len(seen)} pictures show the board: {many} or more are better")
    if solved.rms > DEMANDS.rough_rms_px:
        found.append(f"residuals of {solved.rms:.2g} pixels are large: is the board flat?")
    for name, lost in zip(names, solved.left_out, strict=True):
        if lost:
            found.append(f"{name}: corners far off were left out, {lost} of them")
    hull = cv2.convexHull(np.concatenate([each.places for each in seen]).astype(np.float32))
    share = cv2.contourArea(hull) / (size[0] * size[1])
    if share < DEMANDS.least_covered:
        found.append(
            f"the boards reach over {100 * share:.0f} % of the picture: beyond them the lens's "
            "distortion is not known"
        )
    if plan.square_u == 0:
        found.append("the squares' side is taken as exact: say how sure it is with --square-u")
    if plan.height_u == 0:
        found.append("the ball's plane is taken as exactly known: see --height-u")
    return tuple(found)


def _solved(corners: Array, seen: list[BoardView], size: tuple[int, int], plane: int) -> Solved:
    """Lens and poses from a board's corners (corner, 3) [m] as they were seen in each view.

    `size` is the pictures' width and height, `plane` the view whose pose is in the covariance.
    Raises `InputError` where OpenCV finds no camera for them.
    """
    count = np.array([len(each.ids) for each in seen])
    whole = _fit(corners, seen, size, plane)
    for _ in range(8):
        off = np.hypot(*whole.residuals.T)
        usual = 1.4826 / 1.177 * float(np.median(off))  # Rayleigh's median
        # one wild corner bends the lens for others: the worst leave first, those far off alone
        wild = off > max(6 * usual, 0.5 * float(off.max()))
        if not wild.any():
            break
        kept = np.split(~wild, np.cumsum([len(each.ids) for each in seen])[:-1])
        seen = [
            BoardView(ids=each.ids[good], places=each.places[good])
            for each, good in zip(seen, kept, strict=True)
        ]
        if min(len(each.ids) for each in seen) < 6:
            why = "one of the pictures fits no lens that fits the others"
            raise InputError("", "camera", None, why)
        whole = _fit(corners, seen, size, plane)
    return replace(whole, left_out=count - np.array([len(each.ids) for each in seen]))


def _fit(
    corners: Array, seen: list[BoardView], size: tuple[int, int], plane: int, bent: int = 5
) -> Solved:
    """Fit lens and poses; a sixth power of the radius of less than 3 u is left out."""
    from scipy.linalg import block_diag

    flags = cv2.CALIB_FIX_K3 if bent == 4 else 0
    known = [corners[each.ids] for each in seen]
    try:
        _, matrix, distortion, turns, shifts = cv2.calibrateCamera(
            [each.astype(np.float32) for each in known],
            [each.places.astype(np.float32) for each in seen],
            size,
            np.eye(3),
            np.zeros(5),
            flags=flags,
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12),
        )
    except cv2.error as fault:
        why = "OpenCV finds none that fits: are the views all alike, or of another board?"
        raise InputError("", "camera", None, why) from fault
    lens, poses, rest = [], [], []
    for view, (points, each) in enumerate(zip(known, seen, strict=True)):
        drawn, slopes = cv2.projectPoints(points, turns[view], shifts[view], matrix, distortion)
        shifts_by = np.asarray(slopes, np.float64)[:, 3:6]
        # a turn by w after the pose's own moves a point p of the board by w x R p
        turned = np.repeat(points @ cv2.Rodrigues(turns[view])[0].T, 2, axis=0)
        lens.append(slopes[:, 6 : 10 + bent])
        poses.append(np.hstack([np.cross(turned, shifts_by), shifts_by]))
        rest.append(each.places - drawn.reshape(-1, 2))
    residuals = np.concatenate(rest)
    slopes = np.hstack([np.concatenate(lens), block_diag(*poses)])
    scale = np.linalg.norm(slopes, axis=0)
    free = max(residuals.size - slopes.shape[1], 1)
    normal = slopes / scale
    inverse = np.linalg.pinv(normal.T @ normal, hermitian=True) / np.outer(scale, scale)
    first = 4 + bent + 6 * plane
    kept = np.r_[: 4 + bent, first : first + 6]
    whole = Solved(
        values=np.concatenate(
            [matrix[[0, 1, 0, 1], [0, 1, 2, 2]], np.asarray(distortion).ravel()[:bent]]
        ),
        rotations=np.stack([cv2.Rodrigues(turn)[0] for turn in turns]),
        translations=np.stack([np.asarray(shift).ravel() for shift in shifts]),
        covariance=inverse[np.ix_(kept, kept)] * float((residuals**2).sum()) / free,
        view=np.repeat(np.arange(len(seen)), [len(each.ids) for each in seen]),
        places=np.concatenate([each.places for each in seen]),
        residuals=residuals,
        left_out=np.zeros(len(seen), np.intp),
    )
    if bent == 5 and not abs(whole.values[8]) > 3 * whole.u[8]:
        return _fit(corners, seen, size, plane, bent=4)
    return whole
