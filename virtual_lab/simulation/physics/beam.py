"""A bat as a Timoshenko beam: mass and stiffness matrices, and the rigid body within them.

Deflection ``w`` and rotation ``psi`` are independent fields. ``psi`` is positive where it
carries the barrel along positive ``w``, so a rigid turn about z_p is ``w = z_p - z, psi = 1``
and the shear strain is ``w' + psi``. Spectral elements of order 4 and up, fully integrated,
do not lock; rotary inertia is kept, of the section and of the lumps (S. P. Timoshenko, Phil. Mag.
41 (1921) 744).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BatBody, Lump
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.mesh import Mesh, mesh_through, reference_element
from virtual_lab.simulation.physics.section import Section, section
from virtual_lab.simulation.physics.supports import Free, Support, support_place

__all__ = ["Beam", "beam_of"]

Floats = NDArray[np.float64]
ORDER = 8
ELEMENT_SIZE = 0.05  # m
# Outline cubic in z: E I is of degree 12 in z and meets two derivatives of degree order - 1,
# so this many Gauss points beyond the order integrate every term exactly.
EXTRA_POINTS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Beam:
    """Matrices over the freedoms (w of all nodes, then psi of all nodes)."""

    mesh: Mesh
    mass_matrix: Floats  # (2 n, 2 n)
    stiffness_matrix: Floats  # (2 n, 2 n)

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.mesh.boundaries[-1])

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        heave = self.heave()
        return float(heave @ self.mass_matrix @ heave)

    @property
    def z_cm(self) -> float:
        """Centre of mass, from the barrel tip [m]."""
        # first moment of the mass about the tip, by a turn about the tip
        return -float(self.heave() @ self.mass_matrix @ self.turn(0.0)) / self.mass

    def inertia(self, z: float) -> float:
        """Moment of inertia about `z` [kg m^2]."""
        turn = self.turn(z)
        return float(turn @ self.mass_matrix @ turn)

    @property
    def inertia_cm(self) -> float:
        """Moment of inertia about the centre of mass [kg m^2]."""
        return self.inertia(self.z_cm)

    def heave(self) -> Floats:
        """Return the freedoms of a unit shift, (2 n,)."""
        nodes = self.mesh.nodes
        return np.concatenate((np.ones_like(nodes), np.zeros_like(nodes)))

    def turn(self, z: float) -> Floats:
        """Return the freedoms of a unit turn about `z`, (2 n,)."""
        nodes = self.mesh.nodes
        return np.concatenate((z - nodes, np.ones_like(nodes)))


@lru_cache(maxsize=16)
def beam_of(
    body: BatBody,
    support: Support | None = None,
    *,
    order: int = ORDER,
    element_size: float = ELEMENT_SIZE,
) -> Beam:
    """Assemble the beam of a bat, with a node where it is held.

    Parameters
    ----------
    body : BatBody
    support : Support
        Only places a node; holding it is left to `virtual_lab.simulation.physics.modes`.
    order, element_size : int, float
        Polynomial degree and longest element [m].

    Raises
    ------
    InputError
        The support lies off the bat, the order below 4.
    """
    if order < 4:
        raise InputError("beam", "order", order, "allowed: 4 and up, lower orders lock")
    held = support_place(support or Free(), body.length)
    keep = (0.0, body.length) if held is None else (0.0, held, body.length)
    places = (*body.profile.z, *(lump.z for lump in body.lumps))
    mesh = mesh_through(places, keep, size=element_size, order=order)
    mass, stiffness = _assemble(mesh, body)
    for lump in body.lumps:
        _add_lump(mass, mesh, lump)
    return Beam(mesh=mesh, mass_matrix=mass, stiffness_matrix=stiffness)


_gauss_points = lru_cache(np.polynomial.legendre.leggauss)


def _assemble(mesh: Mesh, body: BatBody) -> tuple[Floats, Floats]:
    reference = reference_element(mesh.order)
    x, gauss = _gauss_points(mesh.order + EXTRA_POINTS)
    half = np.diff(mesh.boundaries)[:, None] / 2
    z = mesh.boundaries[:-1, None] + half * (1 + x)
    N = reference.basis(x)
    slope = N @ reference.differentiation
    at = section(body, z)
    blocks = _element_blocks(at, gauss * half, N, slope, 1 / half[:, 0])
    n, freedoms = mesh.nodes.size, mesh.connectivity
    mass, stiffness = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    for matrix, block, row, column in (
        (mass, blocks.mass_ww, 0, 0),
        (mass, blocks.mass_pp, n, n),
        (stiffness, blocks.stiffness_ww, 0, 0),
        (stiffness, blocks.stiffness_wp, 0, n),
        (stiffness, blocks.stiffness_wp.transpose(0, 2, 1), n, 0),
        (stiffness, blocks.stiffness_pp, n, n),
    ):
        rows = freedoms[:, :, None] + row
        columns = freedoms[:, None, :] + column
        np.add.at(matrix, (rows, columns), block)
    return mass, stiffness


@dataclass(frozen=True, slots=True, kw_only=True)
class _Blocks:
    """Element matrices, each (elements, order + 1, order + 1); p stands for psi."""

    mass_ww: Floats
    mass_pp: Floats
    stiffness_ww: Floats
    stiffness_wp: Floats
    stiffness_pp: Floats


def _element_blocks(
    at: Section, weight: Floats, N: Floats, slope: Floats, scale: Floats
) -> _Blocks:
    def integrate(density: Floats, left: Floats, right: Floats) -> Floats:
        return np.asarray(np.einsum("eg,gi,gj->eij", density * weight, left, right))

    once, twice = scale[:, None, None], scale[:, None, None] ** 2
    shear = at.shear_stiffness
    return _Blocks(
        mass_ww=integrate(at.mass, N, N),
        mass_pp=integrate(at.rotary_inertia, N, N),
        stiffness_ww=integrate(shear, slope, slope) * twice,
        stiffness_wp=integrate(shear, slope, N) * once,
        stiffness_pp=integrate(at.bending_stiffness, slope, slope) * twice + integrate(shear, N, N),
    )


def _add_lump(mass: Floats, mesh: Mesh, lump: Lump) -> None:
    n = mesh.nodes.size
    at = mesh.interpolation(np.array([[lump.z]])).toarray()[0]
    mass[:n, :n] += lump.mass * np.outer(at, at)
    mass[n:, n:] += lump.inertia * np.outer(at, at)
