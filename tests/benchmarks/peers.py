"""The same collisions by general-purpose integrators, each used as well as possible.

All share the compiled right-hand side of `modal_kernel` in dimensionless numbers: time over a
millisecond, s over the distance that the ball travels in it, p by s and its impulse, so that one
tolerance fits all. A phase ends on an event, so that no step crosses a corner of the ball's force
law: loading ends at the turn; unloading ends at release or at renewed approach; that approach ends
at the greatest compression so far. No second contact is searched for: the compared scenes have
none, which saves the peers work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from virtual_lab.simulation.collision.stepping import CollisionBatch

__all__ = ["WINDOW", "Peer", "Scaled", "approach", "by_solve_ivp", "derivative"]

Floats = NDArray[np.float64]
Law = tuple[float, float, float]  # coefficient, scale of the approach, power

LIKELY = 1e-3  # typical contact time [s]
WINDOW = 20.0  # largest contact time, in typical ones
FAST = {"reassoc", "contract", "nsz"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaled:
    """Scenes in dimensionless numbers; the ball's speed is 1."""

    shapes: Floats  # (n, N)
    squares: Floats  # (n, N)
    balls: Floats  # (n, 3): coefficient, loading and unloading power

    @classmethod
    def of(cls, struck: CollisionBatch) -> Self:
        """Return scenes in dimensionless numbers, without residual flexibility."""
        c, v, a = struck.inverse_mass, struck.speed, struck.exponent
        coefficient = LIKELY * c * struck.stiffness * (LIKELY * v) ** a / v
        return cls(
            shapes=struck.shapes / c[:, None],
            squares=LIKELY**2 * struck.squares[struck.bat],
            balls=np.stack((coefficient, a, struck.unloading), axis=1),
        )


Peer = Callable[[Scaled], Floats]  # function of scenes that returns the rates of s at release


@njit(fastmath=FAST)
def approach(y: Floats, g: Floats, start: int) -> float:
    """Return the approach x = s - g p, with p and s from `start` of y on (N + 1 for rates)."""
    x = y[start + g.size]
    for i in range(g.size):
        x -= g[i] * y[start + i]
    return float(x)


@njit(fastmath=FAST)
def derivative(y: Floats, law: Law, g: Floats, w2: Floats, out: Floats) -> None:
    """Write the derivative of a state (2 N + 2,) into `out`."""
    coefficient, scale, power = law
    n = g.size
    x = y[n]
    for i in range(n):
        x -= g[i] * y[i]
    force = coefficient * (x / scale) ** power if x > 0.0 else 0.0
    for i in range(n):
        out[i] = y[n + 1 + i]
        out[n + 1 + i] = force - w2[i] * y[i]
    out[n] = y[2 * n + 1]
    out[2 * n + 1] = -force


@njit
def _new(y: Floats, law: Law, g: Floats, w2: Floats) -> Floats:
    out = np.empty_like(y)
    derivative(y, law, g, w2, out)
    return out


@dataclass(frozen=True, slots=True)
class _Crossing:
    """An event for `solve_ivp`: a function with two attributes."""

    shape: Floats
    start: int  # first index of p and s, as in `approach`
    direction: float
    level: float = 0.0
    terminal: bool = True

    def __call__(self, _: float, y: Floats) -> float:
        return approach(y, self.shape, self.start) - self.level


def by_solve_ivp(method: str, tolerance: float) -> Peer:
    """Return SciPy's integrator with this method and tolerance."""

    def rates(scaled: Scaled) -> Floats:
        scenes = zip(scaled.shapes, scaled.squares, scaled.balls, strict=True)
        return np.array([_release(method, tolerance, *scene) for scene in scenes])

    return rates


def _release(method: str, tolerance: float, g: Floats, w2: Floats, ball: Floats) -> float:
    """Follow one scene phase by phase, and return the rate of s at release."""
    k, a, b = (float(number) for number in ball)
    n = g.size
    turn, back, release = (
        _Crossing(g, n + 1, -1.0),
        _Crossing(g, n + 1, 1.0),
        _Crossing(g, 0, -1.0),
    )
    y, t, peak = np.append(np.zeros(2 * n + 1), 1.0), 0.0, 0.0
    loading, law, events = True, (k, 1.0, a), [turn]
    while True:
        solution = solve_ivp(
            lambda _, y, law=law: _new(y, law, g, w2),
            (t, WINDOW),
            y,
            method=method,
            rtol=tolerance,
            atol=tolerance,
            events=events,
        )
        if solution.status != 1:  # missing release, because the tolerance was too wide
            return float("nan")
        t, y = float(solution.t[-1]), solution.y[:, -1]
        met = next(one for one, at in zip(events, solution.t_events, strict=True) if at.size)
        if met is release:
            return float(y[-1])
        if met is turn:
            if loading:
                peak = approach(y, g, 0)
                law = (k * peak**a, peak, b)
            loading, events = False, [release, back]
        elif met is back:
            events = [_Crossing(g, 0, 1.0, peak), turn]
        else:
            loading, law, events = True, (k, 1.0, a), [turn]
