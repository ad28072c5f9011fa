"""What stands before the camera: the light behind the ball, and the bat."""

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
    """A round bat that turns about its pivot once it was hit; distances from the pivot on [m]."""

    pivot: tuple[float, float]  # X and Y
    stations: Array  # along the axis toward the tip, (station,)
    half_widths: Array  # (station,)
    contact: Array  # (shot,) [s]
    rate: Array  # of turning after it, away from the cannon, (shot,) [rad/s]

    def angle(self, shot: NDArray[np.intp], time: Array) -> Array:
        """Return how far the bat has turned, (n,) [rad]."""
        return np.asarray(self.rate[shot] * np.maximum(time - self.contact[shot], 0.0))

    def edges(self, angle: Array, lens: TrueLens) -> tuple[Array, Array]:
        """Return the edges toward the cannon and away from it, each (n, station, 2) [px]."""
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]

        def edge(side: float) -> Array:
            x = self.pivot[0] + self.stations * sine + side * self.half_widths * cosine
            y = self.pivot[1] + self.stations * cosine - side * self.half_widths * sine
            return lens.drawn(lens.seen(np.stack([x, y, np.zeros_like(x)], axis=-1)))

        return edge(-1.0), edge(1.0)


def background(spec: CameraSpec) -> Pixels:
    """Return the electrons that the light behind the ball frees, (row, column), at rest."""
    sensor, light = spec.sensor, spec.light
    x = (np.arange(sensor.columns) + 0.5) / sensor.columns - 0.5
    y = (np.arange(sensor.rows) + 0.5) / sensor.rows - 0.5
    rise = light.slope[0] * x + light.slope[1] * y[:, None]
    rise = rise + 2 * light.bowl * (x**2 + y[:, None] ** 2)
    return np.asarray(light.background * spec.exposed * (1 + rise), np.float32)


def flicker(spec: CameraSpec, time: Array, phase: Array) -> Array:
    """Return how bright all lamps burn at times [s] since a phase [turns], relative."""
    turns = spec.light.flicker_frequency * time + phase
    return np.asarray(1 + spec.light.flicker * np.sin(2 * np.pi * turns))


def windows(picture: Pixels, corners: ArrayLike, side: int) -> Pixels:
    """Return squares of a picture (row, column) from their first pixels (n, 2): (n, side, side)."""
    views = np.lib.stride_tricks.sliding_window_view(picture, (side, side))
    x, y = np.asarray(corners).T
    return np.asarray(views[y, x], np.float32)
