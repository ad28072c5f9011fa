"""Time stepping of one ball against the modes of a bat, scene by scene, compiled.

Coordinates. A force F on the bat drives every flexible mode i as ``p'' = F - w_i^2 p``
(modal displacement over the shape at the impact) and all rigid motion of ball and bat as
``s'' = -F c`` with ``c = 1/m + sum of squared rigid shapes``, so momentum holds to
rounding. Ball and bat approach by ``x = s - sum(g_i p_i)``, ``g_i`` the squared shapes. Of
that the bat's stiffer modes take ``C F`` at once (residual flexibility) and the ball takes
``u``: two springs in series, ``x = u + C F(u)``.

Stepping. Order six splitting Runge-Kutta-Nystrom scheme of eleven stages. The force law has
a corner where the approach turns and where a re-loading ball passes its greatest
compression; steps end on these events to rounding, so the order survives them. At touch
``u^a`` is not smooth: steps start short and double.

Ball. Loading ``F = k u^a``; from the turning point ``F = F_max (u / u_max)^b`` both ways
until u passes u_max again (then loading goes on) or reaches 0 (release). After release the
modes ring freely; if the surface can still catch the ball, a fresh contact begins.
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
from virtual_lab.units import Array

Counts = NDArray[np.int64]
State = tuple[Array, Array, Array]  # views p, v, [s, s'] into one array
Bat = tuple[float, Array, Array]  # c, g, squared angular frequencies
Law = tuple[float, float, float, float]  # coefficient, scale of u, power, C

KICKS, DRIFTS = SRKN_11.kicks, SRKN_11.drifts
FAST = {"reassoc", "contract", "nsz"}


class StepEnd(IntEnum):
    """What a step ends on."""

    TURN = 0  # x' = 0
    FULL = 1  # x back at its peak
    RELEASE = 2  # x = 0


class Limits(NamedTuple):
    """Of steps and of tries."""

    root_tries: int = 60
    first_step: float = 1 / 256  # of a step, for u^a is not smooth at touch; it doubles
    # of a contact or a flight, which is then given up: over a second with a usual bat, and what
    # is of numbers that are none would never end
    most_steps: int = 200_000
    flight_step: float = 0.1  # the least one, in steps: a touch shorter than it is no touch


LIMITS = Limits()


@njit(cache=True, fastmath=FAST)
def _approach(s: float, g: Array, p: Array) -> float:
    total = s
    for i in range(p.size):
        total -= g[i] * p[i]
    return total


@njit(cache=True)
def _force(x: float, law: Law) -> tuple[float, float]:
    """Return the force and the compression of the ball at an approach x."""
    coefficient, scale, power, compliance = law
    if x <= 0.0:
        return 0.0, x
    # Newton's method from the far side of a convex function: it cannot overshoot
    u = x
    for _ in range(LIMITS.root_tries):
        force = coefficient * (u / scale) ** power
        miss = u + compliance * force - x
        if miss <= 1e-14 * x:
            break
        u -= miss / (1.0 + compliance * power * force / u)
    return force, u


@njit(cache=True, fastmath=FAST)
def _step(h: float, bat: Bat, law: Law, state: State) -> None:
    """Advance the state in place by h."""
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


@njit(cache=True)
def _miss(event: int, bat: Bat, law: Law, state: State, peak: float) -> tuple[float, float]:
    """Return how far the state is from an event, and the time derivative of that."""
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


@njit(cache=True, error_model="numpy")
def _step_to(
    event: int, h: float, bat: Bat, law: Law, state: State, peak: float, y: Array, old: Array
) -> float:
    """Redo the last step, from `old`, so that it ends on the event; return its length.

    Newton's method kept inside the bracket [0, h].
    """
    low, high = 0.0, h
    after, slope = _miss(event, bat, law, state, peak)
    past_event = after > 0.0
    t = h - after / slope
    for _ in range(LIMITS.root_tries):
        if not low < t < high:
            t = 0.5 * (low + high)
        y[:] = old
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


@njit(cache=True)
def _contact(
    h: float, bat: Bat, ball: Law, state: State, y: Array, old: Array
) -> tuple[float, float, int]:
    """Follow one contact from touch to release; return (duration, peak u, turns back)."""
    k, a, b, compliance = ball
    first, g = (k, 1.0, a, compliance), bat[1]
    loading, law = True, first
    p, v, r = state
    t, peak, u_max, turns = 0.0, 0.0, 0.0, 0
    rate = _approach(r[1], g, v)
    step = h * LIMITS.first_step
    for _ in range(LIMITS.most_steps):
        old[:] = y
        step = min(h, 2.0 * step)
        span = step
        _step(span, bat, law, state)
        before, rate = rate, _approach(r[1], g, v)
        turned = before * rate < 0.0
        if turned:  # or a step could hide that x was out of its branch for a moment
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
    return nan, u_max, turns  # it took too many steps


@njit(cache=True, fastmath=FAST)
def _ring(t: float, bat: Bat, state: State, y: Array, old: Array) -> float:
    """Set the state to `old` after a time t without force; return the approach."""
    g, w2 = bat[1], bat[2]
    p, v, r = state
    y[:] = old
    r[0] += t * r[1]
    for i in range(p.size):
        w = np.sqrt(w2[i])
        sine, cosine, displacement = np.sin(w * t), np.cos(w * t), p[i]
        p[i] = displacement * cosine + v[i] / w * sine
        v[i] = v[i] * cosine - w * displacement * sine
    return _approach(r[0], g, p)


@njit(cache=True)
def _flight(h: float, limit: float, bat: Bat, state: State, y: Array, old: Array) -> float:
    """Fly from the release in `y` to the next touch; return its time.

    It is inf where there is none, nan where it took too many steps. The surface is nowhere faster
    than the sum of its modal amplitudes, so a step of gap over (that + the closing speed of the
    ball) cannot jump over a contact; h is the least step. Nor is it ever farther out: once the
    ball is beyond that, or `limit` is over, no touch follows.
    """
    _, g, w2 = bat
    p, v, r = state
    old[:] = y
    start, drift, reach, surface = r[0], r[1], 0.0, 0.0
    for i in range(p.size):
        square = v[i] ** 2 + w2[i] * p[i] ** 2
        surface += g[i] * np.sqrt(square)
        reach += g[i] * np.sqrt(square / w2[i])
    closing = drift + surface
    high: float = 0.0
    gap: float = 0.0
    steps = 0
    while closing > 0.0 and high < limit and start + drift * high + reach >= 0.0:
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
    y[:] = old
    return inf


@njit(cache=True, fastmath=FAST)
def _energy(bat: Bat, state: State, loss: float) -> float:
    """Return the square of the speed at which a ball brings as much as there is after release."""
    c, g, w2 = bat
    p, v, r = state
    energy = 2.0 * loss
    for i in range(p.size):
        energy += g[i] * (v[i] ** 2 + w2[i] * p[i] ** 2)
    return float(r[1] ** 2 + c * energy)


@njit(cache=True, nogil=True)
def _follow(
    h: float, window: float, bat: Bat, ball: Law, y: Array, old: Array, counts: Counts
) -> tuple[float, float]:
    """Run one collision, every contact of it; return (first touch to last release, loss)."""
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
        y[:] = old  # as released: this touch comes too late to count
    return t, loss


@njit(cache=True, nogil=True)
def collide(
    w2: Array, which: Counts, g: Array, c: Array, ball: Array, steps: Array, window: float
) -> tuple[Array, Array, Counts]:
    """Run n collisions with N flexible modes; arguments and results as of `collide_lanes`.

    `steps` are the time steps (n,) [s]; `ball` holds k [N/m^a], a, b, C [m/N] and the speed [m/s],
    (n, 5). Of the counts there are the first three, the last a `Failure`.
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
