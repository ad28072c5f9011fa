"""Pictures of a ball for every way of locating it: the same frames for all, their truth apart.

A case is a ball of one size, blur and light; its centres fall evenly into a pixel, places in the
frame and noise are fresh in each picture. The ratio of signal to noise is that of the contrast to
a pixel halfway up the edge; a fifth of that noise's variance is the dark's.
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
    """What is seen, in pixels and grey values; shares of its diameter hide the ball."""

    radius: float = 30.0
    blur: float = 2.0  # shift during the exposure
    snr: float = 96.0
    slope: float = 0.0  # of the background along x [DN/pixel]
    stitched: bool = False
    light: Literal["even", "soft", "back", "hard side"] = "even"
    cut: float = 0.0  # out of the frame
    covered: float = 0.0  # behind the bat
    exposure: float = 1.0  # over the right one: from 1.34 on the ball saturates
    hot: int = 0  # pixels at full scale in each picture
    flicker: float = 0.0  # of the light from picture to picture, amplitude
    radius_off: float = 0.01  # of the start, relative
    start_off: float = 0.5  # likewise, up to so many pixels each way
    quiet: bool = False  # no noise, no whole grey values: what is left is bias
    phases: int = 8
    repeats: int = 25

    @property
    def side(self) -> int:
        """Side of a region, as the tracker cuts it."""
        return 2 * ceil(1.1 * self.radius + self.blur / 2 + MARGIN) + 1

    @property
    def way(self) -> tuple[float, float]:
        """The ball's shift during the exposure, x and y."""
        return self.blur * cos(0.3), self.blur * sin(0.3)

    @property
    def levels(self) -> tuple[float, float]:
        """Grey values of a plain ball and of what is behind it: the noisier, the less apart."""
        contrast = float(np.interp(self.snr, (5.0, 27.0, 96.0), (40.0, 100.0, 150.0)))
        return (4.0, 4.0 + contrast) if self.light == "back" else (40.0 + contrast, 40.0)

    def limit(self, lens: float) -> float:
        """Return the least standard uncertainty of a plain ball's place along its motion [pixel].

        Cramér and Rao's bound in closed form, exact where the ball stands still and where its
        blur is long against the edge but not against the ball; `lens` is the standard deviation
        of the lens's blur [pixel].
        """
        still = 2 * sqrt(lens**2 + 1 / 12) / (sqrt(pi) * self.radius)
        return sqrt(max(still, self.blur / (4 * self.radius))) / self.snr

    @property
    def noise(self) -> Noise:
        """The camera's noise, rounding included."""
        ball, behind = self.levels
        middle = (abs(ball - behind) / self.snr) ** 2
        return Noise(
            gain=0.8 * middle / ((ball + behind) / 2),
            read=0.2 * middle + ROUNDING,
            full_scale=FULL_SCALE,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorInput:
    """What a way of locating the ball may know."""

    clip: Clip
    seen: Regions
    start: Located
    noise: Noise
    lens: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Pictures phase by phase, (phase x repeat), what is true of them, and the limit."""

    given: EstimatorInput
    x: Array
    y: Array
    limit: float  # least standard uncertainty of a plain ball's place along an axis [pixel]
