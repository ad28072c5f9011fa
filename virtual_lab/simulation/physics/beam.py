"""A bat as a Timoshenko beam: mass and stiffness matrices, and its properties as a rigid body.

Deflection ``w`` and rotation ``psi`` are independent fields. A positive ``psi`` moves the barrel
along positive ``w``, so a rigid rotation about z_p is ``w = z_p - z, psi = 1``, and the shear
strain is ``w' + psi``. The spectral elements have order 4 or higher and are fully integrated, so
they do not lock. The rotary inertia of the sections and of the lumps is included
(S. P. Timoshenko, Phil. Mag. 41 (1921) 744).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isfinite
from typing import Generic, TypeVar, assert_never, overload

import numpy as np

from virtual_lab.catalog.specs import BatBody, Lump, Profile
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.cubics import PiecewiseCubic, monotone_cubic
from virtual_lab.simulation.physics.mesh import Mesh, gauss_points, mesh_through, reference_element
from virtual_lab.units import INCH, Array

ORDER = 6  # e_A changes by less than 1e-6 with a finer mesh
ELEMENT_SIZE = 0.05  # m


@dataclass(frozen=True, slots=True)
class Free:
    """A free bat: hands are too soft to act on it during the contact with the ball."""


@dataclass(frozen=True, slots=True)
class Pinned:
    """A frictionless pivot through the bat at `z` [m], rigid or on a spring across the bat.

    A rigid pivot allows rotation only. On a pivot of finite stiffness [N/m] the bat can also bounce
    on the spring. This bounce is an additional mode, the lowest after the rotation, and is treated
    as a bending mode.
    """

    z: float
    stiffness: float = inf


@dataclass(frozen=True, slots=True)
class Clamped:
    """A bat clamped at `z` [m], where it neither moves nor rotates."""

    z: float


Support = Free | Pinned | Clamped


def support_position(support: Support, length: float) -> float | None:
    """Return the position of the support, from the barrel tip [m], or None for a free bat.

    `length` is the length of the bat [m]. Raises `InputError` for a position beyond the bat, or a
    pivot without a positive stiffness.
    """
    if isinstance(support, Free):
        return None
    if not (isfinite(support.z) and 0 <= support.z <= length):
        name = type(support).__name__.lower()
        raise InputError(f"{name} bat", "z", support.z, f"allowed: 0 to {length:g} m")
    if isinstance(support, Pinned) and not support.stiffness > 0:
        value = support.stiffness
        raise InputError("pinned bat", "stiffness", value, "allowed: above 0 N/m; 0 is a free bat")
    return support.z


def support_words(support: Support) -> str:
    """Return a description of the support for messages, such as ``pinned at 0.7112 m``.

    Positions are distances from the barrel tip. The stiffness of a spring is added. A free bat is
    described as ``free``.
    """
    match support:
        case Free():
            return "free"
        case Clamped(z=z):
            return f"clamped at {z:.6g} m"
        case Pinned(z=z, stiffness=k):
            return f"pinned at {z:.6g} m" + (f" on a spring of {k:.6g} N/m" if isfinite(k) else "")
        case unknown:
            assert_never(unknown)


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Properties of the bat per unit length, arrays with the shape of the positions z."""

    mass: Array  # rho A [kg/m]
    rotary_inertia: Array  # rho I [kg m]
    bending_stiffness: Array  # E I [N m^2]
    shear_stiffness: Array  # kappa G A [N]


def outer_diameter(profile: Profile, z: Array) -> Array:
    """Return the outer diameter [m] at positions `z` from the barrel tip [m], in the shape of `z`.

    Between the stations of the profile the diameter follows a monotone cubic. It does not
    overshoot, so a straight barrel stays straight. Beyond an end of the bat, the cubic at this end
    is extrapolated; no error is raised.
    """
    return _between_stations(profile, profile.outer_diameter, z)


def wall_thickness(profile: Profile, z: Array) -> Array:
    """Return the wall thickness [m] of a hollow bat at positions `z` from the barrel tip [m].

    The result has the shape of `z`. It is interpolated like `outer_diameter`. Raises
    `AssertionError` for a solid bat.
    """
    assert profile.wall is not None
    return _between_stations(profile, profile.wall, z)


