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
    """Return the positions of points in the plane z = 1 after distortion by the lens, (…, 2).

    Parameters
    ----------
    points
        x/z and y/z, (…, 2).
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
    """Return the points in the plane z = 1 whose distorted positions are `points`, (…, 2).

    The method is fixed-point iteration, exact to 1e-10 for a distortion of a few percent.

    Parameters
    ----------
    points
        Distorted x/z and y/z, (…, 2).
    coefficients
        k1, k2, p1, p2, k3, each a number or of a shape that broadcasts with x.
    """
    drawn = np.asarray(points, dtype=np.float64)
    flat = drawn
    for _ in range(8):
        flat = drawn - (distort(flat, coefficients) - flat)
    return flat


def project_points(
    points: ArrayLike, focal: float, centre: ArrayLike, coefficients: Array
) -> Array:
    """Return the pixels (x, y), (…, 2), of points (…, 3) in axes of the camera.

    Parameters
    ----------
    points
        Points in front of the camera, (…, 3), in any unit.
    focal
        Focal length [px].
    centre
        Principal point [px], (2,).
    coefficients
        Distortion k1, k2, p1, p2, k3.
    """
    place = np.asarray(points, dtype=np.float64)
    flat = distort(place[..., :2] / place[..., 2:], coefficients)
    return np.asarray(focal * flat + np.asarray(centre))


def rotation(vector: ArrayLike) -> Array:
    """Return the rotation matrices, (…, 3, 3), of rotation vectors (…, 3) [rad] (Rodrigues).

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
    """Return the rotations (…, 3, 3) from axes of a rig to those of a camera above it.

    `tilt` is the rotation vector of the camera, (…, 3) [rad]. Without tilt the rig's Z points
    toward the camera and its X to the right in the picture.
    """
    return np.asarray(DOWN @ rotation(tilt))
