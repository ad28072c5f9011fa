"""A sphere in a pinhole camera: outline by rays, shading, and spots that turn with the sphere."""

import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.motion import Ball

__all__ = ["sphere"]

Image = NDArray[np.float32]


def sphere(
    rays: NDArray[np.float64],
    centres: NDArray[np.float64],
    focal: float,
    look: Ball,
    turn: float,
    lamp: tuple[float, float, float] = (-0.35, -0.8, -0.5),
    ambient: float = 0.5,
) -> tuple[Image, Image]:
    """Return the light (row, column, 3) and the ball's share of each pixel, over sub-exposures.

    Parameters
    ----------
    rays
        Rays through the pixels, (row, column, 3), third component 1.
    centres
        Centers of the sphere in the camera's axes, by sub-exposure and row, (sub, row, 3) [m].
    focal
        Focal length [pixels].
    look
        Ball with its radius, color and texture.
    turn
        Angle of the ball in the plane of the picture [rad].
    lamp
        Direction to the lamp, with y down and z away from the camera.
    ambient
        Share of the light that comes from all sides.
    """
    toward = np.array(lamp) / np.linalg.norm(lamp)
    halfway = (toward - [0, 0, 1]) / np.linalg.norm(toward - [0, 0, 1])  # between lamp and camera
    unit = (rays / np.linalg.norm(rays, axis=2, keepdims=True)).astype(np.float32)
    centre = centres[:, :, None, :].astype(np.float32)
    along = (unit * centre).sum(axis=3, keepdims=True)
    off = unit * along - centre  # vector from the center perpendicular to the ray
    miss = np.sqrt((off**2).sum(axis=3))
    per_pixel = centres[..., 2].mean() / focal
    share = np.clip(0.5 + (look.radius - miss) / per_pixel, 0, 1)
    depth = np.sqrt(np.maximum(0, 1 - (miss / look.radius) ** 2))
    normal = off / look.radius - unit * depth[..., None]
    lit = ambient + (1 - ambient) * np.maximum(0, normal @ toward.astype(np.float32))
    lit *= _spots(normal, look, turn)
    shine = look.gloss * np.maximum(0, normal @ halfway.astype(np.float32)) ** 24
    weight = share / len(centres)
    light = (weight * lit).sum(axis=0)[..., None] * np.array(look.colour, np.float32)
    light += (weight * shine).sum(axis=0)[..., None]
    return light, weight.sum(axis=0)


def _spots(normal: Image, look: Ball, turn: float) -> Image:
    """Return the relative brightness of the surface: a few waves over the sphere."""
    rng = np.random.default_rng(look.facing)
    waves = rng.standard_normal((4, 3)) * 3.0
    cos, sin = np.cos(turn), np.sin(turn)
    back = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])  # rotation into the ball's axes
    angle = normal @ (waves @ back).T.astype(np.float32) + rng.uniform(0, 6, 4).astype(np.float32)
    return 1 + look.texture * np.sin(angle).sum(axis=-1) / 2
