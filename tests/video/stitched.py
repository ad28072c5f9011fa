"""Regions of stitched balls under three lights, with known truth and noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.video.plain import located, noise_of
from virtual_lab.simulation.instruments.camera.ball import Light, axes_of, render_balls
from virtual_lab.simulation.instruments.camera.spec import BallLook
from virtual_lab.video.locate.located import Located
from virtual_lab.video.locate.noise import Noise

__all__ = ["Scene", "scene"]

Array = NDArray[np.float64]
LENS, HEADING = 0.7, 0.3


def toward(*way: float) -> tuple[float, float, float]:
    """Return the unit vector toward a lamp."""
    x, y, z = np.array(way) / np.linalg.norm(way)
    return float(x), float(y), float(z)


# light, gray value of the background, and gray value of a white surface that faces the lamp
LIGHTS = {
    "soft": (Light(ambient=0.6, toward=toward(0, -0.3, -1), softness=0.6), 40.0, 215.0),
    "back": (Light(), 155.0, 4.0),
    "side": (Light(ambient=0.12, toward=toward(-0.2, -0.9, -0.4), softness=0.05), 15.0, 215.0),
}


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Balls in random orientations, one per region."""

    regions: Array
    x: Array
    y: Array
    radius: float
    blur: tuple[float, float]
    noise: Noise

    @property
    def corners(self) -> Array:
        """Return the corners of the regions in the frame, here all zero."""
        return np.zeros((len(self.x), 2))

    def start(self, off: float = 0.5, seed: int = 7) -> Located:
        """Return starts with errors of up to `off` pixels in x and y, and 0.5 % in the radius."""
        away = np.random.default_rng(seed).uniform(-off, off, (2, self.x.size))
        return located(self.x + away[0], self.y + away[1], 1.005 * self.radius, self.blur)


def scene(
    light: str,
    blur: float = 2.0,
    *,
    count: int = 100,
    radius: float = 30.0,
    snr: int = 96,
    seams: float = 0.6,
    seed: int = 11,
    stretch: float = 1.0,
) -> Scene:
    """Return balls before an even background. `snr` is that of a step of 150 DN.

    `stretch`: ratio of the axes of elliptic outlines, the longer axis 30 degrees from x.
    """
    lamp, behind, white = LIGHTS[light]
    random = np.random.default_rng(seed)
    size = int(2 * radius + blur + 28)
    centre = size / 2 + random.uniform(-0.5, 0.5, (count, 2))
    way = blur * np.array([np.cos(HEADING), np.sin(HEADING)])
    turn = random.normal(size=(count, 3))
    turn *= (random.uniform(0, np.pi, count) / np.linalg.norm(turn, axis=1))[:, None]
    axis = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    warp = np.zeros((count, 2, 5))
    root = np.sqrt(stretch)
    warp[:, :, :2] = radius * (np.eye(2) / root + (root - 1 / root) * np.outer(axis, axis))
    rendered = render_balls(
        np.stack([centre - way / 2, centre + way / 2], axis=1),
        radius,
        np.zeros((count, 2)),
        (size, size),
        sigma=LENS,
        look=BallLook(albedo=0.85, seam_contrast=seams),
        light=lamp,
        orientation=axes_of(turn),
        warp=None if stretch == 1.0 else warp,
    )
    mean = rendered.over(np.full((1, size, size), behind), white).astype(float)
    noise = noise_of(snr)
    shaken = random.standard_normal(mean.shape) * np.sqrt(noise.variance(mean))
    return Scene(
        regions=mean + shaken,
        x=centre[:, 0],
        y=centre[:, 1],
        radius=radius,
        blur=(float(way[0]), float(way[1])),
        noise=noise,
    )
