"""The ball as a hysteretic power-law spring, and what it does on a rigid wall.

Loading ``F = k u^a``, unloading ``F = F_max (u / u_max)^b``. The two areas give
``e0^2 = (a + 1) / (b + 1)`` whatever the speed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

__all__ = ["WallContact", "unloading_exponent", "wall_contact"]

Floats = NDArray[np.float64]


class WallContact(NamedTuple):
    """A collision with a rigid wall at rest, arrays of one shape."""

    compression: Floats  # greatest, [m]
    force: Floats  # greatest, [N]
    compression_time: Floats  # [s]
    expansion_time: Floats  # [s]

    @property
    def time(self) -> Floats:
        """Time in contact [s]."""
        return self.compression_time + self.expansion_time


def unloading_exponent(exponent: Floats, restitution: Floats) -> Floats:
    """Return b of a ball with loading exponent a and restitution e0."""
    return (exponent + 1) / restitution**2 - 1


def wall_contact(
    mass: Floats, speed: Floats, stiffness: Floats, exponent: Floats, restitution: Floats
) -> WallContact:
    """Return the closed forms for a rigid wall.

    Parameters
    ----------
    mass, speed, stiffness, exponent, restitution : arrays that broadcast
        Ball (or reduced) mass [kg], approach speed [m/s], k [N/m^a], a, e0.

    Notes
    -----
    Energy gives ``u_max = ((a + 1) m v^2 / 2 k)^(1 / (a + 1))``; with ``C(n)`` below, each
    half takes ``u_max C(n) / v`` with its own power of the compression and its own speed.
    """
    a, b = exponent, unloading_exponent(exponent, restitution)
    compression = ((a + 1) * mass * speed**2 / (2 * stiffness)) ** (1 / (a + 1))
    return WallContact(
        compression=compression,
        force=stiffness * compression**a,
        compression_time=compression / speed * _half_time(a + 1),
        expansion_time=compression / (restitution * speed) * _half_time(b + 1),
    )


def _half_time(n: Floats) -> Floats:
    """Return the integral of (1 - x^n)^(-1/2) from 0 to 1."""
    return np.asarray(np.sqrt(np.pi) * np.exp(gammaln(1 + 1 / n) - gammaln(0.5 + 1 / n)))
