"""Equations of the 2003 paper that no reduction uses: energy shares and gain of speed."""

from __future__ import annotations

from typing import NamedTuple

from virtual_lab.measurement.reduction.kinematics import Floats


class EnergyFractions(NamedTuple):
    """Shares of the collision energy after the collision, bat initially at rest. Their sum is 1."""

    ball: Floats
    bat: Floats
    dissipated: Floats


def energy_fractions(e: Floats, r: Floats) -> EnergyFractions:
    """Return the energies of ball and rigid bat after a collision, and the lost energy.

    Each is a share of the ball's kinetic energy before the collision, with the bat at rest. The sum
    of the three shares is 1. Source: Eqs. (10) of Nathan (2003).
    """
    return EnergyFractions(
        ball=((e - r) / (1 + r)) ** 2,
        bat=r * ((1 + e) / (1 + r)) ** 2,
        dissipated=(1 - e**2) / (1 + r),
    )


def batted_speed_gain(v_rel: Floats, gain_e: Floats, r: Floats) -> Floats:
    """Return the change of the batted-ball speed [m/s] caused by a change of e.

    `v_rel` is the relative speed of ball and bat [m/s], `gain_e` is the change of e, and `r` is the
    recoil factor. Source: Eq. (12) of Nathan (2003).
    """
    return v_rel * gain_e / (1 + r)
