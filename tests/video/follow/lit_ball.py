"""A shaded ball thrown before a wall, filmed by a renderer that shares no code with the others.

It uses a pinhole, Lambert's law, small steps of Newton's law with drag, sRGB and JPEG. It uses
neither the package's flights, projection and disk nor the scenery of the other tests. Units are
meters and seconds; up is positive.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

LIGHTS = ("side", "soft", "flat")
DIAMETER = 0.073
STEP = 2e-4  # step of the flight [s]


@dataclass(frozen=True, kw_only=True)
class Throw:
    """One clip; other properties are drawn from light and seed."""

    light: str
    seed: int
    rows: int = 480
    columns: int = 640
    count: int = 130
    fps: float = 120.0
    radius: float = 11.0  # radius of the ball [pixels]
    tilt: float = 5.0  # largest angle of the camera up or down [degrees]


@dataclass(frozen=True, kw_only=True)
class Filmed:
    """Pictures of a clip, and their truth."""

    frames: NDArray[np.uint8]  # (frame, row, column)
    gravity: float
    metres_per_pixel: float  # scale in the middle of the picture
    speeds: tuple[float, float]  # speeds before and after the first bounce
    restitution: float


def film(throw: Throw) -> Filmed:
    """Film a throw, and return the clip."""
    draw = np.random.default_rng([throw.seed, LIGHTS.index(throw.light)])
    gravity = draw.uniform(9.79, 9.83)
    mass, drag = draw.uniform(0.06, 0.16), draw.uniform(0.42, 0.52)
    slowing = 0.5 * 1.2 * drag * np.pi * DIAMETER**2 / 4 / mass
    restitution, rubbing = draw.uniform(0.55, 0.8), draw.uniform(0.75, 0.95)
    unit = DIAMETER / 2 / throw.radius
    wide, high = unit * throw.columns, unit * throw.rows
    floor = -0.42 * high
    place = np.array([-0.45 * wide, floor + high * draw.uniform(0.5, 0.75)])
    velocity = np.array([wide * draw.uniform(0.7, 0.9), draw.uniform(-0.5, 0.8)])
    exposure = draw.uniform(0.1, 0.4) / throw.fps
    positions, speeds = [], []
    per_frame = round(1 / throw.fps / STEP)
    step = 1 / throw.fps / per_frame
    open_for = max(1, round(exposure / step))
    for k in range(throw.count * per_frame):
        if k % per_frame < open_for:
            positions.append(place.copy())
        pull = np.array([0.0, -gravity]) - slowing * np.hypot(*velocity) * velocity
        place = place + velocity * step + pull * step**2 / 2
        velocity = velocity + pull * step
        if place[1] < floor + DIAMETER / 2 and velocity[1] < 0:
            speeds.append(float(np.hypot(*velocity)))
            velocity = velocity * [rubbing, -restitution]
            speeds.append(float(np.hypot(*velocity)))
    ways = np.array(positions).reshape(throw.count, open_for, 2)
    return Filmed(
        frames=_pictures(throw, ways, draw),
        gravity=gravity,
        metres_per_pixel=unit,
        speeds=(speeds[0], speeds[1]),
        restitution=restitution,
    )


def _pictures(
    throw: Throw, ways: NDArray[np.float64], draw: np.random.Generator
) -> NDArray[np.uint8]:
    """Return pictures of a ball at positions (frame, moment, 2), coded as sRGB and JPEG."""
    pitch, roll = np.radians(draw.uniform(-1, 1, 2) * [throw.tilt, 3.0])
    focal = draw.uniform(1.1, 1.5) * throw.columns
    far = focal * DIAMETER / 2 / throw.radius
    light = _light(throw.light, draw)
    albedo = draw.uniform(0.6, 0.9)
    noise, quality = draw.uniform(1.0, 2.5), int(draw.integers(85, 97))
    wall = _wall(throw, draw)
    frames = np.empty((throw.count, throw.rows, throw.columns), np.uint8)
    for k, way in enumerate(ways[:, :: max(1, ways.shape[1] // 6)]):
        picture = wall.copy()
        cover = np.zeros_like(picture)
        shine = np.zeros_like(picture)
        for x, y in way:
            # camera turned by its pitch about the horizontal, then by its roll
            up, away = y * np.cos(pitch), far + y * np.sin(pitch)
            right, up = x * np.cos(roll) - up * np.sin(roll), x * np.sin(roll) + up * np.cos(roll)
            column = (throw.columns - 1) / 2 + focal * right / away
            row = (throw.rows - 1) / 2 - focal * up / away
            _add(cover, shine, column, row, focal * DIAMETER / 2 / away, light, albedo)
        picture = picture * (1 - cover / len(way)) + shine / len(way)
        picture = cv2.GaussianBlur(picture, (0, 0), 0.6)
        code = 255 * np.clip(picture, 0, 1) ** (1 / 2.2) + draw.normal(0, noise, picture.shape)
        coded = cv2.imencode(
            ".jpg", np.clip(code, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality]
        )[1]
        frames[k] = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)
    return frames


def _light(kind: str, draw: np.random.Generator) -> tuple[NDArray[np.float64], float, float, float]:
    """Return the direction to the light, and the shares of hard, half-space and even light."""
    turn = draw.uniform(-40, 220)  # angle about the view [degrees]: from a side, or from above
    rise = draw.uniform(0, 25) if kind == "side" else draw.uniform(10, 50)  # toward the camera
    along = np.cos(np.radians(rise))
    toward = np.array(
        [
            along * np.cos(np.radians(turn)),
            along * np.sin(np.radians(turn)),
            np.sin(np.radians(rise)),
        ]
    )
    parts = {"side": (0.75, 0.0, 0.06), "soft": (0.0, 0.75, 0.08), "flat": (0.0, 0.0, 0.75)}
    return toward, *parts[kind]


def _add(
    cover: NDArray[np.float64],
    shine: NDArray[np.float64],
    column: float,
    row: float,
    radius: float,
    light: tuple[NDArray[np.float64], float, float, float],
    albedo: float,
    fine: int = 5,
) -> None:
    """Add a sphere's share of each pixel and its light, with `fine` samples in each direction."""
    rows, columns = cover.shape
    left, top = int(np.floor(column - radius)) - 1, int(np.floor(row - radius)) - 1
    side = int(2 * radius) + 4
    if left < 0 or top < 0 or left + side > columns or top + side > rows:
        return
    grid = (np.arange(side * fine) + 0.5) / fine - 0.5
    u, v = np.meshgrid((left + grid - column) / radius, -(top + grid - row) / radius)
    inside = u**2 + v**2 < 1
    depth = np.sqrt(np.maximum(0, 1 - u**2 - v**2))
    toward, hard, half, even = light
    cosine = toward[0] * u + toward[1] * v + toward[2] * depth
    bright = albedo * (hard * np.maximum(cosine, 0) + half * (1 + cosine) / 2 + even) * inside

    def pixels(samples: NDArray[np.generic]) -> NDArray[np.float64]:
        return samples.reshape(side, fine, side, fine).mean(axis=(1, 3))

    cut = np.s_[top : top + side, left : left + side]
    cover[cut] += pixels(inside)
    shine[cut] += pixels(bright)


def _wall(throw: Throw, draw: np.random.Generator) -> NDArray[np.float64]:
    """Return a wall with a pattern, darker than the ball's bright side."""
    level = draw.uniform(0.02, 0.12)
    pattern = cv2.GaussianBlur(draw.normal(0, 1, (throw.rows, throw.columns)), (0, 0), 4)
    wall = level * (1 + 0.25 * pattern / pattern.std())
    shelf = int(draw.uniform(0.2, 0.8) * throw.columns)
    wall[:, shelf : shelf + 6] *= 1.4
    return np.clip(wall, 0.005, 1)
