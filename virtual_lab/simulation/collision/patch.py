"""Contact patch: the ball presses on a length of the bat instead of a point.

A point force on a Timoshenko beam does not converge with the number of modes, but a patch does. The
pressure decreases as a cosine toward the ends of the patch. The patch is symmetric about the impact
position, so its moment arm is the moment arm of the impact position. If it would extend beyond an
end of the bat, it shrinks equally on both sides, to a point at the tip.

The pressure is integrated element by element, because the slopes of the stiffest modes of the mesh
jump between elements. A single Gauss rule over the whole patch would be a row of point forces, to
which the bat yields too much where two elements meet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from virtual_lab.simulation.physics.cubics import PiecewiseCubic, smooth_cubic
from virtual_lab.simulation.physics.mesh import Mesh, gauss_points
from virtual_lab.simulation.physics.modes import Modes
from virtual_lab.units import Array

PATCH = 0.03  # full width of the patch [m]
POINT = 1e-9  # half the width of a patch that is a point [m]
TILE = 256  # number of knots covered by one spline
MARGIN = 40  # number of extra knots at each end; each multiplies the end effect by 0.27


def patch_shape(modes: Modes, z: Array, width: float) -> Array:
    """Return the mean deflection of each mode over patches centered at `z`, (n, N) [kg^-1/2].

    `z`, (n,), is the distance from the barrel tip [m]. `width` is the full width of a patch [m];
    with a width of 0 the result is the deflection at the point `z`. The mean is weighted by a
    cosine, which is largest at the center. Near an end of the bat the patch becomes narrower on
    both sides, so that it stays on the bat.
    """
    return patch_shapes((modes,), z, width)[0]


def patch_shapes(parts: Sequence[Modes], z: Array, width: float) -> list[Array]:
    """Return the mean deflection of each mode over patches of a bat, one array per set of modes.

    An array has the shape (n, N) [kg^-1/2], where n is the number of patches and N the number of
    modes of the set. `z`, (n,), holds the centers of the patches [m from the barrel tip], and
    `width` is their full width [m]; see `patch_shape`. All sets must belong to one bat and share
    one mesh.
    """
    block_size = 4096  # positions per block, so that the interpolation matrix fits in the cache
    blocks = [
        _averages(parts[0].mesh, z[i : i + block_size], width) for i in range(0, len(z), block_size)
    ]
    return [np.concatenate([modes.average(block) for block in blocks]) for modes in parts]


def _averages(mesh: Mesh, z: Array, width: float) -> csr_array:
    """Return the matrix from node values to means over patches centered at `z`, (n, nodes)."""
    x, gauss = gauss_points(8)
    bounds = mesh.boundaries
    z = z[:, None]
    half = np.maximum(np.minimum(width / 2, np.minimum(z, bounds[-1] - z)), POINT)
    low, high = np.maximum(z - half, 0.0), np.minimum(z + half, bounds[-1])
    most = int((np.searchsorted(bounds, bounds + width) - np.arange(bounds.size)).max())
    first = np.searchsorted(bounds, low[:, 0])[:, None]
    inner = bounds[np.minimum(first + np.arange(most), bounds.size - 1)]
    # pieces of the patch, one per element; a piece without length has no weight
    edges = np.concatenate((low, np.clip(inner, low, high), high), axis=1)
    half_piece = np.diff(edges)[..., None] / 2
    places = edges[:, :-1, None] + half_piece * (1 + x)
    pressure = half_piece * gauss * np.cos(np.pi / 2 * (places - z[..., None]) / half[..., None])
    return mesh.interpolation(places, pressure / pressure.sum(axis=(1, 2), keepdims=True))


@dataclass(frozen=True)
class PatchTable:
    """Cubic splines of functions of the impact position, built on demand.

    The function `values` returns (n, columns) for positions (n,) [m]. It is smooth except where the
    patch starts to shrink. `length` is the length of the bat, and `width` is the width of the patch
    [m]. The result at a position does not depend on the other positions, because the knots are
    fixed for the whole bat, and each spline extends so far beyond its tile that its ends have no
    effect.
    """

    values: Callable[[Array], Array]
    length: float
    width: float
    # splines by part and tile
    splines: dict[tuple[int, int], PiecewiseCubic] = field(default_factory=dict)

    def __call__(self, z: Array) -> Array:
        """Return the values at positions `z` (n,) [m], (n, columns)."""
        ends = np.array([part[0] for part in self._knots[1:]])
        where = np.searchsorted(ends, z, side="right")
        starts, steps = (np.array([part[k] for part in self._knots]) for k in (0, 1))
        tile = ((z - starts[where]) / (steps - starts)[where]).astype(np.intp) // TILE
        tiles = 1 + tile.max(initial=0)
        tile_numbers, inverse = np.unique(where * tiles + tile, return_inverse=True)
        shapes = [
            self._spline(int(number // tiles), int(number % tiles))(z[inverse == k])
            for k, number in enumerate(tile_numbers)
        ]
        order = np.argsort(inverse, kind="stable")
        table = np.empty((z.size, shapes[0].shape[1] if shapes else 0))
        if shapes:
            table[order] = np.concatenate(shapes)
        return table

    @cached_property
    def _knots(self) -> list[Array]:
        """Knots of each part of the bat; the parts meet where the patch starts to shrink."""
        ends = sorted({0.0, self.width / 2, self.length - self.width / 2, self.length})
        # Knots 0.2 mm apart usually cause an error of e_A below 2e-8, at most 5e-7.
        return [
            np.linspace(low, high, max(150, round((high - low) / 2e-4)))
            for low, high in pairwise(ends)
        ]

    def _spline(self, part: int, tile: int) -> PiecewiseCubic:
        if (part, tile) not in self.splines:
            first = max(0, tile * TILE - MARGIN)
            knots = self._knots[part][first : (tile + 1) * TILE + 1 + MARGIN]
            self.splines[part, tile] = smooth_cubic(knots, self.values(knots))
        return self.splines[part, tile]
