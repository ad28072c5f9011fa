"""Clips of a plain ball, rendered by exact areas. They share no code with the tracker."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROWS = 24  # chords per pixel, which give the area of a disk to 1e-4 of a pixel


def disc(shape: tuple[int, int], x: float, y: float, radius: float) -> Array:
    """Return each pixel's share of a disk, from chords of thin rows that the pixels cut exactly."""
    rows, columns = shape
    across = (np.arange(rows * ROWS) + 0.5) / ROWS - 0.5 - y
    half = np.sqrt(np.maximum(0.0, radius**2 - across**2))[:, None]
    left = np.arange(columns) - 0.5 - x
    chord = np.clip(np.minimum(left + 1, half) - np.maximum(left, -half), 0, 1)
    return chord.reshape(rows, ROWS, columns).mean(axis=1)


def matte(
    shape: tuple[int, int],
    x: float,
    y: float,
    radius: float,
    blur: tuple[float, float] = (0, 0),
    lens: float = 0.7,
) -> Array:
    """Return each pixel's share of a blurred ball that moves by `blur` pixels in the exposure."""
    left, top = int(x - radius - 12 - abs(blur[0])), int(y - radius - 12 - abs(blur[1]))
    right, bottom = int(x + radius + 14 + abs(blur[0])), int(y + radius + 14 + abs(blur[1]))
    small = (bottom - top, right - left)
    steps = 1 if blur == (0, 0) else 4 + 2 * int(np.hypot(*blur))
    part = np.zeros(small)
    for step in (np.arange(steps) + 0.5) / steps - 0.5:
        part += disc(small, x - left + step * blur[0], y - top + step * blur[1], radius) / steps
    part = cv2.GaussianBlur(part, (0, 0), lens)
    whole = np.zeros(shape)
    rows = slice(max(top, 0), max(0, min(bottom, shape[0])))
    columns = slice(max(left, 0), max(0, min(right, shape[1])))
    whole[rows, columns] = part[
        rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
    ]
    return whole


@dataclass(frozen=True, kw_only=True)
class Film:
    """A ball that flies in, is struck at time 0 and flies off. Units are pixels and frames."""

    shape: tuple[int, int] = (200, 320)
    radius: float = 14.0
    contact: tuple[float, float] = (230.0, 100.0)
    velocity_in: tuple[float, float] = (9.3, 1.1)  # pixels per frame
    velocity_out: tuple[float, float] = (-5.2, 1.7)
    before: float = 18.4  # frames from the first frame to the contact
    count: int = 44
    shutter: float = 0.1  # share of a frame
    gravity: tuple[float, float] = (0.0, 0.0)  # pixels per frame squared
    light: float = 180.0  # gray value of the ball
    dark: float = 40.0  # gray value of the background at its left side
    slope: float = 30.0  # increase of the background from left to right
    noise: float = 1.5
    seed: int = 1
    bat: bool = False

    @property
    def t(self) -> Array:
        """Frames since the contact."""
        return np.arange(self.count) - self.before

    def places(self) -> tuple[Array, ...]:
        """Return x and y of the true centers, by frame."""
        t = self.t
        before = t < 0
        return tuple(
            self.contact[k]
            + np.where(before, self.velocity_in[k], self.velocity_out[k]) * t
            + self.gravity[k] / 2 * t**2
            for k in (0, 1)
        )

    def frames(self, full: float = 255.0) -> list[NDArray[np.generic]]:
        """Return the frames as 8-bit pictures, or as 16-bit pictures if `full` is above 255."""
        return _drawn(self, full)

    def draw(self, full: float) -> Iterator[NDArray[np.generic]]:
        """Yield the frames, as `frames` does."""
        rng = np.random.default_rng(self.seed)
        behind = self.dark + self.slope * np.linspace(0, 1, self.shape[1])
        depth = np.uint8 if full <= 255 else np.uint16
        for t, x, y in zip(self.t, *self.places(), strict=True):
            velocity = self.velocity_in if t < 0 else self.velocity_out
            blur = (self.shutter * velocity[0], self.shutter * velocity[1])
            scene = np.broadcast_to(behind, self.shape).copy()
            if self.bat:  # dark bar that recoils and swings
                place = self.contact[0] + self.radius + 3 + max(0.0, 1.5 * t)
                columns = np.arange(self.shape[1]) - 0.02 * max(0.0, t) * 10
                scene[:, (columns > place) & (columns < place + 26)] = 90.0
            share = matte(self.shape, x, y, self.radius, blur)
            image = scene * (1 - share) + self.light * share
            noisy = (image + self.noise * rng.standard_normal(self.shape)) * full / 255
            yield np.clip(np.round(noisy), 0, full).astype(depth)


@lru_cache(maxsize=8)
def _drawn(film: Film, full: float) -> list[NDArray[np.generic]]:
    return list(film.draw(full))


def write_video(path: Path, frames: list[NDArray[np.generic]], rate: float) -> Path:
    """Write frames without loss (FFV1), in gray of 8 or 16 bits or in color."""
    rows, columns = frames[0].shape[:2]
    options = [cv2.VIDEOWRITER_PROP_IS_COLOR, int(frames[0].ndim == 3)]
    if frames[0].dtype == np.uint16:
        options += [cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U]
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate, (columns, rows), options)
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path
