"""Compiled time integration of one ball against the modes of a bat, scene by scene.

Coordinates: a force F on the bat drives each flexible mode i by ``p'' = F - w_i^2 p``, where p is
the modal displacement divided by the mode shape at the impact position. All rigid motion of ball
and bat follows ``s'' = -F c`` with ``c = 1/m + sum of squared rigid shapes``, so momentum is
conserved to rounding. The approach of ball and bat is ``x = s - sum(g_i p_i)`` with the squared
shapes ``g_i``. The stiffer modes deflect by ``C F`` (residual flexibility) and the ball by ``u``.
They are two springs in series: ``x = u + C F(u)``.

Integration: a splitting Runge-Kutta-Nystrom scheme of order six with eleven stages. The force law
has a corner at the largest compression and where a reloaded ball passes its previous largest
compression. Steps end on these events to rounding, which preserves the order. ``u^a`` is not
smooth at touch, so the steps start short and double.

Ball: the force is ``F = k u^a`` while loading. After the turning point it is ``F = F_max (u /
u_max)^b``, for unloading and reloading, until u exceeds u_max (loading continues) or reaches 0
(release). After release the modes vibrate freely. If the surface reaches the ball again, a new
contact begins.
"""

from __future__ import annotations

from enum import IntEnum
from math import inf, isnan, nan
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.collision.scene import Failure
from virtual_lab.simulation.collision.splitting import SRKN_11
from virtual_lab.units import INNER, Array

Counts = NDArray[np.int64]
State = tuple[Array, Array, Array]  # views p, v, [s, s'] into one array
Bat = tuple[float, Array, Array]  # inverse mass c, squared shapes g, squared angular frequencies
Law = tuple[float, float, float, float]  # coefficient, scale of u, power, compliance C

KICKS, DRIFTS = SRKN_11.kicks, SRKN_11.drifts
FAST = {"reassoc", "contract", "nsz"}


class StepEnd(IntEnum):
    """Event at the end of a step."""

    TURN = 0  # x' is zero
    FULL = 1  # x returns to its peak
    RELEASE = 2  # x is zero


class Limits(NamedTuple):
    """Limits of steps and iterations."""

    root_tries: int = 60
    first_step: float = 1 / 256  # first step after touch, which then doubles [step]
    # largest number of steps of a contact or a flight, more than a second for a usual bat. Without
    # this limit a scene with NaN would never end.
    most_steps: int = 200_000
    flight_step: float = 0.1  # smallest step of a flight; shorter touches are ignored [step]


LIMITS = Limits()


@njit(**INNER)
def _copy(source: Array, target: Array) -> None:
    """Copy `source` into `target`. An assignment to a slice takes seconds more to compile."""
    for i in range(source.size):
        target[i] = source[i]


@njit(**INNER, fastmath=FAST)
def _approach(s: float, g: Array, p: Array) -> float:
    total = s
    for i in range(p.size):
        total -= g[i] * p[i]
    return total


@njit(**INNER)
def _force(x: float, law: Law) -> tuple[float, float]:
    """Return the force [N] and the compression of the ball [m] at an approach x [m]."""
    coefficient, scale, power, compliance = law
    if x <= 0.0:
        return 0.0, x
    # Newton's method cannot overshoot from this side of a convex function.
    u = x
    for _ in range(LIMITS.root_tries):
        force = coefficient * (u / scale) ** power
        miss = u + compliance * force - x
        if miss <= 1e-14 * x:
            break
        u -= miss / (1.0 + compliance * power * force / u)
    return force, u


@njit(**INNER, fastmath=FAST)
def _step(h: float, bat: Bat, law: Law, state: State) -> None:
    """Advance the state in place by the time h [s]."""
    c, g, w2 = bat
    p, v, r = state
    for stage in range(KICKS.size):
        force, _ = _force(_approach(r[0], g, p), law)
        kick = KICKS[stage] * h
        r[1] -= kick * c * force
        for i in range(p.size):
            v[i] += kick * (force - w2[i] * p[i])
        if stage < DRIFTS.size:
            drift = DRIFTS[stage] * h
            r[0] += drift * r[1]
            for i in range(p.size):
                p[i] += drift * v[i]


