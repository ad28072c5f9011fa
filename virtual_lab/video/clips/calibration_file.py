"""The calibration file of a clip (TOML): scale, frame rate, exposure and ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le, Len

from virtual_lab.catalog.specs import Real, Spec, Whole
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import read_toml

Uncertainty = Annotated[Real, Ge(0)]
EXACT = 0.0  # standard uncertainty of a value that is stated without one
Place = Annotated[Real, Ge(-1000), Le(1000)]  # m
Triple = tuple[Real, Real, Real]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFit(Spec):
    """Data on a camera's calibration: board, views, residuals, and the u of each parameter."""

    board: str
    views: Annotated[Whole, Gt(0)]
    corners: Annotated[Whole, Gt(0)]
    rms_px: Uncertainty  # rms of the residuals along each axis [pixels]
    focal_u_px: tuple[Uncertainty, Uncertainty]
    centre_u_px: tuple[Uncertainty, Uncertainty]
    distortion_u: Annotated[tuple[Uncertainty, ...], Len(4, 14)]
    rotation_u: tuple[Uncertainty, Uncertainty, Uncertainty]  # u of the Rodrigues vector [rad]
    translation_u_m: tuple[Uncertainty, Uncertainty, Uncertainty]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel(Spec):
    """A calibrated camera in OpenCV's convention; the ball is in the plane Z = plane_height_m."""

    image_size: tuple[Annotated[Whole, Gt(0)], Annotated[Whole, Gt(0)]]  # width, height [pixels]
    matrix: tuple[Triple, Triple, Triple]
    distortion: Annotated[tuple[Annotated[Real, Ge(-1e4), Le(1e4)], ...], Len(4, 14)]
    rotation: Triple  # Rodrigues vector, world to camera [rad]
    translation_m: tuple[Place, Place, Place]
    plane_height_m: Place = 0.0
    plane_height_u_m: Uncertainty = EXACT
    # relative u of every length in the plane, without the u of the plane's height
    relative_scale_u: Uncertainty = EXACT
    fit: CameraFit | None = None

    def __post_init__(self) -> None:
        if len(self.distortion) not in {4, 5, 8, 12, 14}:
            raise ValueError("distortion has 4, 5, 8, 12 or 14 numbers")
        if min(self.matrix[0][0], self.matrix[1][1]) < 1 or self.matrix[2] != (0.0, 0.0, 1.0):
            raise ValueError("matrix needs focal lengths above 1 pixel and the last row 0, 0, 1")
        import cv2

        turn = cv2.Rodrigues(np.array(self.rotation))[0]
        above = self.plane_height_m + float(turn[:, 2] @ self.translation_m)
        grazing = abs(turn[2, 2]) < 0.02  # the camera looks along the plane, not at it
        if grazing or not above * turn[2, 2] > 0:
            raise ValueError("the camera does not see the ball's plane")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipCalibration(Spec):
    """Keys of the file, in SI; a key with _u is the standard uncertainty of the key without it."""

    # scale in the plane in which the ball moves
    metres_per_pixel: Annotated[Real, Ge(1e-7), Le(1)] | None = None
    metres_per_pixel_u: Uncertainty = EXACT
    frames_per_second: Annotated[Real, Ge(1), Le(1e7)] | None = None
    frames_per_second_u: Uncertainty = EXACT
    # exposure time; None: the time that the clip states
    exposure_s: Annotated[Real, Ge(0), Le(1)] | None = None
    ball_diameter_m: Annotated[Real, Ge(1e-3), Le(1)] | None = None
    ball_diameter_m_u: Uncertainty = EXACT
    # standard deviation of the lens's blur
    lens_blur_px: Annotated[Real, Ge(0.1), Le(10)] | None = None
    timestamps: str | None = None  # CSV file beside this file, with one time per frame [s]
    drag_per_m: Annotated[Real, Ge(0), Le(1)] = 0.0  # κ of dv/dx = -κ v
    drag_per_m_u: Annotated[Real, Ge(0), Le(1)] = EXACT
    # g along x and y of the picture, or along X, Y and Z of the camera's plane [m/s²]
    gravity_mps2: Annotated[tuple[Place, ...], Len(2, 3)] = (0.0, 0.0)
    camera: CameraModel | None = None  # instead of metres_per_pixel

    def __post_init__(self) -> None:
        for name in ("metres_per_pixel", "frames_per_second", "ball_diameter_m"):
            value = getattr(self, name)
            if value and getattr(self, f"{name}_u") > value / 2:
                raise ValueError(f"{name}_u is larger than half of {name}")
        if self.camera and self.metres_per_pixel:
            raise ValueError("metres_per_pixel and [camera] both set the scale; give only one")
        if self.timestamps is not None and self.frames_per_second_u:
            raise ValueError("frames_per_second_u has no effect if timestamps are given")
        step = 1 / self.frames_per_second if self.frames_per_second else None
        if step and self.exposure_s and self.exposure_s > step * (1 + 1e-9):
            raise ValueError(f"exposure_s is longer than the frame interval, {step:.4g} s")


def read_calibration(
    path: Path | None, keys: Mapping[str, Any] | None = None, needs_length: bool = True
) -> ClipCalibration:
    """Return the calibration of a clip from a TOML file and from further keys.

    A key in `keys` replaces the same key of the file. If `path` is None, only `keys` are used. A
    relative path of the key `timestamps` is relative to the folder of the file.

    Raises
    ------
    InputError
        The file cannot be read, a key is unknown, a value is not allowed, or `needs_length` is True
        and neither scale, camera nor ball diameter is given.
    """
    document = (read_toml(path) if path else {}) | dict(keys or {})
    calibration = validate(document, str(path or ""), ClipCalibration)
    if path and calibration.timestamps is not None:
        calibration = replace(calibration, timestamps=str(path.parent / calibration.timestamps))
    lengths = calibration.metres_per_pixel, calibration.camera, calibration.ball_diameter_m
    if needs_length and not any(lengths):
        allowed = "give {ball}, {scale} or {ruler=gravity}, or a scale in a calibration file"
        raise InputError(str(path or ""), "{ball}", None, f"the scale is unknown; {allowed}")
    return calibration
