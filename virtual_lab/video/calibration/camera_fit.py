"""Lens and poses fitted to a board's corners by OpenCV, and their joint covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.calibration.board_finding import BoardView

__all__ = ["Solved", "solve"]

Array = NDArray[np.float64]


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


def solve(corners: Array, seen: list[BoardView], size: tuple[int, int], plane: int) -> Solved:
    """Return lens and poses from a board's corners (corner, 3) [m] as they were seen in each view.

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
    """Return what fits; a sixth power of the radius of less than 3 u is left out."""
    import cv2

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
    design, rest = [], []
    for view, (points, each) in enumerate(zip(known, seen, strict=True)):
        drawn, slopes = cv2.projectPoints(points, turns[view], shifts[view], matrix, distortion)
        slopes = _local(np.asarray(slopes, np.float64), np.asarray(turns[view], np.float64))
        row = np.zeros((len(slopes), 4 + bent + 6 * len(seen)))
        row[:, : 4 + bent] = slopes[:, 6 : 6 + 4 + bent]
        start = 4 + bent + 6 * view
        row[:, start : start + 6] = slopes[:, :6]
        design.append(row)
        rest.append(each.places - drawn.reshape(-1, 2))
    residuals = np.concatenate(rest)
    slopes = np.concatenate(design)
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


def _local(slopes: Array, turn: Array) -> Array:
    """Return slopes by a small turn after the pose's own, in place of those by its vector."""
    import cv2

    rotation, by_vector = cv2.Rodrigues(turn)
    # rows: the vector's three numbers; columns: the matrix's nine, row by row
    change = np.asarray(by_vector).reshape(3, 3, 3) @ rotation.T
    local = np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=1)  # (3, axis)
    out = slopes.copy()
    # d/dvector = local @ d/dturn
    out[:, :3] = np.linalg.solve(local, slopes[:, :3].T).T
    return np.asarray(out)
