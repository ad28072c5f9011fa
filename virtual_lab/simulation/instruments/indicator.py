"""What all indicating instruments share: offset, repeatability, and a scale of finite steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.simulation.arrays import Array
from virtual_lab.streams import Draws, Slots

__all__ = ["indicate", "quantise"]


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
    items: Slots | None = None,
) -> Array:
    """Return readings of shape (item, repeat) of the true values, shape (item,).

    A reading's noise belongs to its item's number in `items`, (item,), in turn without them, and
    to the repeat.
    """
    values = np.atleast_1d(np.asarray(true, dtype=float))
    items = np.arange(values.size) if items is None else items
    noise = repeatability * draws.normal(name, repeats, items)
    return quantise(values[:, None] + offset + noise, resolution)
