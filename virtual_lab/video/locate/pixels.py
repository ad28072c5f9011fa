"""What the compiled loops know of one pixel: its noise, and whether full scale hides it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["BLACK", "OPTIONS", "TOP", "View", "untold", "variance"]

Floats = NDArray[np.float64]
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "cache": True,
    "nogil": True,
    "fastmath": True,
}
GAIN, READ, BLACK, PRNU, TOP = range(5)  # of `Noise.figures`


class View(NamedTuple):
    """A region, (row, column)."""

    pixels: Floats  # [DN]
    background: Floats  # [DN]


@njit(inline="always", **OPTIONS)
def variance(mean: float, noise: Floats) -> float:
    """Return a pixel's variance [DN²]."""
    light = max(mean - noise[BLACK], 0.0)
    odd = noise[PRNU] * noise[PRNU] * light
    return float(noise[READ] + light * (noise[GAIN] + odd))


@njit(inline="always", **OPTIONS)
def untold(value: float, mean: float, spread: float, top: float) -> bool:
    """Return whether full scale hides what a pixel of variance `spread` would have said."""
    room = top - mean
    return room * room < 9.0 * spread or (room < 0.0 and value >= top)