def barrel_radius(profile: Profile) -> Array:
    """Return the outer radius [m] 6 in from the tip, as an array of shape ().

    A laboratory measures the radius at this position.
    """
    return outer_diameter(profile, np.array(6 * INCH)) / 2


def radius_cubics(profile: Profile) -> tuple[Array, Array]:
    """Return knots (k + 1,) and coefficients (4, k) of a piecewise cubic for the outer radius [m].

    Column i gives the radius between knots i and i + 1 as a cubic in the distance from knot i [m],
    starting with the highest power. The radius is half the result of `outer_diameter`. The knots
    are distances from the barrel tip [m].
    """
    cubic = _interpolant(profile.z, profile.outer_diameter)
    return cubic.knots, cubic.coefficients / 2


def section(body: BatBody, z: Array) -> Section:
    """Return mass, rotary inertia and stiffnesses per unit length at positions `z` [SI].

    `z` is the distance from the barrel tip [m]. Each field of the result has the shape of `z`.
    Lumps are not included.
    """
    material = body.material
    d = outer_diameter(body.profile, z)
    if body.profile.wall is None:
        bore = np.zeros_like(d)
    else:
        bore = d - 2 * wall_thickness(body.profile, z)
    area = np.pi / 4 * (d**2 - bore**2)
    second_moment = np.pi / 64 * (d**4 - bore**4)
    density = material.density * (1 + material.density_tilt * (1 - 2 * z / body.length))
    return Section(
        mass=density * area,
        rotary_inertia=density * second_moment,
        bending_stiffness=material.youngs_modulus * second_moment,
        shear_stiffness=material.shear_coefficient * material.shear_modulus * area,
    )


def _between_stations(profile: Profile, values: tuple[float, ...], z: Array) -> Array:
    return _interpolant(profile.z, values)(z)


@lru_cache(maxsize=16)
def _interpolant(z: tuple[float, ...], values: tuple[float, ...]) -> PiecewiseCubic:
    return monotone_cubic(np.array(z), np.array(values))


Values = TypeVar("Values", float, Array)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidBat(Generic[Values]):
    """One rigid bat, or n rigid bats of one length: each value is a number or has shape (n,)."""

    length: float  # [m]
    mass: Values  # [kg]
    first_moment: Values  # first moment of the mass about the tip [kg m]
    second_moment: Values  # second moment of the mass about the tip [kg m^2]

    @property
    def z_cm(self) -> Values:
        """Center of mass, from the barrel tip [m]."""
        return self.first_moment / self.mass

    @overload
    def inertia(self, z: float) -> float: ...
    @overload
    def inertia(self, z: Array) -> Array: ...
    def inertia(self, z: float | Array) -> float | Array:
        """Return the moment of inertia about `z` [m from the tip], in the shape of `z` [kg m^2]."""
        return self.second_moment + z * (z * self.mass - 2 * self.first_moment)

    @property
    def inertia_cm(self) -> Values:
        """Moment of inertia about the center of mass [kg m^2]."""
        return self.inertia(self.z_cm)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beam(RigidBat[float]):
    """Matrices of a beam over its degrees of freedom: w of all nodes, then psi of all nodes."""

    mesh: Mesh
    mass_matrix: Array  # (2 n, 2 n)
    stiffness_matrix: Array  # (2 n, 2 n)

    def heave(self) -> Array:
        """Return the degrees of freedom of a unit translation, (2 n,)."""
        return _shift(self.mesh)

    def turn(self, z: float) -> Array:
        """Return the degrees of freedom of a unit rotation about `z` [m], (2 n,)."""
        return _turn(self.mesh, z)


def _shift(mesh: Mesh) -> Array:
    return np.concatenate((np.ones_like(mesh.nodes), np.zeros_like(mesh.nodes)))


def _turn(mesh: Mesh, z: float) -> Array:
    return np.concatenate((z - mesh.nodes, np.ones_like(mesh.nodes)))


