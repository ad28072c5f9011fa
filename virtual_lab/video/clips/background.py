"""What stands behind the ball, learnt from some of a clip's frames."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.reading import Frame

__all__ = ["first_background", "light_ball", "uncovered_mean"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

ROWS = 64  # at a time: a sorted stack of whole frames would need the memory of them all
TOUCHED = 8.0  # noises that the brightness of a pixel must vary by for the ball to have been there
ENOUGH = 3  # frames that must show a pixel's background for their mean to be taken


def light_ball(samples: Frame) -> bool:
    """Return whether what moves through the frames is lighter than what is behind it.

    Most of the pixels it touches it covers for the lesser part of the time: the brightness they
    have for the greater part is their background's.
    """
    skew = 0.0
    for block in _blocks(samples):
        low, middle, high = _quantiles(block, (0.0, 0.5, 1.0))
        reach = high - low
        touched = reach > TOUCHED * max(float(np.median(reach)) / 4, 1.0)
        skew += float((low + high - 2 * middle)[touched].sum())
    return skew >= 0


def first_background(samples: Frame, *, light: bool) -> Image:
    """Return the background of a moving ball, (row, column), by a quantile on its far side.

    A pixel may be covered for up to two thirds of the frames.
    """
    share = 0.3 if light else 0.7
    both = [_quantiles(block, (share, 0.5)) for block in _blocks(samples)]
    found, middle = (np.concatenate([each[k] for each in both]) for k in (0, 1))
    # noise makes a quantile lie off the mean, alike in all pixels
    return np.asarray(found + np.median(middle - found), dtype=np.float32)


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


def _blocks(samples: Frame) -> Iterable[Frame]:
    for top in range(0, samples.shape[1], ROWS):
        yield samples[:, top : top + ROWS]


def _quantiles(block: Frame, shares: tuple[float, ...]) -> list[Image]:
    """Return quantiles over the samples: the mean of three neighbours, finer than whole DN."""
    ordered = np.sort(block, axis=0)
    last = len(block) - 1
    found = []
    for share in shares:
        middle = round(share * last)
        span = 0 if share in {0.0, 1.0} else 1
        low, high = max(0, middle - span), min(last, middle + span)
        found.append(ordered[low : high + 1].mean(axis=0, dtype=np.float32))
    return found
