"""Closed forms of the ball-bat collision, for reduction and studies, not for the simulation.

Symbols: ``e_A`` collision efficiency, ``e`` restitution of ball and bat, ``e0`` of the ball
on a rigid wall, ``r`` recoil factor, ``m`` ball mass, ``M`` bat mass. Every function
broadcasts over numbers and arrays, works in SI (or any coherent units) and passes NaN
through: a shot without a rebound is a result, not an error. Equation numbers are those of
the 2003 paper (source key ``nathan2003``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = float | NDArray[np.float64]


class EnergyFractions(NamedTuple):
    """Shares of the collision energy (bat rest frame); the three add to 1."""

    ball: Floats
    bat: Floats
    dissipated: Floats


def collision_efficiency(v_ball: Floats, v_bat: Floats, v_f: Floats) -> Floats:
    """Return e_A from ball, bat and batted-ball speeds [m/s] at the impact. Eq. (2)."""
    return (v_f - v_bat) / (v_ball + v_bat)


def batted_speed(e_A: Floats, v_ball: Floats, v_bat: Floats) -> Floats:
    """Return the batted-ball speed [m/s]. Eq. (3)."""
    return e_A * v_ball + (1 + e_A) * v_bat


def besr(e_A: Floats) -> Floats:
    """Return the ball exit speed ratio, which is e_A + 1/2. Eq. (4)."""
    return e_A + 0.5


def bat_performance_factor(e: Floats, e0: Floats) -> Floats:
    """Return the bat performance factor e / e0. Eq. (5)."""
    return e / e0


def restitution_from_efficiency(e_A: Floats, r: Floats) -> Floats:
    """Return e from collision efficiency and recoil factor. Eq. (6)."""
    return e_A * (1 + r) + r


def efficiency_from_restitution(e: Floats, r: Floats) -> Floats:
    """Return e_A from restitution and recoil factor. Eq. (6)."""
    return (e - r) / (1 + r)


def recoil_factor_free(m: Floats, M: Floats, I_cm: Floats, d: Floats) -> Floats:
    """Return r of a free bat struck `d` [m] from its centre of mass. Eqs. (7), (8)."""
    return m * (1 / M + d**2 / I_cm)


def recoil_factor_pivoted(m: Floats, I_p: Floats, b: Floats) -> Floats:
    """Return r of a pivoted bat struck at a distance `b` [m] from the pivot. Eqs. (7), (9)."""
    return m * b**2 / I_p


def parallel_axis(I_cm: Floats, M: Floats, d: Floats) -> Floats:
    """Return the moment of inertia [kg m^2] about an axis `d` [m] from the centre of mass."""
    return I_cm + M * d**2


def centre_of_percussion(z_cm: Floats, I_cm: Floats, M: Floats, z_pivot: Floats) -> Floats:
    """Return the position [m] at which an impact exerts no force on a pivot at `z_pivot` [m].

    Eq. (11). It tends to infinity as the pivot approaches the centre of mass.
    """
    return z_cm - I_cm / (M * (z_pivot - z_cm))


def energy_fractions(e: Floats, r: Floats) -> EnergyFractions:
    """Return the shares of the ball, the rigid bat and the losses in the energy. Eqs. (10)."""
    return EnergyFractions(
        ball=((e - r) / (1 + r)) ** 2,
        bat=r * ((1 + e) / (1 + r)) ** 2,
        dissipated=(1 - e**2) / (1 + r),
    )


def batted_speed_gain(v_rel: Floats, gain_e: Floats, r: Floats) -> Floats:
    """Return the change of batted-ball speed [m/s] for a change of e. Eq. (12)."""
    return v_rel * gain_e / (1 + r)


def rebound_speed_from_recoil(
    I_p: Floats, omega: Floats, m: Floats, b: Floats, v_ball: Floats
) -> Floats:
    """Return the rebound speed [m/s] of a ball from the recoil rate `omega` of a bat at rest.

    Angular momentum about the pivot: ``I_p omega = m b (v_ball + v_f)``.
    """
    return I_p * omega / (m * b) - v_ball


def restitution_of_standard_ball(e: Floats, e0: Floats, standard: float) -> Floats:
    """Return e with a ball of restitution `standard`, from `e` measured with a ball of `e0`.

    An elastic shell and a lossy ball share the energy in the ratio R = shell/ball of their
    stiffnesses: ``e^2 = (e0^2 R + 1)/(R + 1)``, so R follows from e and e0. If e is not above e0
    the shell has no measurable elasticity, and e is in proportion to e0 as for a rigid shell.
    """
    e, e0 = np.asarray(e), np.asarray(e0)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffer = (1 - e**2) / (e**2 - e0**2)
        sprung = np.sqrt((standard**2 * stiffer + 1) / (stiffer + 1))
    return np.where(e > e0, sprung, e * standard / e0)