def beam_of(
    body: BatBody,
    support: Support | None = None,
    *,
    order: int = ORDER,
    element_size: float = ELEMENT_SIZE,
) -> Beam:
    """Return the beam of a bat: mesh, matrices and rigid-body values [SI].

    The mesh has a node at the support. By default there is no support. The matrices describe the
    free bat; `modes_of` applies the support. `order` is the polynomial degree of the elements, and
    no element is longer than `element_size` [m]. Raises `InputError` if the support is beyond the
    bat, its stiffness is not positive, or the order is below 4.
    """
    if order < 4:
        raise InputError("beam", "order", order, "allowed: 4 and up, lower orders lock")
    support_z = support_position(support or Free(), body.length)
    return _beam(replace(body, hoop=None), support_z, order, element_size)


@lru_cache(maxsize=1024)  # the bats of a block are needed in each round
def rigid_bat(body: BatBody) -> RigidBat[float]:
    """Return a bat as a rigid body: length, mass, and first and second moments of mass [SI].

    The moments refer to the barrel tip. Lumps such as a knob are included.
    """
    beam = beam_of(body)
    return RigidBat(
        length=beam.length,
        mass=beam.mass,
        first_moment=beam.first_moment,
        second_moment=beam.second_moment,
    )


@lru_cache(maxsize=16)
def _beam(body: BatBody, support_z: float | None, order: int, element_size: float) -> Beam:
    keep = (0.0, body.length) if support_z is None else (0.0, support_z, body.length)
    places = (*body.profile.z, *(lump.z for lump in body.lumps))
    mesh = mesh_through(places, keep, size=element_size, order=order)
    mass, stiffness = _assemble(mesh, body)
    for lump in body.lumps:
        _add_lump(mass, mesh, lump)
    shift, turn = _shift(mesh), _turn(mesh, 0.0)  # a turn about the tip moves the mass backward
    return Beam(
        length=float(mesh.boundaries[-1]),
        mass=float(shift @ mass @ shift),
        first_moment=-float(shift @ mass @ turn),
        second_moment=float(turn @ mass @ turn),
        mesh=mesh,
        mass_matrix=mass,
        stiffness_matrix=stiffness,
    )


def _assemble(mesh: Mesh, body: BatBody) -> tuple[Array, Array]:
    reference = reference_element(mesh.order)
    # The outline is cubic in z, so E I has degree 12 in z and is multiplied by two derivatives of
    # degree order - 1. This number of Gauss points integrates every term exactly.
    x, gauss = gauss_points(mesh.order + 6)
    half = np.diff(mesh.boundaries)[:, None] / 2
    z = mesh.boundaries[:-1, None] + half * (1 + x)
    N = reference.basis(x)
    slope = N @ reference.differentiation
    at, weight = section(body, z), gauss * half
    once = (1 / half[:, 0])[:, None, None]
    twice = once**2

    def integrate(density: Array, left: Array, right: Array) -> Array:
        """Return the element matrices (element, order + 1, order + 1) of a density."""
        return np.asarray(np.einsum("eg,gi,gj->eij", density * weight, left, right))

    shear = at.shear_stiffness
    mixed = integrate(shear, slope, N) * once  # coupling of w and psi
    turning = integrate(at.bending_stiffness, slope, slope) * twice + integrate(shear, N, N)
    n = mesh.nodes.size
    mass, stiffness = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    for matrix, block, row, column in (
        (mass, integrate(at.mass, N, N), 0, 0),
        (mass, integrate(at.rotary_inertia, N, N), n, n),
        (stiffness, integrate(shear, slope, slope) * twice, 0, 0),
        (stiffness, mixed, 0, n),
        (stiffness, mixed.transpose(0, 2, 1), n, 0),
        (stiffness, turning, n, n),
    ):
        for first, element in zip(mesh.connectivity[:, 0].tolist(), block, strict=True):
            top, left, size = first + row, first + column, len(element)
            matrix[top : top + size, left : left + size] += element
    return mass, stiffness


def _add_lump(mass: Array, mesh: Mesh, lump: Lump) -> None:
    n = mesh.nodes.size
    at = mesh.interpolation(np.full((1, 1, 1), lump.z)).toarray()[0]
    mass[:n, :n] += lump.mass * np.outer(at, at)
    mass[n:, n:] += lump.inertia * np.outer(at, at)
