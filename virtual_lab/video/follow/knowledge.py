"""Facts about a clip that its user states, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from virtual_lab.units import DEGREE, STANDARD_GRAVITY
from virtual_lab.video.calibration.plane import distance_of
from virtual_lab.video.clips.calibration_file import EXACT, ClipCalibration
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import Blobs

GIVEN, BALL, GRAVITY, FILE = "given", "ball", "gravity", "file"  # sources of a scale or a rate
# u of the camera's angle off level, and off square to the flight [rad]; two u are 5 degrees
LEVEL_U = 2.5 * DEGREE
STATED_LEVEL_U = 0.5 * DEGREE  # the same if the user states a level camera; two u are 1 degree
Note = tuple[str, str]  # a flag in capitals, or "" for a remark without a flag, and a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipKnowledge:
    """Facts about a clip that its user states, in SI units."""

    rate: float  # stored pictures per second of real time, including repeats
    rate_u: float = EXACT  # relative u of `rate`
    rate_of: str = GIVEN  # GIVEN | FILE: stated by the file | GRAVITY: fitted with a known length
    ball: float | None = None  # diameter [m]
    ball_u: float = EXACT
    metres_per_pixel: float | None = None
    metres_per_pixel_u: float = EXACT
    exposure: float | None = None  # [s]
    gravity: float = STANDARD_GRAVITY
    gravity_u: float = 0.025 / 3**0.5  # u of g on the Earth, where it is 9.78 to 9.83 m/s²
    drag: tuple[float, float] | None = None  # deceleration over speed², with its u [1/m]
    pull: tuple[float, float] | None = None  # g along the picture's x and y [m/s²]
    # u of the camera's angle off level, and off square to the flight [rad]
    level_u: float = LEVEL_U
    # GRAVITY | BALL | None: that with the smaller u; a stated length always has priority
    ruler: str | None = None
    tripod: bool = False  # True if the camera is known to stand still
    readout: float | None = None  # readout time [s]; None: unknown, at most a frame
    readout_u: float = EXACT
    readout_axis: tuple[int, int] = (1, 1)
    frames: tuple[int, int] | None = None
    region: tuple[float, float, float, float] | None = None
    ball_at: tuple[float, float, int] | None = None  # x, y, frame
    # positions of each flight by hand, which replace those that are found; None: no correction
    by_hand: list[Blobs] | None = None
    # calibration of a camera with which the ball is located sharply; empty if there is none
    calibration: ClipCalibration = field(default_factory=ClipCalibration)

    @property
    def in_frames(self) -> dict[str, Any]:
        """Exposure time, readout time and its u, in frames; None if unknown."""
        times = {each: getattr(self, each) for each in ("exposure", "readout", "readout_u")}
        return {name: value and value * self.rate for name, value in times.items()}


def frames_are(frames: Sequence[int]) -> str:
    """Return the start of a sentence, "frame 3 is" or "frames 3, 4 are"."""
    numbers = ", ".join(map(str, frames))
    return f"frame {numbers} is" if len(frames) == 1 else f"frames {numbers} are"


def knowledge_of(clip: Clip, calibration: ClipCalibration) -> ClipKnowledge:
    """Return the facts about a clip that its calibration file states; the rest are default values.

    The camera is assumed to stand still and to have a global shutter. If the lens is calibrated,
    the direction of g in the picture is not used.
    """
    scale, camera = calibration.metres_per_pixel, calibration.camera
    said = calibration.exposure_s
    if camera and (far := distance_of(camera)):
        scale = far / camera.matrix[0][0]
    (right, down, *_), drag = calibration.gravity_mps2, calibration.drag_per_m
    # The distortion of a calibrated lens bends straight lines.
    pull = (right, down) if (right or down) and not camera else None
    return ClipKnowledge(
        rate=1 / usual_step(clip.times),
        drag=(drag, calibration.drag_per_m_u) if drag else None,
        pull=pull,
        ball=calibration.ball_diameter_m,
        ball_u=calibration.ball_diameter_m_u,
        metres_per_pixel=scale,
        metres_per_pixel_u=calibration.metres_per_pixel_u,
        exposure=clip.source.exposure if said is None else said,
        gravity=float(np.linalg.norm(calibration.gravity_mps2)) or STANDARD_GRAVITY,
        readout=0.0,
        tripod=True,
        rate_u=calibration.frames_per_second_u / (calibration.frames_per_second or 1.0),
        calibration=calibration,
    )
