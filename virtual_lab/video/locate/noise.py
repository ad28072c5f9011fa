"""The noise of a camera's pixels by EMVA 1288: variance as a function of the mean.

V(mu) = K (mu - black) + (prnu (mu - black))^2 + read, in gray values squared. The terms are photon
noise, differences between pixels, and noise in the dark, which includes the rounding to whole gray
values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array

ROUNDING = 1 / 12  # variance of the rounding to whole gray values [DN^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Noise and defects that a camera adds to a picture. Gray values are in DN.

    Raises
    ------
    InputError
        A number is negative, or the black level is at least full scale.
    """

    gain: float  # system gain K [DN/e]
    read: float  # variance in the dark: dark current, reading, rounding [DN^2]
    black: float = 0.0  # gray value without light [DN]
    prnu: float = 0.0  # relative spread of the pixels' gains
    full_scale: float = np.inf  # highest gray value [DN]

    def __post_init__(self) -> None:
        sound = min(self.gain, self.prnu) >= 0 < self.read and self.black < self.full_scale
        if not sound:
            allowed = "allowed: 0 or more, read above 0, black below full_scale"
            names = "gain, read, black, prnu, full_scale"
            raise InputError("noise", names, self.figures, allowed)

    @property
    def figures(self) -> tuple[float, ...]:
        """The figures in the kernels' order."""
        return tuple(map(float, (self.gain, self.read, self.black, self.prnu, self.full_scale)))

    def variance(self, mean: ArrayLike) -> Array:
        """Return the variance of pixels with these mean gray values, same shape [DN^2]."""
        light = np.maximum(np.asarray(mean, float) - self.black, 0.0)
        return self.gain * light + (self.prnu * light) ** 2 + self.read

    @classmethod
    def from_frames(cls, frames: NDArray[np.generic], full_scale: float) -> Self:
        """Return the noise of frames of a still scene, by the photon-transfer method.

        `frames` (frame, row, col) are at least two, without the ball. The black level is assumed to
        be 0. Differences of successive frames only show temporal noise, so `prnu` is 0. Motion in a
        few pixels is excluded, and so is flicker, which changes all pixels equally.
        """
        first, second = frames[:-1].astype(float), frames[1:].astype(float)
        mean, change = (first + second).ravel() / 2, second - first
        change = (change - np.median(change, axis=(1, 2), keepdims=True)).ravel()
        usable = mean < 0.97 * full_scale
        mean, change = mean[usable], change[usable]
        count = min(24, max(1, mean.size // 400))
        bins = np.array_split(np.argsort(mean, kind="stable"), count)
        levels = np.array([mean[each].mean() for each in bins])
        spreads = np.array([_spread(change[each]) for each in bins])
        gain, read = _line(levels, np.maximum(spreads**2 / 2, ROUNDING))
        return cls(gain=gain, read=read, full_scale=full_scale)


def _spread(change: Array) -> float:
    """Return the robust standard deviation of a sample, interpolated between rounded values."""
    middle = np.abs(change) <= max(4 * np.median(np.abs(change)) / 0.6745, 3.0)
    return float(change[middle].std())


def _line(levels: Array, variances: Array) -> tuple[float, float]:
    """Return slope (at least 0) and intercept (at least `ROUNDING`) of variance over level."""
    from scipy.optimize import nnls

    weights = 1 / variances  # the standard deviation of a variance is proportional to it
    # A single level determines either slope or intercept, not both.
    if np.ptp(levels) < 0.1 * max(levels.max(), 1.0):
        return max(float(np.mean(variances) - ROUNDING) / max(levels.mean(), 1.0), 0.0), ROUNDING
    design = np.stack([np.maximum(levels, 0.0), np.ones_like(levels)], axis=1) * weights[:, None]
    gain, rest = nnls(design, (variances - ROUNDING) * weights)[0]
    return float(gain), float(rest) + ROUNDING
