"""What a bat hides in each frame of a clip: its outline, turned as it then was."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.bat.clip import BatFound
from virtual_lab.video.bat.outline import Outline, pixels_of
from virtual_lab.video.clips.calibration_file import CameraModel, ClipCalibration
from virtual_lab.video.clips.clip import Clip

__all__ = ["BatCover", "bat_cover"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BESIDE = 3  # pixels beside the bat that its edge, as the lens draws it, may reach
ENDS = 14.0  # pixels: so near to the frame's edge no outline is looked for, and the bat goes on


@dataclass(frozen=True, slots=True, kw_only=True)
class BatCover:
    """A `Cover`: the bat as it stands in each frame."""

    rim: Outline  # the bat at rest, its places once round
    camera: CameraModel
    poses: Array  # (frame, 2): angle [rad], shift [m]
    shape: tuple[int, int]  # rows, columns of a frame

    def hidden(self, frame: int) -> Mask:
        """Return which pixels the bat stands on in a frame, or nearly."""
        return _drawn(self.rim, self.poses[frame], self.camera, self.shape)


def bat_cover(bat: BatFound, clip: Clip, calibration: ClipCalibration) -> BatCover:
    """Return what a bat found in a clip hides.

    Where a frame does not show its angle, the frames about it tell it.

    Raises
    ------
    InputError
        The calibration has no [bat] or no [camera].
    """
    place, camera = calibration.bat, calibration.camera
    if place is None or camera is None:
        raise InputError("", "bat", None, "a bat hides what [bat] and [camera] say where it is")
    rim = _round(bat.outline, place.widest_m, camera)
    angles = bat.angles
    seen = np.isfinite(angles.angle)
    poses = np.zeros((len(bat.times), 2))
    if seen.any():
        for column, told in enumerate((angles.angle, angles.shift)):
            poses[:, column] = np.interp(bat.times, bat.times[seen], told[seen])
    return BatCover(rim=rim, camera=camera, poses=poses, shape=clip.shape)


def _round(found: Outline, widest: float, camera: CameraModel) -> Outline:
    """Return an outline whose places lead once round the bat.

    Where one edge does not show, it is as far from the axis as it may be.
    """
    ahead = np.array([-found.left[1], found.left[0]])
    along, off = (found.places - found.pivot) @ ahead, (found.places - found.pivot) @ found.left
    ends = found.pivot + np.outer([along.min(), along.max()], ahead)
    pixel = float(np.ptp(along) / np.hypot(*np.diff(pixels_of(ends, camera), axis=0)[0]))
    more = ENDS * pixel
    stations = np.concatenate([[along.min() - more], np.sort(along), [along.max() + more]])
    edges = []
    for number, sign in enumerate((1.0, -1.0)):
        own = np.flatnonzero(found.side == number)
        own = own[np.argsort(along[own], kind="stable")]
        far = np.interp(stations, along[own], off[own]) if own.size else sign * widest
        across = np.broadcast_to(far, stations.shape)
        edges.append(found.pivot + np.outer(stations, ahead) + np.outer(across, found.left))
    rim = np.concatenate([edges[0], edges[1][::-1]])
    return replace(found, places=rim, normals=np.zeros_like(rim))


def _drawn(rim: Outline, pose: Array, camera: CameraModel, shape: tuple[int, ...]) -> Mask:
    """Return the pixels within a bat's rim, and a few beside it, (row, column)."""
    import cv2

    places, _ = rim.turned(*pose)
    corners = np.rint(pixels_of(places, camera)).astype(np.int32)
    drawn = np.zeros(shape, np.uint8)
    cv2.fillPoly(drawn, [corners], 1)
    cv2.polylines(drawn, [corners], True, 1, 2 * BESIDE + 1)
    return drawn > 0
