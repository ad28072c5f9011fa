"""Compiled time integration of one ball against the modes of a bat, scene by scene.

Coordinates: a force F on the bat drives each flexible mode i by ``p'' = F - w_i^2 p``, where p is
the modal displacement divided by the mode shape at the impact position. All rigid motion of ball
and bat follows ``s'' = -F c`` with ``c = 1/m + sum of squared rigid shapes``, so momentum is
conserved to rounding. The approach of ball and bat is ``x = s - sum(g_i p_i)`` with the squared
shapes ``g_i``. The stiffer modes deflect by ``C F`` (residual flexibility) and the ball by ``u``.
They are two springs in series: ``x = u + C F(u)``.

Integration: a splitting Runge-Kutta-Nystrom scheme of order six with eleven stages (S. Blanes and
P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, SRKN_11^b). A step is kick, drift, kick, ...,
kick: each kick adds its share of the step times p'' to p', and each drift adds its share of the
step times p' to p. The force law has a corner at the largest compression and where a reloaded ball
passes its previous largest compression. Steps end on these events, which preserves the order.
``u^a`` is not smooth at touch, so the steps start short and grow.

Ball: the force is ``F = k u^a`` while loading. After the turning point it is ``F = F_max (u /
u_max)^b``, for unloading and reloading, until u exceeds u_max (loading continues) or reaches 0
(release). After release the modes vibrate freely. If the surface reaches the ball again, a new
contact begins.
"""

from __future__ import annotations

from enum import IntEnum
from math import inf, isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.collision.scene import Failure
from virtual_lab.units import INNER, KERNEL, Array

Counts = NDArray[np.int64]
Law = tuple[float, float, float, float]  # coefficient, 1 / scale of u, power, compliance C

# Options of the compiled functions, the second of those with sums over modes. All are inlined into
# `collide`: of a function that is called, a process may use a version that was optimized elsewhere,
# with other last bits.
PLAIN: dict[str, Any] = {"error_model": "numpy", "forceinline": True, **INNER}
FAST: dict[str, Any] = {"fastmath": {"reassoc", "contract", "nsz"}, **PLAIN}
# The modes of a bat are in blocks, (block, row, BLOCK), so that each loop over a block is a few
# vector instructions. The last block is filled with zeros. P to W2 are its rows.
BLOCK, P, V, G, W2 = 32, 0, 1, 2, 3


def _symmetric(half: tuple[float, ...], middle: int) -> Array:
    """Return symmetric shares from their first half. `middle` equal shares complete their sum."""
    return np.array([*half, *[(1 - 2 * sum(half)) / middle] * middle, *reversed(half)])


KICKS = _symmetric(
    (
        0.0414649985182624,
        0.198128671918067,
        -0.0400061921041533,
        0.0752539843015807,
        -0.0115113874206879,
    ),
    2,
)
DRIFTS = _symmetric(
    (
        0.123229775946271,
        0.290553797799558,
        -0.127049212625417,
        -0.246331761062075,
        0.357208772895928,
    ),
    1,
)


class StepEnd(IntEnum):
    """Event at the end of a step."""

    NONE = 0
    TURN = 1  # x' is zero
    FULL = 2  # x returns to its peak
    RELEASE = 3  # x is zero


class Limits(NamedTuple):
    """Limits of steps and iterations; the README of this folder states their origin."""

    root_tries: int = 60
    # largest change of u in the last iteration for the force [u / power]
    force: float = 0.02
    event: float = 1e-7  # tolerance of the time of an event [step]
    first_step: float = 1 / 64  # first step after a touch [step]
    growth: float = 4.0  # ratio of each of the first steps to the one before
    # largest number of steps of a contact, more than a second for a usual bat. Without this limit a
    # scene with NaN would never end.
    most_steps: int = 200_000
    near_turn: float = 0.03  # speed below which a step may hide two turns [initial speed]
    near_touch: float = 0.03  # gap below which a step may hide a touch [largest approach]


LIMITS = Limits()


class BallMotion(NamedTuple):
    """State of ball and rigid bat, and the force between them. The modes are in an array."""

    s: float
    s_rate: float
    x: float
    rate: float  # x'
    bend: float  # x''
    force: float
    u: float
    gain: float  # du / dx


@njit(**PLAIN)
def _copy(source: Array, target: Array) -> None:
    """Copy `source` into `target`. An assignment to a slice takes seconds more to compile."""
    for b in range(len(source)):
        for i in range(BLOCK):
            target[b, P, i], target[b, V, i] = source[b, P, i], source[b, V, i]


