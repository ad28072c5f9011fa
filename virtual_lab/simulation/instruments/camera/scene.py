"""Scene of the camera: background light and bat."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.simulation.instruments.camera.lens import TrueLens

Pixels = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedBat:
    """A round bat that rotates about its pivot after the contact; distances from the pivot [m]."""

    pivot: tuple[float, float]  # X and Y
    stations: Array  # (station,), distance along the axis toward the tip
    half_widths: Array  # (station,)
    contact: Array  # (shot,), time of the contact [s]
    rate: Array  # (shot,), angular rate after it, away from the cannon [rad/s]

    def angle(self, shot: NDArray[np.intp], time: Array) -> Array:
        """Return the angle of the bat, (n,) [rad]."""
        return np.asarray(self.rate[shot] * np.maximum(time - self.contact[shot], 0.0))

    def edges(self, angle: Array, lens: TrueLens) -> tuple[Array, Array]:
        """Return the edge facing the cannon and the opposite edge, each (n, station, 2) [px]."""
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]

        def edge(side: float) -> Array:
            x = self.pivot[0] + self.stations * sine + side * self.half_widths * cosine
            y = self.pivot[1] + self.stations * cosine - side * self.half_widths * sine
            return lens.to_pixels(lens.to_camera(np.stack([x, y, np.zeros_like(x)], axis=-1)))

        return edge(-1.0), edge(1.0)


def background(spec: CameraSpec) -> Pixels:
    """Return the expected electrons per pixel of the background in an exposure, (row, column).

    The lamps are assumed to be steady; `flicker` returns their variation.
    """
    sensor, light = spec.sensor, spec.light
    x = (np.arange(sensor.columns) + 0.5) / sensor.columns - 0.5
    y = (np.arange(sensor.rows) + 0.5) / sensor.rows - 0.5
    rise = light.slope[0] * x + light.slope[1] * y[:, None]
    rise = rise + 2 * light.bowl * (x**2 + y[:, None] ** 2)
    return np.asarray(light.background * spec.electrons_per_rate * (1 + rise), np.float32)


def flicker(spec: CameraSpec, time: Array, phase: Array) -> Array:
    """Return the brightness of the lamps relative to their mean, in the arguments' common shape.

    `time` is in s. `phase` is the phase of the flicker at time 0, in turns.
    """
    turns = spec.light.flicker_frequency * time + phase
    return np.asarray(1 + spec.light.flicker * np.sin(2 * np.pi * turns))


def windows(picture: Pixels, corners: ArrayLike, side: int) -> Pixels:
    """Return square windows of a picture (row, column), each `side` pixels wide, (n, side, side).

    `corners`, (n, 2), are the first pixel (x, y) of each window. Raises `IndexError` for a window
    that extends beyond the right or lower edge. Negative corners are not checked.
    """
    views = np.lib.stride_tricks.sliding_window_view(picture, (side, side))
    x, y = np.asarray(corners).T
    return np.asarray(views[y, x], np.float32)
