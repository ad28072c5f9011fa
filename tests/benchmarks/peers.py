"""The same collisions by integrators for any equation, each as well as it can be used.

All share the right-hand side, compiled, of `modal_kernel` in numbers without unit: time over a
millisecond, s over what the ball would go in it, p by s and its impulse, so that one tolerance
fits all. A phase ends on an event and no step crosses a corner of the ball's law: loading ends
on the turn, unloading on release or where the approach grows again, that on the greatest
compression so far. No second contact is looked for: the scenes compared have none, and it
spares the peers work.
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

LIKELY = 1e-3  # s, a contact
WINDOW = 20.0  # over it
FAST = {"reassoc", "contract", "nsz"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaled:
    """Scenes without units; a ball comes at speed 1."""

    shapes: Floats  # (n, N)
    squares: Floats  # (n, N)
    balls: Floats  # (n, 3): coefficient, loading and unloading power

    @classmethod
    def of(cls, struck: CollisionBatch) -> Self:
        """Return what is left of scenes when units are gone; no residual flexibility."""
        c, v, a = struck.inverse_mass, struck.speed, struck.exponent
        coefficient = LIKELY * c * struck.stiffness * (LIKELY * v) ** a / v
        return cls(
            shapes=struck.shapes / c[:, None],
            squares=LIKELY**2 * struck.squares[struck.bat],
            balls=np.stack((coefficient, a, struck.unloading), axis=1),
        )


Peer = Callable[[Scaled], Floats]  # rates of s at release


@njit(fastmath=FAST)
def approach(y: Floats, g: Floats, start: int) -> float:
    """Return x of p, s that begin at `start` of y: from N + 1 on there are their rates."""
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
    """An event as `solve_ivp` wants it: a function with two attributes."""

    shape: Floats
    start: int  # as of `approach`
    direction: float
    level: float = 0.0
    terminal: bool = True

    def __call__(self, _: float, y: Floats) -> float:
        return approach(y, self.shape, self.start) - self.level


def by_solve_ivp(method: str, tolerance: float) -> Peer:
    """Return SciPy's integrator with one of its methods."""

    def rates(scaled: Scaled) -> Floats:
        scenes = zip(scaled.shapes, scaled.squares, scaled.balls, strict=True)
        return np.array([_release(method, tolerance, *scene) for scene in scenes])

    return rates


def _release(method: str, tolerance: float, g: Floats, w2: Floats, ball: Floats) -> float:
    """Follow one scene phase by phase; return the rate of s at release."""
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
        if solution.status != 1:  # no release: the tolerance was too wide
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