@njit(fastmath={"contract"}, **PLAIN)
def _force(x: float, u: float, law: Law) -> tuple[float, float, float]:
    """Return force, u and du/dx at an approach x, by Halley's method from an estimate of u.

    The estimate is the tangent at the previous stage, so one iteration is usually enough.
    """
    if x <= 0.0:
        return 0.0, x, 1.0
    coefficient, inverse_scale, power, compliance = law
    force, slope = 0.0, 1.0
    for _ in range(LIMITS.root_tries):
        inverse = 1.0 / u
        growth, bend = power * inverse, 0.5 * (power - 1.0) * inverse
        yielding, third = compliance * growth, (power - 2.0) / 3.0 * inverse
        force = coefficient * (u * inverse_scale) ** power
        miss, slope = x - u - compliance * force, 1.0 + yielding * force
        change = miss * slope / (slope**2 + miss * bend * (yielding * force))
        if abs(change) * power <= LIMITS.force * u:
            force += growth * force * change * (1.0 + bend * change * (1.0 + third * change))
            return force, u + change, 1.0 / slope
        u += max(change, -0.5 * u)
    return force, u, 1.0 / slope


@njit(**FAST)
def _step(h: float, c: float, law: Law, modes: Array, start: BallMotion) -> BallMotion:
    """Advance the modes in place by the time h [s]. Return the motion at the end."""
    s, s_rate, x = start.s, start.s_rate, start.x
    force, u, gain = start.force, start.u, start.gain
    for stage in range(DRIFTS.size):
        kick, drift = KICKS[stage] * h, DRIFTS[stage] * h
        s_rate -= kick * c * force
        s += drift * s_rate
        u -= gain * x
        x = s
        for b in range(len(modes)):
            for i in range(BLOCK):
                p, v = modes[b, P, i], modes[b, V, i]
                v += kick * (force - modes[b, W2, i] * p)
                p += drift * v
                modes[b, P, i], modes[b, V, i] = p, v
                x -= modes[b, G, i] * p
        force, u, gain = _force(x, u + gain * x, law)
    kick = KICKS[DRIFTS.size] * h
    s_rate -= kick * c * force
    rate, bend = s_rate, -c * force
    for b in range(len(modes)):
        for i in range(BLOCK):
            driving = force - modes[b, W2, i] * modes[b, P, i]
            modes[b, V, i] += kick * driving
            rate -= modes[b, G, i] * modes[b, V, i]
            bend -= modes[b, G, i] * driving
    return BallMotion(s, s_rate, x, rate, bend, force, u, gain)


@njit(**PLAIN)
def _miss(event: int, at: BallMotion, peak: float) -> tuple[float, float]:
    """Return the quantity that is zero at the event, and its time derivative."""
    if event == StepEnd.TURN:
        return at.rate, at.bend
    return (at.x - peak if event == StepEnd.FULL else at.x), at.rate


@njit(**PLAIN)
def _step_to(
    event: int, h: float, c: float, law: Law, peak: float, modes: Array, old: Array,
    start: BallMotion, end: BallMotion,
) -> tuple[float, BallMotion]:  # fmt: skip
    """Repeat the last step from `old` so that it ends on the event. Return its length [s].

    The length is found by Newton's method within the bracket [0, h].
    """
    low, high, t = 0.0, h, h
    past: bool = _miss(event, end, peak)[0] > 0.0
    for _ in range(LIMITS.root_tries):
        miss, slope = _miss(event, end, peak)
        if (miss > 0.0) == past:
            high = t
        else:
            low = t
        change = miss / slope
        if abs(change) <= LIMITS.event * h or high - low <= LIMITS.event * h:
            break
        t -= change
        if not low < t < high:
            t = 0.5 * (low + high)
        _copy(old, modes)
        end = _step(t, c, law, modes, start)
    return t, end


@njit(**PLAIN)
def _passed_event(x: float, loading: bool, peak: float) -> int:
    """Return the event that an approach x has passed, if any."""
    if loading:
        return StepEnd.NONE
    return StepEnd.FULL if x > peak else StepEnd.RELEASE if x <= 0.0 else StepEnd.NONE


