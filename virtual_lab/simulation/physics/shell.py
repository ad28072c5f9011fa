"""The n = 2 hoop mode of a hollow bat, computed from its outline and its wall.

The round section becomes an oval, w = W(z) cos 2θ outward. The wall bends without stretching around
the circumference and without shear, so v = -(W/2) sin 2θ and u = -(a W'/4) cos 2θ with the mean
radius a (Lord Rayleigh, Proc. London Math. Soc. 13 (1881) 4; The Theory of Sound, § 233). A length
of barrel then moves with 5/8 of its mass. Four stiffnesses act: bending of the wall around the
circumference, its bending along the barrel and its twist (A. E. H. Love, Mathematical Theory of
Elasticity), and its stretching along the barrel where W is curved (V. Z. Vlasov, General Theory of
Shells, 1949: the semi-membrane theory).

Range: one isotropic wall, up to a fifth of the radius thick, on a barrel that tapers slowly. If the
shell of EA70 may also stretch and shear, its frequency is lower by 1.3 % under a rigid cap and by
.5 % under an open one, and its modal mass differs by up to 4.5 % between 4 and 6 in from the tip
(`tests/simulation/physics/test_shell.py`). Cap, glue and grip add neither mass nor stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import eigh

from virtual_lab.catalog.specs import BatBody
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import outer_diameter, wall_thickness
from virtual_lab.simulation.physics.mesh import gauss_points
from virtual_lab.units import Array

Cap = Literal["rigid", "open"]
DEGREE = 4  # degree of the splines for W
INTERVALS = 40  # number of intervals of the splines; twice as many change the frequency by 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class ShellMode:
    """The lowest n = 2 mode of a hollow bat."""

    frequency: float  # [Hz]
    modal_mass: float  # modal mass for an impact where the deflection is greatest [kg]
    z: Array  # positions from the tip, (n,) [m]
    shape: Array  # deflection at `z`, (n,); 1 where it is greatest

    @property
    def modal_masses(self) -> Array:
        """Modal mass for an impact at each `z`, (n,) [kg]; infinite where nothing moves."""
        with np.errstate(divide="ignore"):
            return np.asarray(self.modal_mass / self.shape**2)


@lru_cache(maxsize=256)
def shell_mode(body: BatBody, cap: Cap = "rigid") -> ShellMode:
    """Return frequency [Hz], modal mass [kg] and shape of the lowest hoop mode of a hollow bat.

    The hoop mode has the circumferential order n = 2: the section becomes an ellipse.

    Parameters
    ----------
    body
        The hollow bat. Its `lumps` (added masses) and its `hoop` (stated hoop mode) are ignored.
    cap
        End cap at the tip. With ``rigid`` the section at the tip stays round, but can warp out of
        its plane. With ``open`` it is free.

    Raises
    ------
    InputError
        The bat is solid.
    """
    if body.profile.wall is None:
        raise InputError("shell mode", "wall", "none", "allowed: a hollow bat")
    ends = np.linspace(0.0, body.length, INTERVALS + 1)
    x, gauss = gauss_points(DEGREE + 2)
    half = body.length / INTERVALS / 2
    z = (ends[:-1, None] + half * (1 + x)).ravel()
    knots = np.concatenate((np.zeros(DEGREE), ends, np.full(DEGREE, body.length)))
    splines = BSpline(knots, np.eye(INTERVALS + DEGREE), DEGREE)
    W, slope, curvature = (splines(z, derivative) for derivative in range(3))

    h, a = wall_thickness(body.profile, z), outer_diameter(body.profile, z) / 2
    a = a - h / 2
    material = body.material
    poisson = material.youngs_modulus / (2 * material.shear_modulus) - 1
    stretching = material.youngs_modulus * h
    bending = stretching * h**2 / (12 * (1 - poisson**2))
    around = np.pi * a * np.tile(half * gauss, INTERVALS)  # weight of a mean square over θ, and z

    def integrate(density: Array, left: Array, right: Array) -> Array:
        return np.asarray((left * (density * around)[:, None]).T @ right)

    coupling = integrate(-3 * poisson * bending / a**2, W, curvature)
    stiffness = (
        integrate(9 * bending / a**4, W, W)
        + integrate(stretching * (a / 4) ** 2 + bending, curvature, curvature)
        + integrate(2 * (1 - poisson) * bending * (3 / (2 * a)) ** 2, slope, slope)
        + coupling
        + coupling.T
    )
    mass = integrate(5 / 4 * material.density * h, W, W)
    free = slice(1 if cap == "rigid" else 0, None)  # only the first spline is not 0 at the tip
    squares, vectors = eigh(stiffness[free, free], mass[free, free], subset_by_index=[0, 0])
    places = np.linspace(0.0, body.length, 1001)
    shape = splines(places)[:, free] @ vectors[:, 0]  # shape of unit modal mass
    greatest = shape[np.argmax(np.abs(shape))]
    return ShellMode(
        frequency=float(np.sqrt(squares[0]) / (2 * np.pi)),
        modal_mass=float(greatest**-2),
        z=places,
        shape=shape / greatest,
    )
