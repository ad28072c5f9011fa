"""Images of a moving disc from its exact spectrum: the oracle of the tracker's refinement.

The spectrum of a disc is a Bessel function over the frequency; lens, pixel and motion multiply
it. Sampling folds it: higher orders are added up until the lens has swallowed them. Nothing here
knows the code under test.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

Floats = NDArray[np.float64]
ORDERS = 3  # foldings each way; a lens of 0.5 px leaves 3e-27 of the fourth


def disc(
    size: int,
    x: float,
    y: float,
    radius: float,
    lens: float,
    blur: tuple[float, float] = (0.0, 0.0),
) -> Floats:
    """Return each pixel's share of a disc, (size, size), exact but for images a field apart."""
    first = np.fft.fftfreq(size)
    total = np.zeros((size, size), complex)
    for order_y in range(-ORDERS, ORDERS + 1):
        for order_x in range(-ORDERS, ORDERS + 1):
            fx, fy = first[None, :] + order_x, first[:, None] + order_y
            f = np.hypot(fx, fy)
            safe = np.where(f == 0, 1, f)
            spectrum = np.where(
                f == 0, np.pi * radius**2, radius * j1(2 * np.pi * radius * f) / safe
            )
            spectrum = spectrum * np.exp(-2 * (np.pi * lens * f) ** 2)
            spectrum = spectrum * np.sinc(fx) * np.sinc(fy) * np.sinc(fx * blur[0] + fy * blur[1])
            total += spectrum * np.exp(-2j * np.pi * (fx * x + fy * y))
    return np.fft.ifft2(total).real
