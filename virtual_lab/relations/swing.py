"""How fast a batter swings a bat of a given moment of inertia."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import INCH

Floats = float | NDArray[np.float64]
KNOB_OFFSET = INCH  # the bat turns about a point this far from its knob end [m]


class SwingLaw(Protocol):
    """Angular speed of the swing from the bat's inertia about the law's axis."""

    @property
    def inertia_0(self) -> float:
        """Inertia of the bat that is swung at the law's angular speed [kg m^2]."""
        ...

    @property
    def axis_beyond_knob(self) -> float:
        """How far beyond the knob end that axis lies [m]; below 0 it lies on the bat."""
        ...

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the law's axis [kg m^2]."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLawSwing:
    """``omega = omega0 (I0 / I)^n``, Eqs. (13) and (14): n = 0 to 1/2, data about 0.3."""

    angular_speed_0: float  # [rad/s]
    inertia_0: float  # [kg m^2]
    exponent: float

    @property
    def axis_beyond_knob(self) -> float:
        """The point of turning, which lies on the handle [m]."""
        return -KNOB_OFFSET

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the swing point [kg m^2]."""
        return self.angular_speed_0 * (self.inertia_0 / inertia) ** self.exponent


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergySwing:
    """``omega = omega0 ((I0 + I_batter) / (I + I_batter))^(1/2)``, the paper's Sec. III B.

    The same energy goes into bat and batter, both about the vertical axis of the batter's body.
    """

    angular_speed_0: float  # [rad/s] with the bat of inertia_0
    inertia_0: float  # of the bat, about the body's axis [kg m^2]
    inertia_batter: float  # [kg m^2]
    axis_beyond_knob: float  # of the knob end from the body's axis [m]

    def angular_speed(self, inertia: Floats) -> Floats:
        """Return the angular speed [rad/s] for an inertia about the body's axis [kg m^2]."""
        whole_0 = self.inertia_0 + self.inertia_batter
        return self.angular_speed_0 * (whole_0 / (inertia + self.inertia_batter)) ** 0.5


def bat_speed(angular_speed: Floats, length: float, z: Floats) -> Floats:
    """Return the speed [m/s] of a bat of `length` at `z` [m], turning near its knob."""
    return angular_speed * (length - KNOB_OFFSET - z)
