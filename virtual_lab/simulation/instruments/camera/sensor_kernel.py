"""Compiled conversion of expected electrons to noisy gray values, pixel by pixel."""

from __future__ import annotations

from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import INNER, Array

Pixels = NDArray[np.float32]
FAST: dict[str, Any] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy"}
DIM = np.float32(25)  # number of electrons below which the noise is exactly Poisson, not Gaussian
# reciprocals of electron numbers up to the largest of a dim pixel; a product is faster than a
# quotient
INVERSE = 1 / np.maximum(np.arange(128), 1)


class Electronics(NamedTuple):
    """Constants of the conversion from electrons to gray values [e, DN]."""

    read: float  # read noise
    full_well: float
    gain: float
    black: float
    whole: bool  # whether gray values are integers
    top: float  # largest gray value


@njit(**FAST, cache=True)
def expect(
    electrons: Pixels, corners: NDArray[np.int64], response: Pixels, dark: float, out: Pixels
) -> bool:
    """Fill `out` with expected electrons per pixel; return whether a pixel has fewer than 25.

    The expected electrons include the `dark` electrons. The noise of a pixel with fewer than 25
    must be drawn from a Poisson distribution instead of a normal one.

    Parameters
    ----------
    electrons
        Electrons before the sensor's response, (region, row, column). Negative numbers count as 0.
    corners
        First column and row of each region on the sensor, (region, 2).
    response
        Factor on the electrons of each pixel of the sensor, (row, column). It is 1 outside the
        sensor.
    dark
        Electrons that are added to each pixel.
    out
        Result, in the shape of `electrons`.
    """
    dim = 0
    rows, columns = response.shape
    for r in range(len(electrons)):
        left, top = corners[r, 0], corners[r, 1]
        for i in range(electrons.shape[1]):
            for j in range(electrons.shape[2]):
                row, column = top + i, left + j
                mean = electrons[r, i, j]
                if 0 <= row < rows and 0 <= column < columns:
                    mean *= response[row, column]
                mean = np.float32(max(mean, np.float32(0)) + dark)
                out[r, i, j] = mean
                dim += 1 if mean < DIM else 0
    return dim > 0


@njit(**INNER, **FAST)
def _poisson(mean: float, share: float) -> float:
    """Return the quantile of the Poisson distribution of `mean` at the probability `share`."""
    term = exp(-mean)
    below, count = term, 0
    while below < share and count < INVERSE.size - 1:
        count += 1
        term *= mean * INVERSE[count]
        below += term
    return float(count)


@njit(**FAST, cache=True)
def read_out(
    means: Pixels,
    corners: NDArray[np.int64],
    offset: Pixels,
    normal: Array,
    uniform: Array,
    wired: Electronics,
    out: Any,
) -> None:
    """Fill `out` (region, row, column) with gray values [DN], from 0 to the largest gray value.

    Parameters
    ----------
    means
        Expected electrons, in the shape of `out`.
    corners
        First column and row of each region on the sensor, (region, 2).
    offset
        Dark signal of each pixel of the whole sensor, (row, column) [e].
    normal
        Standard normal numbers, in the shape of `out`. A pixel below 25 expected electrons uses its
        number for the readout noise. Any other pixel uses it for the sum of readout noise and
        Poisson noise.
    uniform
        Uniform numbers from -0.5 to 0.5, in the shape of `out`. A pixel below 25 expected electrons
        uses its number for the Poisson noise. If the number is exactly 0, there is no Poisson
        noise.
    wired
        Constants of the electronics.
    out
        Result.
    """
    read, full_well, gain, black, whole, top = wired
    rows, columns = offset.shape
    for r in range(len(means)):
        left, above = corners[r, 0], corners[r, 1]
        for i in range(means.shape[1]):
            for j in range(means.shape[2]):
                mean = means[r, i, j]
                if mean >= DIM:
                    value = min(mean + sqrt(mean + read * read) * normal[r, i, j], full_well)
                else:
                    share = uniform[r, i, j]
                    value = mean if share == 0 else _poisson(mean, share + 0.5)
                    value += read * normal[r, i, j]
                row, column = above + i, left + j
                if 0 <= row < rows and 0 <= column < columns:
                    value += offset[row, column]
                grey = gain * value + black
                if whole:
                    grey = np.floor(grey + 0.5)
                out[r, i, j] = min(max(grey, 0.0), top)
