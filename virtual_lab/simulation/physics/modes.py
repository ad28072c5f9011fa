"""Normal modes of a supported bat: exact rigid modes, and bending modes orthogonal to them.

The order of the modes is always: rigid modes, bending modes by frequency, hoop mode of a hollow
bat. All have unit modal mass, so a force F at z accelerates coordinate i by ``shape_i(z) F``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from typing import Self, assert_never

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array

from virtual_lab.catalog.specs import BatBody, HoopMode
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import (
    ELEMENT_SIZE,
    ORDER,
    Beam,
    Clamped,
    Free,
    Pinned,
    Support,
    beam_of,
)
from virtual_lab.simulation.physics.mesh import Mesh
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes:
    """N normal modes of unit modal mass."""

    mesh: Mesh
    angular_frequencies: Array  # (N,) [rad/s], exactly 0 for rigid modes
    deflections: Array  # (nodes, beam modes) [kg^-1/2]
    rotations: Array  # (nodes, beam modes) [kg^-1/2 m^-1], positive if it moves the barrel along +w
    rigid: int
    hoop: HoopMode | None

    @property
    def count(self) -> int:
        """Number of modes N, including the hoop mode."""
        return len(self.angular_frequencies)

    @property
    def length(self) -> float:
        """Length of the bat [m]."""
        return float(self.mesh.boundaries[-1])

    @property
    def bending_frequencies(self) -> Array:
        """Frequencies of the bending modes [Hz]."""
        beam = self.angular_frequencies[self.rigid : self.deflections.shape[1]]
        return np.asarray(beam / (2 * np.pi))

    def first(self, bending: int) -> Self:
        """Return the rigid modes, the first `bending` bending modes and the hoop mode.

        Raises `InputError` if there are fewer.
        """
        most = self.bending_frequencies.size
        if not 0 <= bending <= most:
            raise InputError("modes", "bending", bending, f"allowed: 0 to {most} for this mesh")
        return self._part(slice(self.rigid + bending), self.rigid, self.hoop)

    def above(self, bending: int) -> Self:
        """Return only the bending modes above the first `bending`."""
        return self._part(slice(self.rigid + bending, None), 0, None)

    def _part(self, columns: slice, rigid: int, hoop: HoopMode | None) -> Self:
        beam = self.angular_frequencies[: self.deflections.shape[1]]
        return replace(
            self,
            angular_frequencies=np.concatenate((beam[columns], _hoop_frequency(hoop))),
            deflections=self.deflections[:, columns],
            rotations=self.rotations[:, columns],
            rigid=rigid,
            hoop=hoop,
        )

    def shape(self, z: Array | float) -> Array:
        """Return the deflection of each mode at positions `z` (...) [m], shape (..., N)."""
        places = np.asarray(z, dtype=np.float64)
        return self.average(self._at(places)).reshape(*places.shape, self.count)

    def average(self, averages: csr_array) -> Array:
        """Return the mean deflection of each mode, (n, N).

        `averages` is the matrix from node values to means, (n, nodes).
        """
        beam = np.asarray(averages @ self.deflections)
        if self.hoop is None:
            return beam
        hoop = np.full((len(beam), 1), 1 / np.sqrt(self.hoop.modal_mass))
        return np.concatenate((beam, hoop), axis=1)

    def _at(self, z: Array) -> csr_array:
        """Return the matrix from node values to the values at `z`, (z.size, nodes)."""
        if not (np.all(z >= 0) and np.all(z <= self.length)):
            raise InputError("modes", "z", z, f"allowed: 0 to {self.length:g} m")
        return self.mesh.interpolation(z.reshape(-1, 1, 1))

    def rotation(self, z: Array | float) -> Array:
        """Return the rotation of the section in each mode at `z` (...) [m], shape (..., N).

        An encoder fixed to the bat at z measures this rotation. The hoop mode has none.
        """
        places = np.asarray(z, dtype=np.float64)
        beam = np.asarray(self._at(places) @ self.rotations)
        full = np.zeros((len(beam), self.count))
        full[:, : beam.shape[1]] = beam
        return full.reshape(*places.shape, self.count)


@lru_cache(maxsize=16)  # choice and use of a collision model need the same modes
def modes_of(
    body: BatBody,
    support: Support,
    bending: int | None = None,
    *,
    order: int = ORDER,
    element_size: float = ELEMENT_SIZE,
) -> Modes:
    """Return the normal modes of a bat: rigid modes, bending modes, and hoop mode if there is one.

    `bending` is the number of bending modes. By default all bending modes of the mesh are returned.
    The mesh is the mesh of `beam_of`, with polynomial degree `order` and elements of at most
    `element_size` [m]. All modes have unit modal mass.

    If the pivot has a finite stiffness, the first bending mode is the motion of the bat on this
    spring. The energy of this mode and of the spring is part of the bending energy. The hoop mode
    is copied from the data sheet; a bat without one on its sheet has no hoop mode.

    Raises `InputError` if the support is beyond the bat, its spring is too soft, the order is below
    4, or the mesh has fewer modes.
    """
    beam = beam_of(body, support, order=order, element_size=element_size)
    rigid = _rigid_modes(beam, support)
    free = _free_freedoms(beam, support)
    sprung = _sprung(beam, support)
    if bending == 0:
        squares, vectors = np.zeros(0), rigid[:, :0]
    else:
        squares, vectors = _bending_modes(sprung, free, rigid, bending)
    shapes = np.concatenate((rigid, vectors), axis=1)
    angular = (np.zeros(rigid.shape[1]), np.sqrt(squares), _hoop_frequency(body.hoop))
    n = beam.mesh.nodes.size
    modes = Modes(
        mesh=beam.mesh,
        angular_frequencies=np.concatenate(angular),
        deflections=shapes[:n],
        rotations=shapes[n:],
        rigid=rigid.shape[1],
        hoop=body.hoop,
    )
    return modes if bending is None else modes.first(bending)


def barrel_nodes(modes: Modes, count: int = 2) -> tuple[float, ...]:
    """Return the node nearest the barrel tip for each of the first bending modes [m from the tip].

    A node is a position at which the mode has no deflection. The result has `count` values, in the
    order of the modes. Raises `IndexError` for a mode without a node, and if `count` exceeds the
    number of bending modes.
    """
    z = np.linspace(0.0, modes.length, 2001)
    nodes = []
    for mode in range(modes.rigid, modes.rigid + count):
        shape = modes.shape(z)[:, mode]
        first = int(np.flatnonzero(shape[:-1] * shape[1:] < 0)[0])
        nodes.append(_crossing(modes, mode, float(z[first]), float(z[first + 1])))
    return tuple(nodes)


def _hoop_frequency(hoop: HoopMode | None) -> Array:
    return np.zeros(0) if hoop is None else np.array([2 * np.pi * hoop.frequency])


def _crossing(modes: Modes, mode: int, left: float, right: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda z: float(modes.shape(z)[mode]), left, right, xtol=1e-12))


def _rigid_modes(beam: Beam, support: Support) -> Array:
    """Return rigid modes of unit mass, (2 n, rigid): heave and pitch, or rotation about a pin."""
    match support:
        case Free():
            heave = beam.heave() / np.sqrt(beam.mass)
            z_cm = beam.z_cm
            return np.stack((heave, beam.turn(z_cm) / np.sqrt(beam.inertia(z_cm))), axis=1)
        case Pinned(z=z):
            return np.asarray(beam.turn(z) / np.sqrt(beam.inertia(z)))[:, None]
        case Clamped():
            return np.zeros((2 * beam.mesh.nodes.size, 0))
        case unknown:
            assert_never(unknown)


def _sprung(beam: Beam, support: Support) -> Beam:
    """Return the beam with the spring of an elastic pivot in its stiffness matrix."""
    if not (isinstance(support, Pinned) and isfinite(support.stiffness)):
        return beam
    least = _least_stiffness(beam, support.z)
    if support.stiffness < least:
        allowed = f"allowed: at least {least:.3g} N/m here; a free bat needs none"
        raise InputError("pinned bat", "stiffness", support.stiffness, allowed)
    stiffness = beam.stiffness_matrix.copy()
    node = int(np.flatnonzero(beam.mesh.nodes == support.z)[0])
    stiffness[node, node] += support.stiffness
    return replace(beam, stiffness_matrix=stiffness)


def _least_stiffness(beam: Beam, z: float) -> float:
    """Return the smallest stiffness of a spring [N/m] that rounding errors do not hide."""
    stiffest = float((np.diag(beam.stiffness_matrix) / np.diag(beam.mass_matrix)).max())
    inverse_mass = 1 / beam.mass + (z - beam.z_cm) ** 2 / beam.inertia_cm
    rounding = float(np.finfo(np.float64).eps) * stiffest
    share = 1e-3  # largest rounding error of the bounce's squared frequency [share of it]
    return float(f"{rounding / share / inverse_mass:.3g}")


def _free_freedoms(beam: Beam, support: Support) -> NDArray[np.intp]:
    """Return the indices of the degrees of freedom that the support leaves free."""
    nodes = beam.mesh.nodes
    everything = np.arange(2 * nodes.size)
    match support:
        case Free():
            return everything
        case Pinned(stiffness=k) if isfinite(k):
            return everything
        case Pinned(z=z):
            support_dofs = [int(np.flatnonzero(nodes == z)[0])]
        case Clamped(z=z):
            node = int(np.flatnonzero(nodes == z)[0])
            support_dofs = [node, nodes.size + node]
        case unknown:
            assert_never(unknown)
    return np.setdiff1d(everything, support_dofs)


def _bending_modes(
    beam: Beam, free: NDArray[np.intp], rigid: Array, bending: int | None
) -> tuple[Array, Array]:
    """Return (squared angular frequencies, unit-mass vectors) of bending modes.

    The modes are at least the first `bending`, by default all.

    The lowest modes by bisection take less time than all modes by divide and conquer, unless they
    are more than about one in six.
    """
    skip = rigid.shape[1]
    block = np.ix_(free, free)
    few = bending is not None and 6 * bending < len(free)
    squares, reduced = eigh(
        beam.stiffness_matrix[block],
        beam.mass_matrix[block],
        subset_by_index=[0, skip + bending - 1] if few else None,
    )
    squares, vectors = squares[skip:], np.zeros((len(rigid), squares.size - skip))
    vectors[free] = reduced[:, skip:]
    # Rounding errors of the stiffest modes remain in the softest ones: remove their rigid part.
    for _ in range(2):
        vectors -= rigid @ (rigid.T @ beam.mass_matrix @ vectors)
    scale = np.sqrt(np.einsum("ij,ij->j", vectors, beam.mass_matrix @ vectors))
    tip = np.where(vectors[0] < 0, -1.0, 1.0)
    return squares, vectors * (tip / scale)
