"""Compiled drawing of the silhouette of a bat into regions."""

from __future__ import annotations

from math import erf, sqrt
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import INNER, Array

Pixels = NDArray[np.float32]
FAST: dict[str, Any] = {"fastmath": True, "error_model": "numpy"}


@njit(**INNER, **FAST)
def _step(z: float) -> float:
    """Return the cumulative normal distribution at z."""
    if z > 6.0:
        return 1.0
    return 0.0 if z < -6.0 else 0.5 * (1 + erf(z / sqrt(2.0)))


@njit(**INNER, **FAST)
def _crossing(edge: Array, y: float) -> tuple[float, float]:
    """Return x and the cosine of the slope of an edge (station, 2) at y, which falls along it."""
    k = 0
    while k < len(edge) - 2 and edge[k + 1, 1] > y:
        k += 1
    dx, dy = edge[k + 1, 0] - edge[k, 0], edge[k + 1, 1] - edge[k, 1]
    slope = dx / dy
    return edge[k, 0] + slope * (y - edge[k, 1]), 1 / sqrt(1 + slope * slope)


@njit(**FAST, cache=True)
def hide_behind(
    near: Array,
    far: Array,
    corners: NDArray[np.int64],
    light: Array,
    white: float,
    blur: float,
    electrons: Pixels,
) -> None:
    """Draw a bat over the pictures in `electrons`, so that it hides what is behind it.

    Parameters
    ----------
    near, far
        Left and right edges of the bat, from the pivot to the tip, (region, station, 2) [px].
    corners
        First pixel (x, y) of each region, (region, 2).
    light
        Direction to the lamp in the axes of the camera (three numbers), ambient share of the light,
        and softness of the light, (5,).
    white
        Electrons per pixel of the bat where its surface faces the lamp [e].
    blur
        Standard deviation of the blur of the edges [px].
    electrons
        Pictures, which are changed, (region, row, column) [e].
    """
    for r in range(len(electrons)):
        last = near.shape[1] - 1
        tip = 0.5 * (near[r, last, 1] + far[r, last, 1])
        for i in range(electrons.shape[1]):
            y = corners[r, 1] + i
            end = _step((y - tip) / blur)
            if end == 0.0:
                continue
            left, left_cos = _crossing(near[r], y)
            right, right_cos = _crossing(far[r], y)
            for j in range(electrons.shape[2]):
                x = corners[r, 0] + j
                cover = end * _step((x - left) * left_cos / blur)
                cover *= _step((right - x) * right_cos / blur)
                if cover == 0.0:
                    continue
                u = min(max((2 * x - left - right) / (right - left), -1.0), 1.0)
                facing = light[0] * u - light[2] * sqrt(1 - u * u)
                lit = max(facing + light[4], 0.0) / (1 + light[4])
                shine = light[3] + (1 - light[3]) * lit
                electrons[r, i, j] += cover * (white * shine - electrons[r, i, j])
