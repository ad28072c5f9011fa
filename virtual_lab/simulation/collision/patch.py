"""The ball presses on a stretch of the bat, not on a point.

A point force on a Timoshenko beam does not converge in the number of modes; a patch does.
Pressure falls as a cosine to the ends of the patch, which is symmetric about the impact, so
its lever is that of the impact itself. Nearer an end of the bat than its half width it
shrinks on both sides alike: at the very tip it is a point again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from virtual_lab.simulation.physics.mesh import gauss_points
from virtual_lab.simulation.physics.modes import Modes
from virtual_lab.units import Array

PATCH = 0.03  # full width [m]


def patch_shape(modes: Modes, z: Array, width: float) -> Array:
    """Return the mean deflection of each mode over the patches about `z` (n,) [m], (n, N).

    `width` is the full width of the patch [m]; 0 is a point.
    """
    return patch_shapes((modes,), z, width)[0]


def patch_shapes(parts: Sequence[Modes], z: Array, width: float) -> list[Array]:
    """Return `patch_shape` of several modes of one bat."""
    x, gauss = gauss_points(8)
    pressure = gauss * np.cos(np.pi / 2 * x)
    pressure /= pressure.sum()
    bat = parts[0]
    half = np.minimum(width / 2, np.minimum(z, bat.length - z))
    places = np.clip(z[:, None] + half[:, None] * x, 0.0, bat.length)
    few = 4096  # places at a time: keeps the interpolation matrix in the cache
    blocks = [bat.averages(places[i : i + few], pressure) for i in range(0, len(z), few)]
    return [np.concatenate([modes.averaged(block) for block in blocks]) for modes in parts]


def patch_table(values: Callable[[Array], Array], length: float, width: float) -> PPoly:
    """Return cubic splines through what depends on the place of a patch.

    `values` is smooth but where the patch starts to shrink, from places (n,) [m] to (n, columns);
    `length` and `width` are those of bat and patch [m].
    """
    ends = sorted({0.0, width / 2, length - width / 2, length})
    splines = []
    for low, high in pairwise(ends):
        # 0.2 mm between knots mostly cost less than 2e-8 in e_A, at worst 5e-7
        knots = np.linspace(low, high, max(150, round((high - low) / 2e-4)))
        splines.append(CubicSpline(knots, values(knots)))
    return PPoly(
        np.concatenate([spline.c for spline in splines], axis=1),
        np.concatenate([splines[0].x, *(spline.x[1:] for spline in splines[1:])]),
    )
