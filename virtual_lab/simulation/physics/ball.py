"""Force laws of the ball, and the collision of a ball with a rigid wall.

All simulations except studies of the force law itself use the power law: loading
``F = k u^a``, unloading ``F = F_max (u / u_max)^b``. The areas under the two curves give
``e0^2 = (a + 1) / (b + 1)`` at every speed.

The alternative is the law of Hunt and Crossley, ``F = k u^a (1 + c u')``. On a rigid wall
``w dw / (1 + c w) = -(k / m) u^a du``, so ``(1 + e0) c v = ln((1 + c v) / (1 - e0 c v))``.
Therefore c follows from e0 and the speed and does not depend on mass, stiffness or exponent
(K. H. Hunt and F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import expm1, log1p
from typing import NamedTuple, Self

import numpy as np
from scipy.special import gammaln

from virtual_lab.units import Array


class WallContact(NamedTuple):
    """Collision with a rigid wall at rest; all arrays have one shape."""

    compression: Array  # largest compression [m]
    force: Array  # largest force [N]
    compression_time: Array  # [s]
    expansion_time: Array  # [s]

    @property
    def time(self) -> Array:
        """Duration of the contact [s]."""
        return self.compression_time + self.expansion_time


def unloading_exponent(exponent: Array, restitution: Array) -> Array:
    """Return the unloading exponent b = (a + 1) / e0² - 1 of a ball, dimensionless.

    `exponent` is the loading exponent a, and `restitution` is e0. The arguments broadcast.
    """
    return (exponent + 1) / restitution**2 - 1


def wall_contact(
    mass: Array, speed: Array, stiffness: Array, exponent: Array, restitution: Array
) -> WallContact:
    """Return the collision of a power-law ball with a rigid wall: compression, force and times.

    The results have the common shape of the arguments, in SI. At speed 0, compression and force are
    0 and the times are NaN.

    Parameters
    ----------
    mass
        Mass of the ball, or reduced mass [kg].
    speed
        Approach speed [m/s].
    stiffness, exponent
        k [N/m^a] and a of the loading curve F = k u^a.
    restitution
        e0 of the ball.
    """
    a, b = exponent, unloading_exponent(exponent, restitution)
    compression = ((a + 1) * mass * speed**2 / (2 * stiffness)) ** (1 / (a + 1))
    return WallContact(
        compression=compression,
        force=stiffness * compression**a,
        compression_time=compression / speed * _half_time(a + 1),
        expansion_time=compression / (restitution * speed) * _half_time(b + 1),
    )


def _half_time(n: Array) -> Array:
    """Return the integral of (1 - x^n)^(-1/2) from 0 to 1."""
    return np.asarray(np.sqrt(np.pi) * np.exp(gammaln(1 + 1 / n) - gammaln(0.5 + 1 / n)))


class Event(StrEnum):
    """Event that ends one branch of a force law and begins another."""

    TOUCH = "touch"  # ball and bat meet
    TURN = "turn"  # compression stops growing
    BACK = "back"  # compression grows again before release
    FULL = "full"  # compression has returned to its peak
    RELEASE = "release"  # compression is zero again


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """One smooth branch of a force law."""

    force: Callable[[float, float], float]  # force [N] from compression [m] and its rate [m/s]
    ends: Mapping[Event, int]  # events that end the branch, with the sign of their zero crossing
    peak: float = 0.0  # largest compression so far, at which `Event.FULL` occurs [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLaw:
    """Power laws for loading and unloading; reloading follows the unloading curve."""

    stiffness: float  # k [N/m^a]
    exponent: float  # a
    unloading: float  # b

    @classmethod
    def of(cls, *, stiffness: float, exponent: float, restitution: float, speed: float) -> Self:
        """Return the law of a ball. The speed is not used."""
        del speed
        unloading = (exponent + 1) / restitution**2 - 1
        return cls(stiffness=stiffness, exponent=exponent, unloading=unloading)

    def branch(self, event: Event, compression: float, before: Branch | None) -> Branch:
        """Return the branch that begins with `event` at `compression` [m].

        `before` is the branch that ended, None at touch.
        """
        k, a, b = self.stiffness, self.exponent, self.unloading
        if before is None or event is Event.FULL:
            return Branch(force=lambda u, _: k * u**a, ends={Event.TURN: -1})
        # The peak is the end of the first loading, not of a reloading.
        peak = before.peak or compression
        top = k * peak**a
        down = event is Event.TURN
        return Branch(
            force=lambda u, _: top * (u / peak) ** b,
            ends={Event.RELEASE: -1, Event.BACK: 1} if down else {Event.FULL: 1, Event.TURN: -1},
            peak=peak,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class HuntCrossley:
    """Power law with a damping that increases with the compression. The force is never negative."""

    stiffness: float  # k [N/m^a]
    exponent: float  # a
    damping: float  # c [s/m]

    @classmethod
    def of(cls, *, stiffness: float, exponent: float, restitution: float, speed: float) -> Self:
        """Return the law with the damping that gives e0 on a wall at `speed`."""
        damping = _wall_damping(restitution) / speed
        return cls(stiffness=stiffness, exponent=exponent, damping=damping)

    def branch(self, event: Event, compression: float, before: Branch | None) -> Branch:
        """Return the branch that begins with `event`: compression or expansion."""
        del compression, before
        down = event is Event.TURN
        return Branch(
            force=self._force, ends={Event.RELEASE: -1, Event.BACK: 1} if down else {Event.TURN: -1}
        )

    def _force(self, u: float, rate: float) -> float:
        return float(self.stiffness * u**self.exponent * max(1 + self.damping * rate, 0.0))

    def wall_contact(self, mass: float, speed: float) -> WallContact:
        """Return the collision with a rigid wall at `speed` [m/s], by quadrature.

        The integral is taken over ln(1 + c w), where w is the rate of compression, because then
        ``dt = m / (c k u^a)`` per unit of it. A substitution with the power a + 1 removes the
        singularity at touch and release.
        """
        k, a, c = self.stiffness, self.exponent, self.damping
        if c == 0:
            return wall_contact(*(np.array(number) for number in (mass, speed, k, a, 1.0)))

        def depth(end: float, progress: Array) -> Array:
            work = (-np.exp(end) * np.expm1(-progress) - progress) / c**2  # per unit mass
            return np.asarray(((a + 1) * mass / k * work) ** (1 / (a + 1)))

        x, gauss = np.polynomial.legendre.leggauss(200)
        s, weight = (1 + x) / 2, gauss / 2 * (a + 1)
        touch = log1p(c * speed)
        times = []
        for end in (touch, -_solve_release(c * speed)):
            u = depth(end, end * s ** (a + 1))
            times.append(np.sum(weight * (s / u) ** a) * mass * abs(end) / (c * k))
        progress = np.linspace(0, touch, 10_001)
        return WallContact(
            compression=depth(touch, np.array(touch)),
            force=np.asarray((k * depth(touch, progress) ** a * np.exp(touch - progress)).max()),
            compression_time=np.asarray(times[0]),
            expansion_time=np.asarray(times[1]),
        )


BallLaw = PowerLaw | HuntCrossley  # force of one ball in one collision, branch by branch
# function of stiffness, exponent, restitution and approach speed that returns the ball's law
LawOfBall = Callable[..., BallLaw]


def _solve_release(x: float) -> float:
    """Return -ln(1 - c w), where w is the speed at release, for an approach with c v = x."""
    from scipy.optimize import brentq

    spent = x - log1p(x)
    return float(brentq(lambda p: p + expm1(-p) - spent, 0.0, spent + 2, xtol=1e-16, rtol=1e-15))


def _wall_damping(restitution: float) -> float:
    """Return c v of a Hunt-Crossley ball from its restitution e0 on a wall."""
    from scipy.optimize import brentq

    e = restitution
    if e == 1:
        return 0.0

    def excess(p: float) -> float:
        x = -expm1(-p) / e  # 1 - e x can approach zero, but its logarithm -p remains finite
        return (1 + e) * x - log1p(x) - p

    # x is about 1.5 (1 - e) near e = 1 and larger for smaller e, so this bound excludes the root 0.
    low = -log1p(-0.1 * e * (1 - e))
    return -expm1(-float(brentq(excess, low, (1 + e) / e, xtol=1e-16))) / e
