"""Distributions of the inputs of a model, all symmetric about the value (JCGM 101, 6.4).

Each is an entry of `LAWS`, in multiples of a scale. The scale is the standard uncertainty for
normal and t, and half the distance of the limits for the others. The shape parameter is the degrees
of freedom of a t, or the inexactness of the limits of a trapezoid relative to half their distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import inf, pi, sqrt
from typing import Any

import numpy as np

from virtual_lab.units import Array

Random = Any  # numpy's generator, made by `streams`


@dataclass(frozen=True, slots=True)
class Law:
    """A distribution in multiples of its scale."""

    u: Callable[[float], float]  # standard deviation, by shape
    kurtosis: Callable[[float], float]
    draw: Callable[[Random, int, float], Array]
    quantile: Callable[[Array, float], Array]
    limited: bool = True


def _triangular(q: Array, _shape: float) -> Array:
    return np.where(q < 0.5, np.sqrt(2 * q) - 1, 1 - np.sqrt(2 * (1 - q)))


def _normal(q: Array, _shape: float) -> Array:
    from scipy.special import ndtri

    return np.asarray(ndtri(q))


def _student(q: Array, dof: float) -> Array:
    from scipy.special import stdtrit

    ends = np.where(q <= 0, -inf, inf)  # scipy returns other values
    return np.asarray(np.where((q > 0) & (q < 1), stdtrit(dof, q), ends))


def _inexact_draw(random: Random, n: int, inexact: float) -> Array:
    width = 1 + inexact * random.uniform(-1, 1, n)
    return np.asarray(width * random.uniform(-1, 1, n))


def _inexact_quantile(q: Array, inexact: float) -> Array:
    x, below = _inexact_distribution(inexact)
    return np.asarray(np.interp(q, below, x))


@lru_cache(16)
def _inexact_distribution(inexact: float) -> tuple[Array, Array]:
    """Return a grid of numbers, and the distribution function at them, for inexact uniform limits.

    The numbers are uniform between limits, and each limit is itself uniform within ± `inexact`.
    """
    x = np.linspace(-1 - inexact, 1 + inexact, 4001)
    nodes, weights = np.polynomial.legendre.leggauss(201)
    return x, np.clip((x[:, None] / (1 + inexact * nodes) + 1) / 2, 0, 1) @ weights / 2


def _inexact_kurtosis(inexact: float) -> float:
    return 9 / 5 * (1 + 2 * inexact**2 + inexact**4 / 5) / (1 + inexact**2 / 3) ** 2


LAWS = {
    "normal": Law(
        lambda _: 1.0, lambda _: 3.0, lambda r, n, _: r.standard_normal(n), _normal, limited=False
    ),
    # The u of a t is that of the GUM. Draws have u √(ν/(ν - 2)), and the second order takes it as
    # normal.
    "t": Law(
        lambda _: 1.0, lambda _: 3.0, lambda r, n, v: r.standard_t(v, n), _student, limited=False
    ),
    "uniform": Law(
        lambda _: 1 / sqrt(3),
        lambda _: 9 / 5,
        lambda r, n, _: r.uniform(-1, 1, n),
        lambda q, _: 2 * q - 1,
    ),
    "triangular": Law(
        lambda _: 1 / sqrt(6),
        lambda _: 12 / 5,
        lambda r, n, _: r.random(n) + r.random(n) - 1,
        _triangular,
    ),
    "arcsine": Law(
        lambda _: 1 / sqrt(2),
        lambda _: 3 / 2,
        lambda r, n, _: np.sin(2 * pi * r.random(n)),
        lambda q, _: -np.cos(pi * q),
    ),
    "trapezoid": Law(
        lambda inexact: sqrt(1 / 3 + inexact**2 / 9),
        _inexact_kurtosis,
        _inexact_draw,
        _inexact_quantile,
    ),
}


def inexactness(dof: float) -> float:
    """Return the relative inexactness of the two limits of a distribution, dimensionless.

    The distribution is, for example, a rectangular one. Each of its limits is itself known only
    within a range (GUM G.4.2). The result is half the width of this range, divided by half the
    distance between the two limits. It is computed as 1/√(2 dof).

    `dof` is the number of degrees of freedom of the distribution's standard uncertainty. The result
    is 0 for infinite `dof`. For `dof` below 0.5 the result is above 1, which is impossible for
    limits. The caller must reject it.
    """
    return 0.0 if dof == inf else 1 / sqrt(2 * dof)
