"""What all indicating instruments share: offset, repeatability, and a scale of finite steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.streams import Draws

__all__ = ["indicate", "quantise"]

Array = NDArray[np.float64]


def quantise(values: ArrayLike, step: float) -> Array:
    """Return `values` rounded to whole steps; a step of 0 is a scale without steps."""
    exact = np.asarray(values, dtype=float)
    return np.rint(exact / step) * step if step else exact


def indicate(
    true: ArrayLike,
    *,
    offset: float,
    repeatability: float,
    resolution: float,
    repeats: int,
    draws: Draws,
    name: str,
    block: int = 0,
) -> Array:
    """Return readings of shape (item, repeat) of the true values, shape (item,)."""
    values = np.atleast_1d(np.asarray(true, dtype=float))
    noise = repeatability * draws.normal(name, (values.size, repeats), block)
    return quantise(values[:, None] + offset + noise, resolution)
