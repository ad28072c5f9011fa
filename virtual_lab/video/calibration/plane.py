"""From pixels to metres in the plane the ball moves in."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.units import Array
from virtual_lab.video.clips.calibration_file import CameraModel, ClipCalibration
from virtual_lab.video.locate.located import Located

RIM = 3.0  # a pattern's effect on the radius over that on the place: rims are darker all round


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelScale:
    """Metres of a pixel in the plane of the ball, with the relative u of it."""

    metres_per_pixel: float  # at the ball's middle place
    relative_u: float  # standard uncertainty of every length
    source: str  # what sets the scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(PixelScale):
    """Places of a ball in a plane [m], and the plane's scale."""

    places: Array  # (frame, 2) [m]
    sizes: Array  # how large a ball in the plane looks in each frame, by its place, (frame,)
    sense: float  # -1 where Y runs up the picture and X to its right

    @property
    def flat(self) -> Array:
        """Places in pixels of its scale, the picture's way up, (frame, 2)."""
        return self.places / self.metres_per_pixel * [1, self.sense]


def plane_of(found: Located, calibration: ClipCalibration, where: str) -> Plane:
    """Places of a ball in metres.

    A calibrated camera goes before metres_per_pixel, that before the ball's diameter.
    """
    pixels, camera, diameter = found.places, calibration.camera, calibration.ball_diameter_m
    if camera:
        places = on_plane(pixels, camera, diameter)
        right, down = (
            on_plane(pixels + half, camera, None) - on_plane(pixels - half, camera, None)
            for half in np.eye(2) / 2
        )
        stretch = right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]  # m² of a pixel
        # a sphere's solid angle goes as 1 / D² of its distance D, a pixel's as S cos t / D² where
        # it covers S of a plane seen under t: the radius as the root of D / S
        above = np.full(len(places), camera.plane_height_m)
        far = np.linalg.norm(np.column_stack([places, above]) - _pose(camera)[1], axis=1)
        sizes = np.sqrt(far / np.abs(stretch))
        middle = float(np.nanmedian(stretch))
        return Plane(
            places=places,
            metres_per_pixel=float(np.sqrt(abs(middle))),
            relative_u=relative_u_of(camera),
            source="camera",
            sizes=sizes / np.nanmedian(sizes),
            sense=float(np.sign(middle)),
        )
    whole = found.flags == 0
    if calibration.metres_per_pixel:
        scale, source = calibration.metres_per_pixel, "given"
        relative = calibration.metres_per_pixel_u / scale
    elif diameter and whole.any():
        radius, source = float(np.median(found.radius[whole])), "ball"
        pattern = float(np.median(found.pattern_u[whole]))
        # the model of a plain ball's edge leaves 0.05 pixels of its radius open
        scale, radius_u = diameter / (2 * radius), np.hypot(0.05, RIM * pattern)
        relative = float(np.hypot(calibration.ball_diameter_m_u / diameter, radius_u / radius))
    else:
        allowed = "no frame shows the whole ball well, and nothing else sets the scale"
        raise InputError(where, "scale", None, allowed)
    return Plane(
        places=pixels * scale,
        metres_per_pixel=scale,
        relative_u=relative,
        source=source,
        sizes=np.ones(len(pixels)),
        sense=1.0,
    )


def distance_of(camera: CameraModel) -> float:
    """Distance of the camera from the ball's plane [m]."""
    return abs(float(_pose(camera)[1][2]) - camera.plane_height_m)


def slopes_of(camera: CameraModel, places: Array) -> Array:
    """Return X/Z and Y/Z of places of the plane (…, 2) [m], from the foot of the camera."""
    return np.asarray((places - _pose(camera)[1][:2]) / distance_of(camera))


def _pose(camera: CameraModel) -> tuple[Array, Array]:
    """Turn of axes from the plane's to the camera's, and where the camera is [m]."""
    rotation = np.asarray(cv2.Rodrigues(np.array(camera.rotation))[0], np.float64)
    return rotation, -rotation.T @ np.array(camera.translation_m)


def relative_u_of(camera: CameraModel) -> float:
    """Relative u of lengths in the ball's plane: its height's share of the distance."""
    return float(np.hypot(camera.relative_scale_u, camera.plane_height_u_m / distance_of(camera)))


def on_plane(pixels: Array, camera: CameraModel, diameter: float | None) -> Array:
    """Places at which the rays of pixels meet the ball's plane, (n, 2) [m].

    A sphere's picture is an ellipse whose centre lies farther out than the centre's own picture,
    by 1 / (1 - r²/Z²): with the diameter known this is undone.
    """
    rotation, eye = _pose(camera)
    rays = np.full((len(pixels), 3), 1.0)  # in axes of the camera, 1 along its own
    matrix, distortion = np.array(camera.matrix), np.array(camera.distortion)
    rays[:, :2] = cv2.undistortPoints(pixels[:, None], matrix, distortion)[:, 0]
    if diameter:
        depth = float((rotation @ ([0, 0, camera.plane_height_m] - eye))[2])
        rays[:, :2] *= 1 - (diameter / 2 / depth) ** 2
    world = rays @ rotation
    reach = (camera.plane_height_m - eye[2]) / world[:, 2]
    return np.asarray((eye + reach[:, None] * world)[:, :2])
