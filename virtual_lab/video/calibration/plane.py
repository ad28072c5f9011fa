"""Conversion from pixels to meters in the plane in which the ball moves."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.units import Array
from virtual_lab.video.clips.calibration_file import CameraModel, ClipCalibration
from virtual_lab.video.locate.located import Located

# ratio of a pattern's effect on the radius to its effect on the position, because the whole rim is
# darker
RIM = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelScale:
    """Scale of the picture in the ball's plane, with its relative u."""

    metres_per_pixel: float  # scale at the middle position of the ball
    relative_u: float  # relative standard uncertainty of every length
    source: str  # source of the scale: camera, given, ball or gravity


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(PixelScale):
    """Positions of a ball in a plane [m], and the scale of the plane."""

    places: Array  # (frame, 2) [m]
    # apparent size of a ball in the plane at its position in each frame, relative to the median
    sizes: Array
    sense: float  # -1 if Y points up in the picture while X points to the right, else 1

    @property
    def flat(self) -> Array:
        """Positions in pixels of the plane's scale, oriented as in the picture, (frame, 2)."""
        return self.places / self.metres_per_pixel * [1, self.sense]


def plane_of(outlines: Located, calibration: ClipCalibration, where: str) -> Plane:
    """Return the positions of a ball in its plane [m], and the scale of the plane.

    The scale comes from the calibrated camera. Without a camera it is the stated
    `metres_per_pixel`, and without both it comes from the diameter of the ball. A position that is
    NaN in `outlines` stays NaN. `where` is the name of the clip in an error message.

    Raises
    ------
    InputError
        None of the three is known, or only the diameter is known and no frame shows the whole ball.
    """
    pixels, camera, diameter = outlines.places, calibration.camera, calibration.ball_diameter_m
    sizes, middle = np.ones(len(pixels)), 1.0
    if camera:
        places = on_plane(pixels, camera, diameter)
        halves = [*np.eye(2) / 2, *np.eye(2) / -2]
        east, south, west, north = (on_plane(pixels + half, camera, None) for half in halves)
        right, down = east - west, south - north
        # area of a pixel in the plane, with its sign [m²]
        stretch = right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]
        # The solid angle of a sphere at the distance D is proportional to 1 / D². The solid angle
        # of a pixel that covers the area S of a plane at the angle t is proportional to S cos t /
        # D², and cos t is proportional to 1 / D. The radius in pixels is therefore proportional to
        # √(D / S).
        far = np.linalg.norm(np.pad(places, ((0, 0), (0, 1))) - foot_of(camera), axis=1)
        sizes, middle = np.sqrt(far / np.abs(stretch)), float(np.nanmedian(stretch))
        scale, source, relative = float(np.sqrt(abs(middle))), "camera", relative_u_of(camera)
    elif calibration.metres_per_pixel:
        scale, source = calibration.metres_per_pixel, "given"
        relative = calibration.metres_per_pixel_u / scale
    elif diameter and (whole := outlines.flags == 0).any():
        radius, source = float(np.median(outlines.radius[whole])), "ball"
        pattern = float(np.median(outlines.pattern_u[whole]))
        # u of the radius from the model of a plain ball's edge: 0.05 pixels
        scale, radius_u = diameter / (2 * radius), np.hypot(0.05, RIM * pattern)
        relative = float(np.hypot(calibration.ball_diameter_m_u / diameter, radius_u / radius))
    else:
        allowed = "no frame shows the whole ball well, and nothing else sets the scale"
        raise InputError(where, "scale", None, allowed)
    return Plane(
        places=places if camera else pixels * scale,
        metres_per_pixel=scale,
        relative_u=relative,
        source=source,
        sizes=sizes / np.nanmedian(sizes),
        sense=float(np.sign(middle)),
    )


def distance_of(camera: CameraModel) -> float:
    """Return the distance of the camera from the ball's plane [m]."""
    return abs(float(foot_of(camera)[2]))


def foot_of(camera: CameraModel) -> Array:
    """Return the position of the camera relative to the plane in which the ball moves, (3,) [m].

    The three numbers are X, Y and Z in the world axes of the camera model. X and Y are along the
    plane, from the origin of these axes. Z is the distance from the plane, positive on the side of
    the plane to which the Z axis points and negative on the other side.
    """
    return np.asarray(_pose(camera)[1] - [0.0, 0.0, camera.plane_height_m])


def _pose(camera: CameraModel) -> tuple[Array, Array]:
    """Return the rotation from the plane's axes to the camera's, and the camera's position [m]."""
    rotation = np.asarray(cv2.Rodrigues(np.array(camera.rotation))[0], np.float64)
    return rotation, -rotation.T @ np.array(camera.translation_m)


def relative_u_of(camera: CameraModel) -> float:
    """Return the relative standard uncertainty of lengths in the ball's plane.

    It includes the uncertainty of the height of this plane.
    """
    return float(np.hypot(camera.relative_scale_u, camera.plane_height_u_m / distance_of(camera)))


def on_plane(pixels: Array, camera: CameraModel, diameter: float | None) -> Array:
    """Return the points in the ball's plane, (n, 2) [m], that the camera shows at `pixels`, (n, 2).

    If `diameter` [m] is given, `pixels` are the centers of the ball's outlines. The outline of a
    sphere is an ellipse. Its center is farther from the optical axis than the image of the sphere's
    center, by the factor 1 / (1 - r²/Z²), where r is the radius of the ball and Z its distance. The
    result is corrected for this factor.
    """
    rotation, eye = _pose(camera)
    # directions in the camera's axes, 1 along its optical axis
    rays = np.full((len(pixels), 3), 1.0)
    matrix, distortion = np.array(camera.matrix), np.array(camera.distortion)
    rays[:, :2] = cv2.undistortPoints(pixels[:, None], matrix, distortion)[:, 0]
    if diameter:
        depth = float((rotation @ ([0, 0, camera.plane_height_m] - eye))[2])
        rays[:, :2] *= 1 - (diameter / 2 / depth) ** 2
    world = rays @ rotation
    reach = (camera.plane_height_m - eye[2]) / world[:, 2]
    return np.asarray((eye + reach[:, None] * world)[:, :2])
