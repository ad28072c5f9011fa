"""Regions of plain balls from the exact spectrum, with a stated signal-to-noise ratio."""

from dataclasses import dataclass
from functools import cache
from math import cos, sin

import numpy as np

from tests.video.spectrum import Floats, disc
from virtual_lab.video.locate.located import Located
from virtual_lab.video.locate.noise import Noise

__all__ = ["Balls", "balls", "located", "noise_of"]

BACKGROUND, HEADING = 40.0, 0.3
FIELD = 256
CONTRAST = {96: 150.0, 27: 100.0, 5: 40.0}  # contrast [DN] by the signal-to-noise ratio at the edge
cached = cache(disc)


@dataclass(frozen=True)
class Balls:
    """Regions with the true positions of their balls, ordered by (phase, repeat)."""

    regions: Floats
    x: Floats
    y: Floats
    radius: float
    blur: tuple[float, float]
    noise: Noise
    repeats: int

    def start(self, off: float = 0.5, seed: int = 7) -> Located:
        """Return starts with errors of up to `off` pixels in x and y, and of 1 % in the radius."""
        random = np.random.default_rng(seed)
        away = random.uniform(-off, off, (2, self.x.size))
        return located(self.x + away[0], self.y + away[1], 1.01 * self.radius, self.blur)


def located(x: Floats, y: Floats, radius: float, blur: tuple[float, float] = (0, 0)) -> Located:
    """Return the start of a fit for each position."""
    return Located.start(np.stack([x, y], axis=1), radius, np.array(blur))


def noise_of(snr: int) -> Noise:
    """Return the noise with this ratio halfway up the edge; a fifth of the variance is dark."""
    middle = (CONTRAST[snr] / snr) ** 2
    return Noise(gain=0.8 * middle / (BACKGROUND + CONTRAST[snr] / 2), read=0.2 * middle)


def balls(
    radius: float,
    blur: float,
    snr: int,
    *,
    slope: float = 0.0,
    phases: int = 4,
    repeats: int = 25,
    lens: float = 0.8,
    seed: int = 1,
    noisy: bool = True,
) -> Balls:
    """Return balls at several phases of a pixel, each repeat with fresh noise.

    `slope` is that of the background along x [DN/pixel].
    """
    noise = noise_of(snr)
    size = int(2 * radius + blur + 28)
    way = (blur * cos(HEADING), blur * sin(HEADING))
    offset = (FIELD - size) // 2
    inside = slice(offset, offset + size)
    random = np.random.default_rng(seed)
    behind = BACKGROUND + slope * (np.arange(size) - size / 2)
    centres = [(size / 2 + k / phases, size / 2 + 0.37 * k) for k in range(phases)]
    means = []
    for x, y in centres:
        m = cached(FIELD, x + offset, y + offset, radius, lens, way)[inside, inside]
        means.append(behind * (1 - m) + (BACKGROUND + CONTRAST[snr]) * m)
    mean = np.repeat(means, repeats, axis=0)
    true = np.repeat(centres, repeats, axis=0)
    shaken = random.standard_normal(mean.shape) * np.sqrt(noise.variance(mean))
    regions = mean + shaken if noisy else mean
    return Balls(regions, true[:, 0], true[:, 1], radius, way, noise, repeats)