@njit(**PLAIN)
def _contact(
    h: float, c: float, ball: Law, modes: Array, old: Array, motion: BallMotion, counts: Counts
) -> tuple[float, float, float, BallMotion]:
    """Integrate one contact to its release. Return duration [s], largest u and x [m], motion."""
    k, a, b, compliance = ball
    first = (k, 1.0, a, compliance)
    loading, law = True, first
    t, peak, u_max = 0.0, 0.0, 0.0
    slow = LIMITS.near_turn * motion.rate
    step = h * LIMITS.first_step
    for _ in range(LIMITS.most_steps):
        _copy(modes, old)
        before, span = motion, step
        motion = _step(span, c, law, modes, before)
        counts[4] += 1
        if isnan(motion.x):
            break
        turned = before.rate * motion.rate < 0.0
        event = StepEnd.TURN if turned else _passed_event(motion.x, loading, peak)
        if loading and not turned and before.bend < 0.0 < motion.bend:
            jerk = (motion.bend - before.bend) / span
            counts[3] |= np.int64(motion.rate - 0.5 * motion.bend**2 / jerk < slow)
        while event != StepEnd.NONE:
            span, at = _step_to(event, span, c, law, peak, modes, old, before, motion)
            rate = 0.0 if event == StepEnd.TURN else at.rate
            motion = BallMotion(at.s, at.s_rate, at.x, rate, at.bend, at.force, at.u, at.gain)
            if event != StepEnd.TURN:
                break
            # after the turn, one step could hide a short excursion beyond the branch
            event = _passed_event(motion.x, loading, peak)
        t += span
        step = min(h, LIMITS.growth * step)
        if event == StepEnd.RELEASE:
            counts[0] += 1
            return t, u_max, peak, motion
        if event == StepEnd.FULL:
            loading, law = True, first
        elif loading and turned:
            peak, u_max = motion.x, motion.u
            loading, law = False, (motion.force, 1.0 / u_max, b, compliance)
        elif turned and before.rate < 0.0:
            counts[1] += 1
    counts[2] = Failure.ENDLESS
    return nan, u_max, peak, motion


@njit(**FAST)
def _ring(t: float, modes: Array, motion: BallMotion) -> BallMotion:
    """Advance the modes in place by a time t [s] of free vibration. Return the motion."""
    s = motion.s + t * motion.s_rate
    x, rate, bend = s, motion.s_rate, 0.0
    for b in range(len(modes)):
        for i in range(BLOCK):
            g, w2, p, v = modes[b, G, i], modes[b, W2, i], modes[b, P, i], modes[b, V, i]
            w = np.sqrt(w2)
            sine, cosine = np.sin(w * t), np.cos(w * t)
            modes[b, P, i] = p * cosine + v * (sine / w if w > 0.0 else t)
            modes[b, V, i] = v * cosine - w * p * sine
            x -= g * modes[b, P, i]
            rate -= g * modes[b, V, i]
            bend += g * w2 * modes[b, P, i]
    return BallMotion(s, motion.s_rate, x, rate, bend, 0.0, 0.0, 1.0)


@njit(**FAST)
def _rotate(s: float, s_rate: float, modes: Array, rotation: Array) -> tuple[float, float]:
    """Advance the modes in place by the step of `rotation`. Return x and x' at the end."""
    x, rate = s, s_rate
    for b in range(len(modes)):
        for i in range(BLOCK):
            p, v = modes[b, P, i], modes[b, V, i]
            modes[b, P, i] = p * rotation[b, 0, i] + v * rotation[b, 1, i]
            modes[b, V, i] = v * rotation[b, 0, i] + p * rotation[b, 2, i]
            x -= modes[b, G, i] * modes[b, P, i]
            rate -= modes[b, G, i] * modes[b, V, i]
    return x, rate


@njit(**PLAIN)
def _flight(
    h: float, limit: float, peak: float, modes: Array, old: Array, rotation: Array,
    start: BallMotion, counts: Counts,
) -> tuple[float, BallMotion]:  # fmt: skip
    """Integrate the flight from a release to the next touch. Return its duration [s] and motion.

    The result is inf, with modes and motion at the release, if there is no touch within `limit`
    [s]. Ball and bat cannot meet while the ball moves away faster than the sum of the modal speeds,
    nor once it is farther away than the sum of the modal amplitudes.
    """
    amplitude, closing = 0.0, start.s_rate
    for b in range(len(modes)):
        for i in range(BLOCK):
            g, w2 = modes[b, G, i], modes[b, W2, i]
            if g > 0.0:
                square = modes[b, V, i] ** 2 + w2 * modes[b, P, i] ** 2
                closing += g * np.sqrt(square)
                amplitude += g * np.sqrt(square / w2)
    if closing <= 0.0:
        return inf, start
    for b in range(len(modes)):
        for i in range(BLOCK):
            w = np.sqrt(modes[b, W2, i])
            sine = np.sin(w * h)
            rotation[b, 0, i], rotation[b, 2, i] = np.cos(w * h), -w * sine
            rotation[b, 1, i] = sine / w if w > 0.0 else h
    _copy(modes, old)
    t, rate = 0.0, 0.0
    while t < limit and start.s + t * start.s_rate + amplitude >= 0.0:
        before = rate
        t += h
        x, rate = _rotate(start.s + t * start.s_rate, start.s_rate, modes, rotation)
        if x > 0.0:
            ago, motion = _touch(h, t, modes, start)
            if t - ago < limit:
                return t - ago, motion
            break
        if before > 0.0 > rate:
            closest = x + 0.5 * h * rate**2 / (before - rate)
            counts[3] |= np.int64(closest > -LIMITS.near_touch * peak)
    _copy(old, modes)
    return inf, start


