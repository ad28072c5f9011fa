"""Spectral elements in one dimension: nodes, Lagrange basis and interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.sparse import csr_array

from virtual_lab.units import Array


@lru_cache
def gauss_points(number: int) -> tuple[Array, Array]:
    """Return the points and weights of Gauss-Legendre quadrature on [-1, 1], both (number,).

    The weights have the sum 2. The arrays are read-only because they are shared.
    """
    points, weights = legendre.leggauss(number)
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceElement:
    """Lagrange basis on the Legendre-Gauss-Lobatto nodes of [-1, 1]."""

    nodes: Array  # (p + 1,)
    barycentric: Array  # (p + 1,)
    differentiation: Array  # (p + 1, p + 1), derivative of basis j at node i

    def basis(self, x: Array) -> Array:
        """Return the basis at `x` (...), shape (..., p + 1), by the barycentric formula."""
        gap = x[..., None] - self.nodes
        on_node = gap == 0
        terms = self.barycentric / np.where(on_node, 1.0, gap)
        values = terms / terms.sum(axis=-1, keepdims=True)
        hit = on_node.any(axis=-1, keepdims=True)
        return np.asarray(np.where(hit, on_node.astype(np.float64), values))


@lru_cache
def reference_element(order: int) -> ReferenceElement:
    """Return the finite element on the interval [-1, 1] with polynomials of degree `order`.

    `order` is at least 1. The element has order + 1 Legendre-Gauss-Lobatto nodes.
    """
    last = np.zeros(order + 1)
    last[-1] = 1.0
    inner = np.sort(legendre.legroots(legendre.legder(last)).real)
    nodes = np.concatenate(([-1.0], inner, [1.0]))
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 1.0)
    barycentric = 1 / gaps.prod(axis=1)
    differentiation = barycentric / barycentric[:, None] / gaps
    np.fill_diagonal(differentiation, 0.0)
    # the derivative of a constant is zero, so each row adds to zero
    np.fill_diagonal(differentiation, -differentiation.sum(axis=1))
    return ReferenceElement(nodes=nodes, barycentric=barycentric, differentiation=differentiation)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Mesh along the bat: elements of one polynomial degree between boundaries."""

    boundaries: Array  # (elements + 1,) [m]
    order: int

    @property
    def nodes(self) -> Array:
        """Positions of all nodes [m], (elements * order + 1,); neighboring elements share one."""
        inner = (self._reference.nodes[1:] + 1) / 2
        starts, sizes = self.boundaries[:-1, None], np.diff(self.boundaries)[:, None]
        nodes = np.concatenate((self.boundaries[:1], (starts + sizes * inner).ravel()))
        nodes[:: self.order] = self.boundaries  # exact, not rounded
        return nodes

    @property
    def _reference(self) -> ReferenceElement:
        return reference_element(self.order)

    @property
    def connectivity(self) -> NDArray[np.intp]:
        """Node numbers of each element, (elements, order + 1)."""
        elements = np.arange(len(self.boundaries) - 1)
        return elements[:, None] * self.order + np.arange(self.order + 1)

    def interpolation(self, z: Array, weights: Array | None = None) -> csr_array:
        """Return the sparse matrix (n, nodes) from node values to weighted sums at positions `z`.

        `z` has shape (n, pieces, g) [m] and lies within the mesh. The g positions of a piece lie in
        one element. Row i is the sum over all positions ``z[i]`` with `weights`, in the shape of
        `z`, 1 by default.
        """
        element = np.clip(
            np.searchsorted(self.boundaries, z.mean(axis=-1), side="right") - 1,
            0,
            len(self.boundaries) - 2,
        )
        start = self.boundaries[element][..., None]
        size = self.boundaries[element + 1][..., None] - start
        basis = self._reference.basis(2 * (z - start) / size - 1)
        if weights is not None:
            basis = basis * weights[..., None]
        basis = basis.sum(axis=-2)
        rows, per_row = len(z), basis[0].size
        return csr_array(
            (basis.ravel(), self.connectivity[element].ravel(), per_row * np.arange(rows + 1)),
            shape=(rows, (len(self.boundaries) - 1) * self.order + 1),
        )


def mesh_through(
    places: tuple[float, ...], keep: tuple[float, ...], *, size: float, order: int
) -> Mesh:
    """Return a mesh with element boundaries at `places` and `keep` [m].

    The positions in `keep` (ends, supports) become boundaries exactly. A position in `places` is
    omitted in two cases:

    * It is within 10 µm of a position in `keep`.
    * It is within 10 µm of the next lower position in `places`. This position may itself be
      omitted, so that only the lowest position of a close series can remain.

    Further boundaries are added so that no element is longer than `size` [m]. `order` is the
    polynomial degree of the elements.
    """
    merged = 1e-5  # distance below which two places share one boundary [m]
    fixed = np.unique(np.array(keep))
    others = np.unique(np.array(places))
    others = others[np.diff(others, prepend=-np.inf) > merged]
    clear = np.abs(others[:, None] - fixed).min(axis=1) > merged
    coarse = np.union1d(fixed, others[clear])
    parts = [coarse[:1]]
    for left, right in pairwise(coarse):
        count = int(np.ceil((right - left) / size - 1e-9))
        parts.append(np.linspace(left, right, count + 1)[1:])
    return Mesh(boundaries=np.concatenate(parts), order=order)
