"""Cases of pictures for the comparison of methods to locate a ball, with their true values.

A case is a ball of one size, blur and light. Its centers are spread evenly over one pixel. Position
in the frame and noise differ between pictures. The signal-to-noise ratio is that of the contrast to
the noise of a pixel halfway up the edge; a fifth of this variance is dark noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, pi, sin, sqrt
from typing import Literal

import numpy as np

from virtual_lab.units import Array
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.located import MARGIN, Located, Regions
from virtual_lab.video.locate.noise import ROUNDING, Noise

FULL_SCALE = 255.0  # DN


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Conditions of the pictures, in pixels and gray values."""

    radius: float = 30.0
    blur: float = 2.0  # shift during the exposure
    snr: float = 96.0
    slope: float = 0.0  # slope of the background along x [DN/px]
    stitched: bool = False
    light: Literal["even", "soft", "back", "hard side"] = "even"
    cut: float = 0.0  # share of the diameter outside the frame
    covered: float = 0.0  # share of the diameter behind the bat
    exposure: float = 1.0  # exposure relative to the correct one; from 1.34 the ball saturates
    hot: int = 0  # number of pixels at full scale in each picture
    flicker: float = 0.0  # amplitude of the light from picture to picture
    radius_off: float = 0.01  # relative error of the assumed radius
    start_off: float = 0.5  # largest error of the assumed position in each direction [px]
    quiet: bool = False  # no noise and no rounding, so that only the bias remains
    phases: int = 8
    repeats: int = 25

    @property
    def side(self) -> int:
        """Side length of the square region that the tracker uses [px]."""
        return 2 * ceil(1.1 * self.radius + self.blur / 2 + MARGIN) + 1

    @property
    def shift(self) -> tuple[float, float]:
        """Shift of the ball during the exposure, in x and y [px]."""
        return self.blur * cos(0.3), self.blur * sin(0.3)

    @property
    def levels(self) -> tuple[float, float]:
        """Gray values of a plain ball and of the background, which determine the noise [DN]."""
        contrast = float(np.interp(self.snr, (5.0, 27.0, 96.0), (40.0, 100.0, 150.0)))
        return (4.0, 4.0 + contrast) if self.light == "back" else (40.0 + contrast, 40.0)

    def limit(self, lens: float) -> float:
        """Return the smallest possible u of the position of a plain ball along its motion [px].

        This is the Cramér-Rao bound in closed form. It is exact for a ball at rest, and for a
        motion blur that is much longer than the edge and much shorter than the ball. `lens` is the
        standard deviation of the blur of the lens [px].
        """
        still = 2 * sqrt(lens**2 + 1 / 12) / (sqrt(pi) * self.radius)
        return sqrt(max(still, self.blur / (4 * self.radius))) / self.snr

    @property
    def noise(self) -> Noise:
        """Noise model of the camera, including rounding."""
        ball, behind = self.levels
        middle = (abs(ball - behind) / self.snr) ** 2
        return Noise(
            gain=0.8 * middle / ((ball + behind) / 2),
            read=0.2 * middle + ROUNDING,
            full_scale=FULL_SCALE,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorInput:
    """Input of a method to locate the ball."""

    clip: Clip
    regions: Regions
    start: Located
    noise: Noise
    lens: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Pictures of a case, true positions [px], shape (picture,), and the limit of u.

    Pictures with the same position of the ball within a pixel are consecutive.
    """

    inputs: EstimatorInput
    x: Array
    y: Array
    limit: float  # smallest possible u of the position of a plain ball along an axis [px]