@njit(**INNER)
def _miss(event: int, bat: Bat, law: Law, state: State, peak: float) -> tuple[float, float]:
    """Return the quantity that is zero at the event, and its time derivative."""
    c, g, w2 = bat
    p, v, r = state
    x, rate = _approach(r[0], g, p), _approach(r[1], g, v)
    if event == StepEnd.RELEASE:
        return x, rate
    if event == StepEnd.FULL:
        return x - peak, rate
    force, _ = _force(x, law)
    bend = -c * force
    for i in range(p.size):
        bend -= g[i] * (force - w2[i] * p[i])
    return rate, bend


@njit(**INNER, error_model="numpy")
def _step_to(
    event: int, h: float, bat: Bat, law: Law, state: State, peak: float, y: Array, old: Array
) -> float:
    """Repeat the last step from `old` so that it ends on the event. Return its length [s].

    The length is found by Newton's method within the bracket [0, h].
    """
    low, high = 0.0, h
    after, slope = _miss(event, bat, law, state, peak)
    past_event = after > 0.0
    t: float = h - after / slope
    for _ in range(LIMITS.root_tries):
        if not low < t < high:
            t = 0.5 * (low + high)
        _copy(old, y)
        _step(t, bat, law, state)
        after, slope = _miss(event, bat, law, state, peak)
        if (after > 0.0) == past_event:
            high = t
        else:
            low = t
        if abs(after) <= 1e-13 * h * abs(slope) or high - low <= 1e-13 * h:
            break
        t -= after / slope
    return t


@njit(**INNER)
def _contact(
    h: float, bat: Bat, ball: Law, state: State, y: Array, old: Array
) -> tuple[float, float, int]:
    """Integrate one contact to its release. Return duration [s], largest u [m] and reloads."""
    k, a, b, compliance = ball
    first, g = (k, 1.0, a, compliance), bat[1]
    loading, law = True, first
    p, v, r = state
    t, peak, u_max, turns = 0.0, 0.0, 0.0, 0
    rate = _approach(r[1], g, v)
    step = h * LIMITS.first_step
    for _ in range(LIMITS.most_steps):
        _copy(y, old)
        step = min(h, 2.0 * step)
        span = step
        _step(span, bat, law, state)
        before, rate = rate, _approach(r[1], g, v)
        turned = before * rate < 0.0
        if turned:  # after a turn, one step could hide a short excursion beyond the branch
            span = _step_to(StepEnd.TURN, span, bat, law, state, peak, y, old)
            rate = 0.0
        x = _approach(r[0], g, p)
        if loading and turned:
            peak = x
            force, u_max = _force(peak, law)
            loading, law = False, (force, u_max, b, compliance)
        elif not loading and x > peak:
            span = _step_to(StepEnd.FULL, span, bat, law, state, peak, y, old)
            rate = _approach(r[1], g, v)
            loading, law = True, first
        elif x <= 0.0:
            return t + _step_to(StepEnd.RELEASE, span, bat, law, state, peak, y, old), u_max, turns
        elif turned and before < 0.0:
            turns += 1
        t += span
    return nan, u_max, turns  # too many steps


@njit(**INNER, fastmath=FAST)
def _ring(t: float, bat: Bat, state: State, y: Array, old: Array) -> float:
    """Set the state to `old` after a time t [s] of free motion. Return the approach [m]."""
    g, w2 = bat[1], bat[2]
    p, v, r = state
    _copy(old, y)
    r[0] += t * r[1]
    for i in range(p.size):
        w = np.sqrt(w2[i])
        sine, cosine, displacement = np.sin(w * t), np.cos(w * t), p[i]
        p[i] = displacement * cosine + v[i] / w * sine
        v[i] = v[i] * cosine - w * displacement * sine
    x: float = _approach(r[0], g, p)
    return x


@njit(**INNER)
def _flight(h: float, limit: float, bat: Bat, state: State, y: Array, old: Array) -> float:
    """Integrate the flight from the release in `y` to the next touch. Return its duration [s].

    The result is inf if there is no touch, and NaN after too many steps. The speed of the surface
    is at most the sum of its modal speeds. A step equal to the gap, divided by this sum plus the
    speed of the ball, therefore cannot skip a contact; h is the smallest step. There is no touch
    once the ball is farther than the sum of the modal amplitudes, or after `limit` [s].
    """
    _, g, w2 = bat
    p, v, r = state
    _copy(y, old)
    start, drift, amplitude, surface = r[0], r[1], 0.0, 0.0
    for i in range(p.size):
        square = v[i] ** 2 + w2[i] * p[i] ** 2
        surface += g[i] * np.sqrt(square)
        amplitude += g[i] * np.sqrt(square / w2[i])
    closing = drift + surface
    high: float = 0.0
    gap: float = 0.0
    steps = 0
    while closing > 0.0 and high < limit and start + drift * high + amplitude >= 0.0:
        low: float = high
        high += max(h, gap / closing)
        gap = -_ring(high, bat, state, y, old)
        if gap < 0.0:
            for _ in range(LIMITS.root_tries):
                middle = 0.5 * (low + high)
                if _ring(middle, bat, state, y, old) > 0.0:
                    high = middle
                else:
                    low = middle
            _ring(high, bat, state, y, old)
            return high
        steps += 1
        if steps > LIMITS.most_steps:
            return nan
    _copy(old, y)
    return inf