@njit(**PLAIN)
def _touch(h: float, after: float, modes: Array, start: BallMotion) -> tuple[float, BallMotion]:
    """Go back to the touch within the last step h [s] of a flight.

    Return how long ago it was [s], and the motion there. `after` is the time since `start` [s].
    """
    low, high, t, change = 0.0, h, h, 0.0
    s = start.s + after * start.s_rate
    at = BallMotion(s, start.s_rate, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    for _ in range(LIMITS.root_tries):
        at = _ring(-change, modes, at)
        low, high = (low, t) if at.x > 0.0 else (t, high)
        change = at.x / at.rate
        if abs(change) <= LIMITS.event * h or high - low <= LIMITS.event * h:
            break
        change = change if low < t - change < high else t - 0.5 * (low + high)
        t -= change
    return h - t, at


@njit(**KERNEL, nogil=True, error_model="numpy")
def collide(
    w2: Array, which: Counts, g: Array, c: Array, ball: Array, steps: Array, window: float
) -> tuple[Array, Array, Counts]:
    """Integrate n collisions of bats with N flexible modes one after another.

    Three arrays are returned:

    * states at the last release [SI], (n, 2 N + 2): displacements p and velocities p' of all modes,
      then displacement s and velocity s' of the rigid motion;
    * sums, (n, 3): time from first touch to last release [s], energy lost in the ball [J], and
      error of the energy balance as a share of the initial energy;
    * counts, (n, 5): number of contacts; number of reloads (times at which the compression of the
      ball grows again before the release); a `Failure`; 1 if a step may have hidden an event,
      otherwise 0; and number of steps.

    A scene has failed if its `Failure` is not 0. Its states and sums are then not valid. The result
    of a scene does not depend on the other scenes.

    Parameters
    ----------
    w2
        Squared angular frequencies, (bats, N) [1/s²]. A bat with fewer modes has zeros at the end.
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
        Time steps of contacts and of flights, (n, 2) [s].
    window
        Time after the first touch within which further contacts are simulated [s].
    """
    scenes, modes = g.shape
    states = np.zeros((scenes, 2 * modes + 2))
    sums = np.empty((scenes, 3))
    counts = np.zeros((scenes, 5), dtype=np.int64)
    for i in range(scenes):
        squares = w2[which[i]]
        used = 0
        while used < squares.size and squares[used] > 0.0:
            used += 1
        blocks = -(-used // BLOCK)
        vibration = np.zeros((blocks, 4, BLOCK))
        old, rotation = np.empty((blocks, 2, BLOCK)), np.empty((blocks, 3, BLOCK))
        for m in range(used):
            vibration[m // BLOCK, G, m % BLOCK] = g[i, m]
            vibration[m // BLOCK, W2, m % BLOCK] = squares[m]
        k, a, b, compliance, speed = ball[i]
        motion = BallMotion(0.0, speed, 0.0, speed, 0.0, 0.0, 0.0, 1.0)
        t, wait, loss = 0.0, 0.0, 0.0
        while wait < inf and counts[i, 2] == Failure.SOUND:
            t += wait
            time, u_max, peak, motion = _contact(
                steps[i, 0], c[i], (k, a, b, compliance), vibration, old, motion, counts[i]
            )
            t += time
            loss += k * u_max ** (a + 1.0) * (1.0 / (a + 1.0) - 1.0 / (b + 1.0))
            wait, motion = _flight(
                steps[i, 1], window - t, peak, vibration, old, rotation, motion, counts[i]
            )
        energy = 2.0 * loss
        for m in range(used):
            p, v = vibration[m // BLOCK, P, m % BLOCK], vibration[m // BLOCK, V, m % BLOCK]
            states[i, m], states[i, modes + m] = p, v
            energy += g[i, m] * (v**2 + squares[m] * p**2)
        states[i, 2 * modes], states[i, 2 * modes + 1] = motion.s, motion.s_rate
        sums[i, 0], sums[i, 1] = t, loss
        sums[i, 2] = 1.0 - (motion.s_rate**2 + c[i] * energy) / speed**2
    return states, sums, counts
