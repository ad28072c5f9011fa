"""The background of a clip: a wall, a floor before it, and fittings of a room."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Backdrop", "paint"]

Image = NDArray[np.float32]
Colour = tuple[float, float, float]  # blue, green, red, gray values


@dataclass(frozen=True, kw_only=True)
class Backdrop:
    """Colors and textures; amplitudes are standard deviations in gray values."""

    wall: Colour = (172, 178, 180)
    floor: Colour = (140, 145, 150)
    slope: Colour = (0.0, 18.0, 0.0)  # brightening to the right, darkening downward, slow blotches
    grain: float = 2.0
    grain_size: float = 1.2  # px
    specks: float = 0.0  # share of the wall under dark specks
    floor_grain: float = 6.0
    skirting: float = 0.0  # height of a bright board along the floor [px]
    joints: int = 0  # number of upright lines on the wall
    plates: int = 1  # number of sockets, knobs and pictures
    tiles: bool = False


def paint(
    look: Backdrop,
    size: tuple[int, int],
    edge: tuple[float, float] | None,
    rng: np.random.Generator,
    margin: int,
) -> Image:
    """Return the picture without a ball, (rows, columns, 3), larger by `margin` on each side.

    `edge`: rows at which wall and floor meet, at the left and right ends of the picture proper.
    """
    columns, rows = size[0] + 2 * margin, size[1] + 2 * margin
    row, column = np.mgrid[:rows, :columns].astype(np.float32)
    picture = np.empty((rows, columns, 3), np.float32)
    picture[:] = look.wall
    across, down, blotches = look.slope
    picture += (across * (column / columns - 0.5) + down * (0.5 - row / rows))[..., None]
    picture += blotches * _noise((rows, columns), 0.12 * columns, rng)[..., None]
    picture += look.grain * _noise((rows, columns), look.grain_size, rng)[..., None]
    if look.specks:
        spots = _noise((rows, columns), 0.9, rng)
        dark = np.quantile(spots, look.specks)
        picture -= (40 * np.clip((dark - spots) * 2, 0, 1))[..., None]
    for x in rng.uniform(0, columns, look.joints):
        cv2.line(picture, (int(x), 0), (int(x), rows), _darker(picture, 0.75), 1)
    for _ in range(look.plates):
        _plate(picture, margin, size, rng)
    if edge is not None:
        _floor(picture, look, (edge[0] + margin, edge[1] + margin), rng)
    return cv2.GaussianBlur(picture, (0, 0), 0.7)


def _floor(
    picture: Image, look: Backdrop, edge: tuple[float, float], rng: np.random.Generator
) -> None:
    rows, columns = picture.shape[:2]
    ends = np.array([[0, edge[0]], [columns, edge[1]], [columns, rows], [0, rows]])
    inside = np.zeros((rows, columns), np.float32)
    cv2.fillPoly(inside, [np.round(ends * 16).astype(np.int32)], 1.0, shift=4)
    floor = np.empty_like(picture)
    floor[:] = look.floor
    floor += look.floor_grain * _noise((rows, columns), 1.0, rng)[..., None]
    if look.tiles:
        middle, level = columns / 2, edge[0]
        for k in range(-6, 7):
            start = (int(middle + 60 * k), int(level))
            stop = (int(middle + 60 * k * 2.2), int(level + rows / 2))
            cv2.line(floor, start, stop, _darker(floor, 0.85), 1, cv2.LINE_AA)
        for k in range(1, 5):
            y = int(level + 5 * k**1.7)
            cv2.line(floor, (0, y), (columns, y), _darker(floor, 0.9), 1)
    near = np.arange(rows, dtype=np.float32)[:, None] - np.linspace(*edge, columns)
    floor *= (1 - 0.25 * np.exp(-np.abs(near) / 8))[..., None]
    share = inside[..., None]
    picture[:] = picture * (1 - share) + floor * share
    if look.skirting:
        board = (near < 0) & (near > -look.skirting)
        picture[board] = np.minimum(picture[board] + 18, 250)
        lip = np.abs(near + look.skirting) < 0.8
        picture[lip] *= 0.8


def _plate(picture: Image, margin: int, size: tuple[int, int], rng: np.random.Generator) -> None:
    wide, high = rng.uniform(0.04, 0.10, 2) * size[0]
    x = margin + rng.uniform(0.55, 0.95) * (size[0] - wide)
    y = margin + rng.uniform(0.1, 0.55) * (size[1] - high)
    first, last = (int(x), int(y)), (int(x + wide), int(y + high))
    cv2.rectangle(picture, first, last, _darker(picture, rng.choice([0.3, 0.75, 1.15])), -1)
    cv2.rectangle(picture, first, last, _darker(picture, 0.65), 1)


def _darker(picture: Image, share: float) -> Colour:
    b, g, r = (float(np.clip(share * v, 5, 250)) for v in picture[::16, ::16].mean(axis=(0, 1)))
    return b, g, r


def _noise(shape: tuple[int, int], size: float, rng: np.random.Generator) -> Image:
    """Return smooth noise with standard deviation 1 and grains of `size` pixels."""
    coarse = max(1, int(size / 2))
    small = (-(-shape[0] // coarse) + 2, -(-shape[1] // coarse) + 2)
    noise = rng.standard_normal(small, np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), max(size / coarse, 0.3))
    if coarse > 1:
        noise = cv2.resize(noise, None, fx=coarse, fy=coarse, interpolation=cv2.INTER_CUBIC)
    noise = noise[: shape[0], : shape[1]]
    return (noise - noise.mean()) / noise.std()
