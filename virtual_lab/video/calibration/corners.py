"""The corners of a board, each by a blurred crossing of two edges fitted to its pixels.

Two straight edges cross; lens and pixel blur them as one Gaussian; markers and neighbouring
corners are left out. Least squares over the pixels reaches what their noise allows, about a tenth
of what `cv2.cornerSubPix` leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Crossings", "fit_crossings"]

Array = NDArray[np.float64]

REACH = 0.4  # of the smallest square: how far a corner's pixels go
LEAST, MOST = 3.0, 12.0  # pixels, of that
CLEAR = 2.5  # pixels kept between the edges' pixels and the markers
TURNS = 7  # repetitions of the fit
BLURS = (0.3, 6.0)  # pixels
STEPS = (1.0, 1.0, 0.2, 0.2, 0.4)  # the most one turn may change: pixels, rad, pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossings:
    """Corners fitted to a picture; arrays over them."""

    places: Array  # (corner, 2) [pixels]
    u: Array  # (corner,) standard uncertainty each way, from the pixels left over
    contrast: Array  # (corner,) half of white less black


def fit_crossings(
    picture: NDArray[np.float32], places: Array, along: Array, down: Array, clear: float
) -> Crossings:
    """Return corners near places in a picture; NaN where none fits or the frame cuts it.

    Parameters
    ----------
    picture
        Grey values, (row, column).
    places
        Where the corners are to a pixel or so, (corner, 2) [pixels].
    along, down
        How far the next corner is along the board's rows and columns, (corner, 2) [pixels].
    clear
        Share of a square about its edges that no marker covers.
    """
    sizes = np.stack([np.hypot(*along.T), np.hypot(*down.T)])
    reach = float(np.clip(REACH * sizes.min(), LEAST, MOST))
    gap = max(clear * float(sizes.min()) - CLEAR, 1.0)
    half = int(np.ceil(reach))
    offsets = np.arange(-half, half + 1)
    rows, columns = picture.shape
    first = np.rint(places).astype(np.intp)
    inside = (first >= half) & (first < np.array([columns, rows]) - half)
    whole = inside[:, 0] & inside[:, 1]
    first = np.clip(first, half, np.array([columns, rows]) - 1 - half)
    x = (first[:, 0, None, None] + offsets).repeat(offsets.size, axis=1)
    y = (first[:, 1, None, None] + offsets[:, None]).repeat(offsets.size, axis=2)
    grey = picture[y, x].reshape(len(places), -1).astype(np.float64)
    pixels = np.stack([x, y], axis=-1).reshape(len(places), -1, 2).astype(np.float64)
    fitted = _Fit.start(grey, pixels, places, along, down, reach, gap)
    for _ in range(TURNS):
        fitted.turn()
    return fitted.crossings(whole)


@dataclass(slots=True)
class _Fit:
    """Of each corner: x, y, the angles of its edges, blur, grey level, contrast."""

    grey: Array  # (corner, pixel)
    pixels: Array  # (corner, pixel, 2)
    used: Array  # (corner, pixel) 0 or 1
    start_places: Array
    values: Array  # (corner, 7)
    normal: Array  # (corner, 7, 7)
    rest: Array  # (corner, pixel)

    @classmethod
    def start(
        cls,
        grey: Array,
        pixels: Array,
        places: Array,
        along: Array,
        down: Array,
        reach: float,
        gap: float,
    ) -> _Fit:
        values = np.zeros((len(places), 7))
        values[:, :2], values[:, 4] = places, 0.9
        values[:, 2], values[:, 3] = (np.arctan2(way[:, 1], way[:, 0]) for way in (along, down))
        first, second, *_ = _distances(pixels, values)
        near = np.hypot(*np.moveaxis(pixels - places[:, None], -1, 0)) < reach
        used = (near & (np.minimum(np.abs(first), np.abs(second)) < gap)).astype(np.float64)
        wave = np.sign(first) * np.sign(second)
        count = used.sum(axis=1)
        level, mean = (used * grey).sum(axis=1) / count, (used * wave).sum(axis=1) / count
        moved = used * (wave - mean[:, None])
        values[:, 6] = (moved * grey).sum(axis=1) / np.maximum((moved * wave).sum(axis=1), 1.0)
        values[:, 5] = level - mean * values[:, 6]
        no = np.zeros((len(places), 7, 7))
        return cls(grey, pixels, used, places, values, no, np.zeros_like(grey))

    def turn(self) -> None:
        """Take one step of Gauss and Newton."""
        from scipy.special import erf

        values = self.values
        first, second, across_first, across_second, sine, cosine = _distances(self.pixels, values)
        blur, contrast = values[:, 4:5], values[:, 6:7]
        waves = [erf(each / (np.sqrt(2) * blur)) for each in (first, second)]
        slopes = [
            np.sqrt(2 / np.pi) / blur * np.exp(-((each / blur) ** 2) / 2)
            for each in (first, second)
        ]
        by_first = contrast * slopes[0] * waves[1]
        by_second = contrast * slopes[1] * waves[0]
        wave = waves[0] * waves[1]
        design = np.stack(
            [
                by_first * sine[:, :1] + by_second * sine[:, 1:],
                -by_first * cosine[:, :1] - by_second * cosine[:, 1:],
                -by_first * across_first,
                -by_second * across_second,
                -(by_first * first + by_second * second) / blur,
                np.ones_like(wave),
                wave,
            ],
            axis=-1,
        )
        design *= self.used[..., None]
        self.rest = (self.grey - values[:, 5:6] - contrast * wave) * self.used
        self.normal = design.transpose(0, 2, 1) @ design
        scale = np.trace(self.normal, axis1=1, axis2=2)[:, None, None]
        right = (design * self.rest[..., None]).sum(axis=1)
        step = np.linalg.solve(self.normal + 1e-9 * (scale + 1) * np.eye(7), right[..., None])
        most = np.array([*STEPS, np.inf, np.inf])
        values += np.clip(step[..., 0], -most, most)
        values[:, 4] = np.clip(values[:, 4], *BLURS)

    def crossings(self, whole: NDArray[np.bool_]) -> Crossings:
        """Return what came out, without corners that strayed or drown in noise."""
        count = self.used.sum(axis=1)
        variance = (self.rest**2).sum(axis=1) / np.maximum(count - 7, 1)
        scale = np.trace(self.normal, axis1=1, axis2=2)[:, None, None]
        inverse = np.linalg.inv(self.normal + 1e-9 * (scale + 1) * np.eye(7))
        u = np.sqrt(variance * (inverse[:, 0, 0] + inverse[:, 1, 1]) / 2)
        strayed = np.hypot(*(self.values[:, :2] - self.start_places).T) > LEAST
        good = whole & ~strayed & (np.abs(self.values[:, 6]) > 2 * np.sqrt(variance))
        return Crossings(
            places=np.where(good[:, None], self.values[:, :2], np.nan),
            u=np.where(good, u, np.nan),
            contrast=np.abs(self.values[:, 6]),
        )


def _distances(pixels: Array, values: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return how far pixels are from both edges, how far along them, and the edges' directions."""
    x, y = np.moveaxis(pixels - values[:, None, :2], -1, 0)
    sine, cosine = np.sin(values[:, 2:4]), np.cos(values[:, 2:4])
    first = y * cosine[:, :1] - x * sine[:, :1]
    second = y * cosine[:, 1:] - x * sine[:, 1:]
    along_first = x * cosine[:, :1] + y * sine[:, :1]
    along_second = x * cosine[:, 1:] + y * sine[:, 1:]
    return first, second, along_first, along_second, sine, cosine
