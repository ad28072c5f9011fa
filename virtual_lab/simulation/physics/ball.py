"""Laws of the ball's force, and what a ball does on a rigid wall.

The power law, with which everything but a study of the law itself is done: loading
``F = k u^a``, unloading ``F = F_max (u / u_max)^b``. The two areas give
``e0^2 = (a + 1) / (b + 1)`` whatever the speed.

Hunt and Crossley's, beside it: ``F = k u^a (1 + c u')``. Between two impacts of a wall
``w dw / (1 + c w) = -(k / m) u^a du``, so ``(1 + e0) c v = ln((1 + c v) / (1 - e0 c v))``: c
follows from e0 and the speed alone, whatever mass, stiffness and exponent (K. H. Hunt and
F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import expm1, log1p
from typing import NamedTuple, Self

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln

from virtual_lab.units import Array


class WallContact(NamedTuple):
    """A collision with a rigid wall at rest, arrays of one shape."""

    compression: Array  # greatest, [m]
    force: Array  # greatest, [N]
    compression_time: Array  # [s]
    expansion_time: Array  # [s]

    @property
    def time(self) -> Array:
        """Time in contact [s]."""
        return self.compression_time + self.expansion_time


def unloading_exponent(exponent: Array, restitution: Array) -> Array:
    """Return b of a ball with loading exponent a and restitution e0."""
    return (exponent + 1) / restitution**2 - 1


def wall_contact(
    mass: Array, speed: Array, stiffness: Array, exponent: Array, restitution: Array
) -> WallContact:
    """Return the closed forms for a rigid wall, of arrays that broadcast.

    Ball (or reduced) mass [kg], approach speed [m/s], k [N/m^a], a, e0. Energy gives
    ``u_max = ((a + 1) m v^2 / 2 k)^(1 / (a + 1))``; with `_half_time` C(n), each half takes
    ``u_max C(n) / v`` with its own power of the compression and its own speed.
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
    """What ends one branch of a law and begins another."""

    TOUCH = "touch"  # ball and bat meet
    TURN = "turn"  # the compression stops growing
    BACK = "back"  # it grows again before release
    FULL = "full"  # it has grown back to its peak
    RELEASE = "release"  # it is gone


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """One smooth piece of a law."""

    force: Callable[[float, float], float]  # of compression [m] and its rate [m/s], [N]
    ends: Mapping[Event, int]  # events that end it, with the sign of their crossing
    peak: float = 0.0  # greatest compression so far, which `Event.FULL` waits for [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLaw:
    """Two power laws. A compression that turns round re-loads along the unloading one."""

    stiffness: float  # k [N/m^a]
    exponent: float  # a
    unloading: float  # b

    @classmethod
    def of(cls, *, stiffness: float, exponent: float, restitution: float, speed: float) -> Self:
        """Return the law of a ball; the speed does not matter."""
        del speed
        unloading = (exponent + 1) / restitution**2 - 1
        return cls(stiffness=stiffness, exponent=exponent, unloading=unloading)

    def branch(self, event: Event, compression: float, before: Branch | None) -> Branch:
        """Return the branch that an event at a compression [m] begins; at touch, None before.

        It loads up to the peak and unloads from it.
        """
        k, a, b = self.stiffness, self.exponent, self.unloading
        if before is None or event is Event.FULL:
            return Branch(force=lambda u, _: k * u**a, ends={Event.TURN: -1})
        # a peak is where loading turned, not where a re-loading did
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
    """A power law with a damping that grows with the compression; it never pulls."""

    stiffness: float  # k [N/m^a]
    exponent: float  # a
    damping: float  # c [s/m]

    @classmethod
    def of(cls, *, stiffness: float, exponent: float, restitution: float, speed: float) -> Self:
        """Return the law with the damping that gives e0 on a wall at `speed`."""
        damping = _wall_damping(restitution) / speed
        return cls(stiffness=stiffness, exponent=exponent, damping=damping)

    def branch(self, event: Event, compression: float, before: Branch | None) -> Branch:
        """Return the branch; compression and expansion differ in what ends them."""
        del compression, before
        down = event is Event.TURN
        return Branch(
            force=self._force, ends={Event.RELEASE: -1, Event.BACK: 1} if down else {Event.TURN: -1}
        )

    def _force(self, u: float, rate: float) -> float:
        return float(self.stiffness * u**self.exponent * max(1 + self.damping * rate, 0.0))

    def wall_contact(self, mass: float, speed: float) -> WallContact:
        """Return what happens on a rigid wall at `speed` [m/s], by quadrature.

        Over the logarithm of 1 + c w, w the rate, ``dt`` is ``m / (c k u^a)``; with what has
        gone of it as the power a + 1 of the variable of integration nothing is singular.
        """
        k, a, c = self.stiffness, self.exponent, self.damping
        if c == 0:
            return wall_contact(*(np.array(number) for number in (mass, speed, k, a, 1.0)))

        def depth(end: float, gone: Array) -> Array:
            work = (-np.exp(end) * np.expm1(-gone) - gone) / c**2  # per unit mass
            return np.asarray(((a + 1) * mass / k * work) ** (1 / (a + 1)))

        x, gauss = np.polynomial.legendre.leggauss(200)
        s, weight = (1 + x) / 2, gauss / 2 * (a + 1)
        touch = log1p(c * speed)
        times = []
        for end in (touch, -_released(c * speed)):
            u = depth(end, end * s ** (a + 1))
            times.append(np.sum(weight * (s / u) ** a) * mass * abs(end) / (c * k))
        gone = np.linspace(0, touch, 10_001)
        return WallContact(
            compression=depth(touch, np.array(touch)),
            force=np.asarray((k * depth(touch, gone) ** a * np.exp(touch - gone)).max()),
            compression_time=np.asarray(times[0]),
            expansion_time=np.asarray(times[1]),
        )


BallLaw = PowerLaw | HuntCrossley  # the force of one ball in one collision, branch by branch
# its stiffness, exponent, restitution and speed of approach to a law that gives e0 on a wall
LawOfBall = Callable[..., BallLaw]


def _released(x: float) -> float:
    """Return -ln(1 - c w) at release, w the speed there, of a ball that met a wall at c v = x."""
    spent = x - log1p(x)
    return float(brentq(lambda p: p + expm1(-p) - spent, 0.0, spent + 2, xtol=1e-16, rtol=1e-15))


def _wall_damping(restitution: float) -> float:
    """Return c v of a Hunt-Crossley ball with a wall restitution e0."""
    e = restitution
    if e == 1:
        return 0.0

    def excess(p: float) -> float:
        x = -expm1(-p) / e  # as 1 - e x runs to zero, its logarithm p stays a plain number
        return (1 + e) * x - log1p(x) - p

    # x is about 1.5 (1 - e) near e = 1 and more below: the root at zero is left out
    low = -log1p(-0.1 * e * (1 - e))
    return -expm1(-float(brentq(excess, low, (1 + e) / e, xtol=1e-16))) / e
