"""Images of a moving disk from its exact spectrum: the oracle for the tracker's refinement.

The spectrum of a disk is a Bessel function over the frequency; lens, pixel and motion multiply
it. Sampling folds it: orders are added until the lens leaves nothing of the next one. The module
shares no code with the tracker.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

Floats = NDArray[np.float64]
LEAST = 60.0  # exponent beyond which a folding is omitted: the lens leaves less than exp(-60)


def disc(
    size: int,
    x: float,
    y: float,
    radius: float,
    lens: float,
    blur: tuple[float, float] = (0.0, 0.0),
) -> Floats:
    """Return each pixel's share of a disk, (size, size), exact except for periodic copies."""
    first = np.fft.fftfreq(size)
    total = np.zeros((size, size), complex)
    for order_x, order_y, spectrum in folded(size, radius, lens, blur):
        along, across = (
            np.exp(-2j * np.pi * (first + order) * place)
            for order, place in ((order_x, x), (order_y, y))
        )
        total += spectrum * along * across[:, None]
    return np.fft.ifft2(total).real


@lru_cache(maxsize=4)
def folded(
    size: int, radius: float, lens: float, blur: tuple[float, float]
) -> list[tuple[int, int, Floats]]:
    """Return the spectrum of a disk at the origin, for each order of folding."""
    first, most = np.fft.fftfreq(size), int(0.5 + np.sqrt(LEAST / 2) / (np.pi * lens))
    orders = range(-most, most + 1)
    return [
        (order_x, order_y, centred(first + order_x, (first + order_y)[:, None], radius, lens, blur))
        for order_y in orders
        for order_x in orders
        if sum(max(abs(o) - 0.5, 0) ** 2 for o in (order_x, order_y)) * (np.pi * lens) ** 2
        < LEAST / 2
    ]


def centred(
    fx: Floats, fy: Floats, radius: float, lens: float, blur: tuple[float, float]
) -> Floats:
    """Return the spectrum of a disk at the origin [pixel^2] at these frequencies [1/pixel]."""
    f = np.hypot(fx, fy)
    safe = np.where(f == 0, 1, f)
    spectrum = np.where(f == 0, np.pi * radius**2, radius * j1(2 * np.pi * radius * f) / safe)
    spectrum *= np.exp(-2 * (np.pi * lens * f) ** 2) * np.sinc(fx) * np.sinc(fy)
    return spectrum * np.sinc(fx * blur[0] + fy * blur[1])
