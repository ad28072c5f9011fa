"""Cross-section of a bat along its axis: smooth outline, area, second moment, stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from virtual_lab.catalog.specs import BatBody, Profile

__all__ = ["Section", "outer_diameter", "section"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Per unit length at given places, each of the shape of z."""

    mass: Floats  # rho A [kg/m]
    rotary_inertia: Floats  # rho I [kg m]
    bending_stiffness: Floats  # E I [N m^2]
    shear_stiffness: Floats  # kappa G A [N]


def outer_diameter(profile: Profile, z: Floats) -> Floats:
    """Return the outer diameter [m] at places `z` [m].

    Monotone cubic between the stations (Fritsch and Carlson): no overshoot, so a straight
    barrel stays straight.
    """
    return _between_stations(profile, profile.outer_diameter, z)


def section(body: BatBody, z: Floats) -> Section:
    """Return the section at places `z` [m].

    Parameters
    ----------
    body : BatBody
    z : (...) array
    """
    material = body.material
    d = outer_diameter(body.profile, z)
    if body.profile.wall is None:
        bore = np.zeros_like(d)
    else:
        bore = d - 2 * _between_stations(body.profile, body.profile.wall, z)
    area = np.pi / 4 * (d**2 - bore**2)
    second_moment = np.pi / 64 * (d**4 - bore**4)
    density = material.density * (1 + material.density_tilt * (1 - 2 * z / body.length))
    return Section(
        mass=density * area,
        rotary_inertia=density * second_moment,
        bending_stiffness=material.youngs_modulus * second_moment,
        shear_stiffness=material.shear_coefficient * material.shear_modulus * area,
    )


def _between_stations(profile: Profile, values: tuple[float, ...], z: Floats) -> Floats:
    return np.asarray(_interpolant(profile.z, values)(z))


@lru_cache(maxsize=16)
def _interpolant(z: tuple[float, ...], values: tuple[float, ...]) -> PchipInterpolator:
    return PchipInterpolator(np.array(z), np.array(values))
