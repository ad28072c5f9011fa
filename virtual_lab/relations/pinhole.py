"""Projection by a lens: a pinhole with the distortion of Brown (1971), as in OpenCV.

Axes of the camera: x right, y down, z away from it. The center of the first pixel is (0, 0).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.units import Array

DOWN = np.diag([1.0, -1.0, -1.0])  # rotation from rig axes to a camera that looks straight down


def distort(points: ArrayLike, coefficients: Sequence[Array] | Array) -> Array:
    """Return the normalized image coordinates of points after distortion by the lens, (…, 2).

    Normalized image coordinates are x/z and y/z in the axes of the camera.

    Parameters
    ----------
    points
        Undistorted normalized image coordinates, (…, 2).
    coefficients
        k1, k2, p1, p2 and k3. Each is a number, or an array that broadcasts with the shape (…).
    """
    x, y = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(points: ArrayLike, coefficients: Sequence[Array] | Array) -> Array:
    """Return the normalized image coordinates of points without distortion by the lens, (…, 2).

    This is the inverse of `distort`. It is computed by fixed-point iteration and is exact to 1e-10
    for a distortion of a few percent.

    Parameters
    ----------
    points
        Distorted normalized image coordinates x/z and y/z, (…, 2).
    coefficients
        k1, k2, p1, p2 and k3. Each is a number, or an array that broadcasts with the shape (…).
    """
    drawn = np.asarray(points, dtype=np.float64)
    flat = drawn
    for _ in range(8):
        flat = drawn - (distort(flat, coefficients) - flat)
    return flat


def project_points(
    points: ArrayLike, focal: float, centre: ArrayLike, coefficients: Array
) -> Array:
    """Return the positions (x, y) of points in the picture [px], (…, 2).

    Parameters
    ----------
    points
        Points (x, y, z) in the axes of the camera, (…, 3), in any unit. They must be in front of
        the camera (z > 0); this is not checked.
    focal
        Focal length [px].
    centre
        Principal point (x, y) [px], (2,).
    coefficients
        Distortion k1, k2, p1, p2 and k3, (5,).
    """
    place = np.asarray(points, dtype=np.float64)
    flat = distort(place[..., :2] / place[..., 2:], coefficients)
    return np.asarray(focal * flat + np.asarray(centre))


def rotation(vector: ArrayLike) -> Array:
    """Convert rotation vectors (…, 3) [rad] to rotation matrices (…, 3, 3), by Rodrigues' formula.

    A zero vector gives the identity matrix.
    """
    turn = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(turn, -1, 0)
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    # sin(a)/a and (1 - cos(a))/a^2, with their limits at 0
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def looking_down(tilt: ArrayLike) -> Array:
    """Return the rotation matrices (…, 3, 3) from the axes of a rig to the axes of its camera.

    The camera is above the rig. `tilt` is the rotation vector of the camera, (…, 3) [rad]. Without
    tilt, the Z axis of the rig points toward the camera, and its X axis points to the right in the
    picture.
    """
    return np.asarray(DOWN @ rotation(tilt))