@njit(**INNER, fastmath=FAST)
def _energy(bat: Bat, state: State, loss: float) -> float:
    """Return the total energy after release as the squared speed of a ball [m^2/s^2]."""
    c, g, w2 = bat
    p, v, r = state
    energy = 2.0 * loss
    for i in range(p.size):
        energy += g[i] * (v[i] ** 2 + w2[i] * p[i] ** 2)
    return float(r[1] ** 2 + c * energy)


@njit(**INNER)
def _follow(
    h: float, window: float, bat: Bat, ball: Law, y: Array, old: Array, counts: Counts
) -> tuple[float, float]:
    """Integrate one collision with all its contacts. Return its duration [s] and loss [J].

    The duration is the time from first touch to last release.
    """
    n = bat[1].size
    state = (y[:n], y[n : 2 * n], y[2 * n :])
    k, a, b, _ = ball
    t, wait, loss = 0.0, 0.0, 0.0
    while t + wait < window:
        t += wait
        time, u_max, turns = _contact(h, bat, ball, state, y, old)
        if isnan(time):
            counts[2] = Failure.ENDLESS
            break
        t += time
        loss += k * u_max ** (a + 1.0) * (1.0 / (a + 1.0) - 1.0 / (b + 1.0))
        counts[0] += 1
        counts[1] += turns
        wait = _flight(LIMITS.flight_step * h, window - t, bat, state, y, old)
        if isnan(wait):
            counts[2] = Failure.ENDLESS
    if 0.0 < wait < inf:
        _copy(old, y)  # state at release, because this touch is too late
    return t, loss


@njit(cache=True, nogil=True)
def collide(
    w2: Array, which: Counts, g: Array, c: Array, ball: Array, steps: Array, window: float
) -> tuple[Array, Array, Counts]:
    """Integrate n collisions of bats with N flexible modes one after another.

    Three arrays are returned:

    * states at the last release [SI], (n, 2 N + 2): displacements p and velocities p' of all modes,
      then displacement s and velocity s' of the rigid motion;
    * sums, (n, 3): time from first touch to last release [s], energy lost in the ball [J], and
      error of the energy balance as a share of the initial energy;
    * counts, (n, 3): number of contacts; number of reloads (times at which the compression of the
      ball grows again before the release); and a `Failure`.

    A scene has failed if its `Failure` is not 0. Its states and sums are then not valid.

    Parameters
    ----------
    w2
        Squared angular frequencies, (bats, N) [1/s²].
    which
        Index of the bat of each scene, (n,).
    g
        Squared mode shapes at the impact positions, (n, N) [1/kg].
    c
        Sum of two inverse masses, (n,) [1/kg]: of the ball, and of the rigid bat at the impact
        position.
    ball
        Columns (n, 5): stiffness k [N/m^a], loading exponent a, unloading exponent b, compliance of
        the stiff modes [m/N], and relative speed [m/s].
    steps
        Time steps, (n,) [s].
    window
        Time after the first touch within which further contacts are simulated [s].
    """
    scenes, modes = g.shape
    states = np.zeros((scenes, 2 * modes + 2))
    sums = np.empty((scenes, 3))
    counts = np.zeros((scenes, 3), dtype=np.int64)
    old = np.empty(2 * modes + 2)
    for i in range(scenes):
        k, a, b, compliance, speed = ball[i]
        states[i, -1] = speed
        bat, law, y = (c[i], g[i], w2[which[i]]), (k, a, b, compliance), states[i]
        sums[i, 0], sums[i, 1] = _follow(steps[i], window, bat, law, y, old, counts[i])
        state = (y[:modes], y[modes : 2 * modes], y[2 * modes :])
        sums[i, 2] = 1.0 - _energy(bat, state, sums[i, 1]) / speed**2
    return states, sums, counts
