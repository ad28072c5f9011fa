"""Laws of the swing: angular speed of a bat as a function of its moment of inertia."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import INCH

Floats = float | NDArray[np.float64]
KNOB_OFFSET = INCH  # distance of the swing point from the knob end, on the bat [m]


class SwingLaw(Protocol):
    """Angular speed of the swing as a function of the bat's inertia about the law's axis."""

    @property
    def inertia_0(self) -> float:
        """Inertia of the bat that is swung at the reference angular speed [kg m^2]."""
        ...

    @property
    def axis_beyond_knob(self) -> float:
        """Distance of the axis beyond the knob end [m], negative if it lies on the bat."""
        ...

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the law's axis [kg m^2]."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLawSwing:
    """``omega = omega0 (I0 / I)^n``, Eqs. (13) and (14), with n from 0 to 1/2 (data: about 0.3)."""

    angular_speed_0: float  # [rad/s]
    inertia_0: float  # [kg m^2]
    exponent: float

    @property
    def axis_beyond_knob(self) -> float:
        """Position of the swing point, which lies on the handle [m]."""
        return -KNOB_OFFSET

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the swing point [kg m^2]."""
        return self.angular_speed_0 * (self.inertia_0 / inertia) ** self.exponent


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergySwing:
    """``omega = omega0 ((I0 + I_batter) / (I + I_batter))^(1/2)``, Sec. III B of the paper.

    The kinetic energy of bat and batter is the same for all bats. Both rotate about the vertical
    axis of the batter's body.
    """

    angular_speed_0: float  # angular speed with the bat of `inertia_0` [rad/s]
    inertia_0: float  # inertia of the bat about the body's axis [kg m^2]
    inertia_batter: float  # [kg m^2]
    axis_beyond_knob: float  # distance of the knob end from the body's axis [m]

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the body's axis [kg m^2]."""
        whole_0 = self.inertia_0 + self.inertia_batter
        return self.angular_speed_0 * (whole_0 / (inertia + self.inertia_batter)) ** 0.5


def bat_speed(angular_speed: Floats, length: float, z: Floats) -> Floats:
    """Return the speed [m/s] of a bat at a distance `z` [m] from the barrel tip.

    The bat of `length` [m] rotates at `angular_speed` [rad/s] about the swing point, 1 in from its
    knob. The speed is negative between the swing point and the knob. Angular speed and `z`
    broadcast.
    """
    return angular_speed * (length - KNOB_OFFSET - z)
