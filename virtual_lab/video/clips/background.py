"""What stands behind the ball, learnt from some of a clip's frames."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.reading import Frame

__all__ = ["Image", "middle_of", "uncovered_mean"]

Image = NDArray[np.float32]

ROWS = 64  # at a time: a sorted stack of whole frames would need the memory of them all
ENOUGH = 3  # frames that must show a pixel's background for their mean to be taken


def middle_of(samples: Frame) -> Image:
    """Return the median of samples, (row, column)."""
    tops = range(0, samples.shape[1], ROWS)
    blocks = [np.median(samples[:, top : top + ROWS], axis=0) for top in tops]
    return np.concatenate(blocks).astype(np.float32)


def uncovered_mean(
    samples: Frame, first: Image, covered: Iterable[list[tuple[float, float, float]]]
) -> Image:
    """Return the mean of the samples where the ball did not cover them.

    Parameters
    ----------
    samples
        (sample, row, column).
    first
        What is taken where fewer than three samples show the background.
    covered
        x, y and reach [pixels] of what moves in each sample.
    """
    total = np.zeros(first.shape, np.float32)
    count = np.zeros(first.shape, np.float32)
    for sample, spots in zip(samples, covered, strict=True):
        free = np.ones(first.shape, bool)
        for x, y, reach in spots:
            top, left = max(0, int(y - reach)), max(0, int(x - reach))
            rows, columns = np.ogrid[
                top : min(first.shape[0], int(y + reach) + 2),
                left : min(first.shape[1], int(x + reach) + 2),
            ]
            free[rows, columns] &= np.hypot(columns - x, rows - y) > reach
        total += np.where(free, sample, 0)
        count += free
    return np.where(count >= ENOUGH, total / np.maximum(count, 1), first).astype(np.float32)
