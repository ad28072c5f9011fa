"""Many collisions at once: each scene has one lane, and all lanes are stepped together.

Each loop runs over the lanes, so the compiler can process eight scenes per instruction.
Coordinates, force law and integration scheme are described in `modal_kernel`. The step size depends
on the current stiffness. A step is shortened so that it ends on the next event of the lane. While
loading, this event is the largest compression. While unloading it is the release or, if the
compression grows again, the previous largest compression. In flight it is the touch. If a step
overshoots the event, the next step goes backward, which is possible because each force law is
smooth beyond its end.

A finished lane takes the next scene, so no lane waits for the slowest one, and no result depends on
the other scenes. A scene is marked as doubtful if one step may have hidden an event (a short loss
of contact, a brief touch in flight) or if it took too many steps.

The compiled kernel is cached until this file changes. Save this file after a change in `powers` or
`lane_rows`.
"""

from __future__ import annotations

from collections import namedtuple
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.collision import lane_rows as at
from virtual_lab.simulation.collision.powers import COMPILES, SIMD, exp2, log2, wide
from virtual_lab.units import INNER, KERNEL, Array

Counts = NDArray[np.int64]
Scheme = tuple[Array, Array]  # kicks, drifts
Out = tuple[Array, Array, Counts]
SCALAR: dict[str, Any] = {"forceinline": True, "error_model": "numpy", **INNER}


class Given(NamedTuple):
    """Input of the scenes, arrays (n,) in SI units."""

    exponent: Array  # loading exponent a
    unloading: Array  # unloading exponent b
    log_k: Array  # log2 of the stiffness
    series: Array  # compliance C of the stiff modes [m/N]
    speed: Array
    inverse_mass: Array  # c
    first: Array  # compression up to which the series at touch is used
    first_force: Array
    mode_step: Array  # longest step for the modes
    ball_step: Array  # longest step for the ball, times sqrt(k a u^(a-1))
    near_end: Array  # tolerance of a release [share of the largest compression]


class StepRule(NamedTuple):
    """Settings common to all scenes: three from `InStep`, and the time window for new contacts."""

    growth: float
    turn: float
    brush: float
    window: float


class After(IntEnum):
    """State of a scene after an event."""

    DONE = 0
    GOES_ON = 1
    DOUBT = 2


LANES, ROW = at.LANES, at.ROW
CHUNK = 5  # modes per pass: divides 15 and 20, the usual numbers of modes
ModeRows = namedtuple("ModeRows", "p v g w2 size")  # rows of one mode, relative to its first row


class Phases(NamedTuple):
    """Phase of the collision in a lane."""

    loading: float = 1.0
    unloading: float = 0.0
    flying: float = -1.0


class Events(NamedTuple):
    """Event at the end of the last step of a lane."""

    none: float = 0.0
    reached: float = 1.0
    turned_back: float = 2.0
    clear: float = 3.0
    lost: float = 4.0


class LaneLimits(NamedTuple):
    """Limits of the steps and of the numbers; the README of this folder states their origin."""

    most_steps: float = 1500.0
    sweep: float = 0.5  # largest motion of a reloading ball per step [largest compression / b]
    touch: float = 1e-7  # tolerance of touch and of reloading [share of the largest compression]
    hidden: float = 10.0  # speed below which one step may hide a turn [tolerance of a turn]
    least_u: float = 1e-12  # smallest compression, which keeps denormal numbers out [m]
    least_log: float = -200.0
    least_force: float = 1e-9
    no_force: float = -5000.0  # log2 of the stiffness of a ball in flight
    afresh: float = 1 / 256  # first step of a later contact [share of the step of the modes]
    # largest remaining motion at a turn [share of the approach, in squared tolerances]
    flat: float = 3.0
    fall: float = 0.3  # first step of unloading [share of the time to release from rest]


MODE = ModeRows(*range(0, 5 * ROW, ROW))
PHASE, EVENT, LIMITS = Phases(), Events(), LaneLimits()


@njit(**SIMD)
def _forces(w: Array) -> None:
    """Set the force in each lane from the approach."""
    wide()
    for j in range(LANES):
        x = w[at.x + j]
        u = max(x, LIMITS.least_u)
        y = w[at.log_k + j] + w[at.power + j] * log2(u)
        w[at.force + j] = exp2(max(y, LIMITS.least_log)) if x > 0.0 else 0.0
        w[at.u + j] = u


@njit(**SIMD)
def _forces_in_series(w: Array) -> None:
    """Improve the forces of the ball and the stiff modes in series: x = u + C F(u).

    This is one step of Newton's method. It starts from the previous ratio u / x, which changes
    little from stage to stage.
    """
    wide()
    for j in range(LANES):
        x, power, series = w[at.x + j], w[at.power + j], w[at.compliance + j]
        approach = max(x, LIMITS.least_u)
        u = approach * w[at.u_share + j]
        force = exp2(max(w[at.log_k + j] + power * log2(u), LIMITS.least_log))
        slope = power * force / u
        change = max((approach - u - series * force) / (1.0 + series * slope), -0.5 * u)
        force += slope * change
        w[at.u + j] = u + change
        w[at.u_share + j] = (u + change) / approach
        w[at.force + j] = force if x > 0.0 else 0.0


@njit(**SIMD)
def _stage_chunk(w: Array, modes: Array, kick: float, drift: float) -> None:
    wide()
    for j in range(LANES):
        h = w[at.h + j]
        force = w[at.force + j]
        x = w[at.x + j]
        for m in range(CHUNK):
            row = m * MODE.size + j
            p, v, g = modes[row + MODE.p], modes[row + MODE.v], modes[row + MODE.g]
            v += kick * h * (force - modes[row + MODE.w2] * p)
            p += drift * h * v
            modes[row + MODE.p], modes[row + MODE.v] = p, v
            x -= g * p
        w[at.x + j] = x


@njit(**SIMD)
def _stage(w: Array, modes: int, kick: float, drift: float) -> None:
    """Apply one kick with the current force to all velocities, then one drift."""
    wide()
    for j in range(LANES):
        h = w[at.h + j]
        rate = w[at.s_rate + j] - kick * h * w[at.c + j] * w[at.force + j]
        s = w[at.s + j] + drift * h * rate
        w[at.s_rate + j] = rate
        w[at.s + j] = s
        w[at.x + j] = s
    for i in range(0, modes, CHUNK):
        _stage_chunk(w, w[at.head + i * MODE.size : at.head + (i + CHUNK) * MODE.size], kick, drift)


@njit(**SIMD)
def _look_chunk(w: Array, modes: Array) -> None:
    wide()
    for j in range(LANES):
        force = w[at.force + j]
        rate = w[at.rate + j]
        bend = w[at.bend + j]
        for m in range(CHUNK):
            g = modes[m * MODE.size + MODE.g + j]
            rate -= g * modes[m * MODE.size + MODE.v + j]
            bend -= g * (
                force - modes[m * MODE.size + MODE.w2 + j] * modes[m * MODE.size + MODE.p + j]
            )
        w[at.rate + j] = rate
        w[at.bend + j] = bend


@njit(**SIMD)
def _look(w: Array, modes: int) -> None:
    """Set the first and second derivative of the approach."""
    wide()
    for j in range(LANES):
        w[at.old_rate + j] = w[at.rate + j]
        w[at.old_bend + j] = w[at.bend + j]
        w[at.rate + j] = w[at.s_rate + j]
        w[at.bend + j] = -w[at.c + j] * w[at.force + j]
    for i in range(0, modes, CHUNK):
        _look_chunk(w, w[at.head + i * MODE.size : at.head + (i + CHUNK) * MODE.size])


@njit(**SIMD)
def _plan(w: Array, growth: float, window: float) -> None:
    """Set the event of each lane and the size of its next step."""
    wide()
    for j in range(LANES):
        h = w[at.h + j]
        w[at.time + j] += h
        w[at.steps + j] += 1.0
        x, rate, bend, peak = w[at.x + j], w[at.rate + j], w[at.bend + j], w[at.peak + j]
        loading, flying = w[at.phase + j] > 0.0, w[at.phase + j] < 0.0
        unloading = (not loading) & (not flying)
        jerk = (bend - w[at.old_bend + j]) / h
        w[at.jerk + j] = jerk
        # A decreasing quantity that is zero at the next event, and its derivatives.
        filling = unloading & (rate > 0.0) & ((w[at.turned + j] > 0.0) | (x > peak))
        upward = filling | flying
        sign = -1.0 if upward else 1.0
        miss = sign * (rate if loading else (x - peak if filling else x))
        first = sign * (bend if loading else rate)
        second = sign * (jerk if loading else bend)
        square = first * first - 2.0 * second * miss
        to = 2.0 * miss / (np.sqrt(max(square, 0.0)) - first)
        ahead = (square >= 0.0) & ((to > 0.0) | (miss < 0.0)) & (first < 0.0)
        # The stiffness of a ball that is, or soon will be, reloaded returns to its largest value.
        step = min(w[at.h_mode + j], growth * w[at.h_grown + j])
        rising = unloading & (rate + step * bend > 0.0)
        softness = w[at.u + j] / (w[at.power + j] * max(w[at.force + j], LIMITS.least_force))
        softness = w[at.softness + j] if rising else softness
        step = min(step, w[at.ball + j] * np.sqrt(softness))
        sweep = LIMITS.sweep * peak / (w[at.power + j] * max(rate, 1e-3))
        step = min(step, sweep) if rising else step
        w[at.h_grown + j] = step
        far = abs(to)
        landing = far if far < step else (0.5 * far if far < 2.0 * step else step)
        w[at.h + j] = (landing if to > 0.0 else -landing) if ahead else step
        reached = (abs(miss) <= (LIMITS.touch * peak if upward else w[at.near + j])) & (first < 0.0)
        again = (rate > 0.0) | (w[at.turned + j] > 0.0)
        turned = (
            (w[at.old_rate + j] * rate < 0.0) & (not loading) & (rate < 0.0 if flying else again)
        )
        gone = flying & ((w[at.s + j] + w[at.reach + j] < 0.0) | (w[at.time + j] > window))
        event = EVENT.turned_back if turned else EVENT.none
        event = EVENT.reached if reached else event
        event = EVENT.clear if gone else event
        # One step may have hidden a touch or two turns.
        missed = flying & (x > 0.0) & (rate < 0.0)
        slow = (rate - LIMITS.hidden * w[at.near + j]) * jerk < 0.5 * bend * bend
        dipped = loading & (bend > 0.0) & (w[at.old_bend + j] < 0.0) & slow
        w[at.event + j] = (
            EVENT.lost if missed | dipped | (w[at.steps + j] > LIMITS.most_steps) else event
        )


@njit(**SCALAR)
def _load(lane: Array, i: int, w2: Array, g: Array, given: Given, near: float) -> None:
    """Start scene i in a lane shortly after touch, where ``u^a`` is not smooth."""
    a, series, speed, c = given.exponent[i], given.series[i], given.speed[i], given.inverse_mass[i]
    u, force = given.first[i], given.first_force[i]
    x = u + series * force
    impulse = (u * force / (a + 1.0) + 0.5 * series * force**2) / speed
    drift = impulse * x / speed / (a + 2.0)
    total = c
    for m in range(w2.size):
        row = at.head + m * MODE.size
        lane[row + MODE.p], lane[row + MODE.v] = drift, impulse
        lane[row + MODE.g], lane[row + MODE.w2] = g[i, m], w2[m]
        total += g[i, m]
    time = (x + total * drift) / speed
    lane[at.s], lane[at.s_rate], lane[at.x] = speed * time - c * drift, speed - c * impulse, x
    lane[at.rate], lane[at.bend] = speed - total * impulse, -total * force
    lane[at.force], lane[at.u], lane[at.u_share] = force, u, u / x
    lane[at.log_k], lane[at.power], lane[at.c], lane[at.compliance] = given.log_k[i], a, c, series
    lane[at.time], lane[at.h_grown], lane[at.h_mode] = time, time, given.mode_step[i]
    lane[at.h], lane[at.ball] = min(time, given.mode_step[i]), given.ball_step[i]
    lane[at.phase], lane[at.near], lane[at.scene] = PHASE.loading, near * speed, float(i)
    lane[at.peak] = lane[at.turned] = lane[at.steps] = lane[at.loss] = lane[at.reach] = 0.0


@njit(**SCALAR)
def _switch(lane: Array, phase: float, power: float, log_k: float, near: float) -> None:
    """Change the force law of a lane. Both laws give the same force at this point."""
    lane[at.phase], lane[at.power], lane[at.log_k], lane[at.near] = phase, power, log_k, near
    lane[at.turned] = 0.0
    if phase == PHASE.unloading:
        softness = lane[at.u] / (power * lane[at.force])
        fall = np.sqrt(-2.0 * lane[at.x] / lane[at.bend])  # time to release from rest
        lane[at.softness] = softness
        lane[at.h_grown] = min(
            lane[at.h_grown], lane[at.ball] * np.sqrt(softness), LIMITS.fall * fall
        )
    lane[at.h] = lane[at.h_grown]


@njit(**SCALAR)
def _ring(p: float, v: float, w2: float, t: float) -> tuple[float, float]:
    """Return displacement and velocity of a mode after a time t of free vibration."""
    angle2 = w2 * t * t
    if angle2 < 0.1:  # a series is faster
        sine = t * (1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0 * (1.0 - angle2 / 42.0)))
        cosine = 1.0 - angle2 / 2.0 * (1.0 - angle2 / 12.0 * (1.0 - angle2 / 30.0))
    else:
        angle = np.sqrt(angle2)
        sine, cosine = t * np.sin(angle) / angle, np.cos(angle)
    return cosine * p + sine * v, cosine * v - sine * w2 * p


@njit(**SCALAR)
def _release(lane: Array, i: int, states: Array, sums: Array, speed: float) -> bool:
    """Store the state of a lane at release. Return whether ball and bat can meet again."""
    modes = (states.shape[1] - 2) // 2
    s_rate, c, loss = lane[at.s_rate], lane[at.c], lane[at.loss]
    t = -lane[at.x] / lane[at.rate]  # time to release, negative if the step passed it
    t -= 0.5 * lane[at.bend] / lane[at.rate] * t * t
    if abs(lane[at.bend] * t) > 0.5 * abs(lane[at.rate]):  # grazing release
        t = 0.0
    closing, energy, amplitude = s_rate, 0.0, 0.0
    for m in range(modes):
        row = at.head + m * MODE.size
        p, v, g, w2 = (
            lane[row + MODE.p],
            lane[row + MODE.v],
            lane[row + MODE.g],
            lane[row + MODE.w2],
        )
        states[i, m], states[i, modes + m] = _ring(p, v, w2, t)
        square = v * v + w2 * p * p
        closing += g * np.sqrt(square)
        energy += g * square
    if closing > 0.0:
        for m in range(modes):
            row = at.head + m * MODE.size
            p, v = lane[row + MODE.p], lane[row + MODE.v]
            amplitude += lane[row + MODE.g] * np.sqrt(v * v / lane[row + MODE.w2] + p * p)
    lane[at.reach] = amplitude
    states[i, 2 * modes], states[i, 2 * modes + 1] = lane[at.s] + s_rate * t, s_rate
    sums[i, 0], sums[i, 1] = lane[at.time] + t, loss
    sums[i, 2] = 1.0 - (s_rate**2 + c * (energy + 2.0 * loss)) / speed**2
    return bool(closing > 0.0)


@njit(**SCALAR)
def _extreme(lane: Array) -> float:
    """Return the extreme of the approach within the last step, from its last derivatives."""
    rate, bend, jerk = lane[at.rate], lane[at.bend], lane[at.jerk]
    root = np.sqrt(max(bend**2 - 2.0 * jerk * rate, 0.0))
    ago = 2.0 * rate / (bend + np.copysign(root, bend))
    return float(lane[at.x] - ago * (rate - ago * (0.5 * bend - ago * jerk / 6.0)))


@njit(**SCALAR)
def _pass_event(lane: Array, i: int, given: Given, rule: StepRule, out: Out) -> int:
    """Apply the event at the end of a step to scene i. Return the scene's state, an `After`."""
    (states, sums, counts), near, brush = out, rule.turn, rule.brush
    a, b, speed, log_k = given.exponent[i], given.unloading[i], given.speed[i], given.log_k[i]
    event, phase, rate = lane[at.event], lane[at.phase], lane[at.rate]
    loss_share = 1.0 / (a + 1.0) - 1.0 / (b + 1.0)  # energy lost in the ball [peak force times u]
    if event in (EVENT.clear, EVENT.lost):
        return After.DONE if event == EVENT.clear else After.DOUBT
    if event == EVENT.turned_back:
        peak, extreme = lane[at.peak], _extreme(lane)
        if phase == PHASE.flying:
            hidden = extreme > -brush * peak
        elif rate < 0.0:
            hidden = extreme > (1.0 - brush) * peak
        else:
            counts[i, 1] += 1
            lane[at.turned] = 1.0
            hidden = extreme < 0.1 * brush * peak
        return After.DOUBT if hidden else After.GOES_ON
    if phase == PHASE.loading:
        remaining = -0.5 * rate**2 / lane[at.bend]  # remaining distance to the turn
        if remaining > LIMITS.flat * near**2 * lane[at.x]:
            return After.DOUBT
        u = lane[at.u] + remaining
        lane[at.peak] = lane[at.x] + remaining
        lane[at.loss] += loss_share * u * lane[at.force] * (1.0 + a * remaining / lane[at.u])
        _switch(lane, PHASE.unloading, b, log_k - (b - a) * log2(u), lane[at.x] * given.near_end[i])
    elif phase == PHASE.flying:
        lane[at.u_share], lane[at.h_grown] = 1.0, LIMITS.afresh * lane[at.h_mode]
        _switch(lane, PHASE.loading, a, log_k, near * rate)
    elif rate > 0.0:
        lane[at.loss] -= loss_share * lane[at.u] * lane[at.force]
        _switch(lane, PHASE.loading, a, log_k, near * rate)
    else:
        counts[i, 0] += 1
        if not _release(lane, i, states, sums, speed):
            return After.DONE
        if lane[at.bend] > 0.0 and rate**2 < 2.0 * brush * lane[at.peak] * lane[at.bend]:
            return After.DOUBT
        lane[at.force] = 0.0
        _switch(lane, PHASE.flying, 1.0, LIMITS.no_force, 0.0)
    return After.GOES_ON


def prepare_lanes(modes: int) -> Array:
    """Return the working memory of `collide_lanes` for bats with `modes` flexible modes.

    The result is a 1-D array of floats. The kernel integrates `LANES` collisions at once, and a
    lane is the memory of one of them. All lanes are empty at first.
    """
    size = at.head + -(-modes // CHUNK) * CHUNK * MODE.size
    memory = np.zeros(size + 8)
    w = memory[(-memory.ctypes.data // 8) % 8 :][:size]  # starts at a cache line
    w[at.scene : at.scene + LANES] = -1.0
    w[at.event : at.event + LANES] = EVENT.clear
    return w


def prepare_results(scenes: int, modes: int) -> Out:
    """Return the result arrays of `collide_lanes` for n `scenes` and N flexible `modes`, all zero.

    Their shapes are (n, 2 N + 2), (n, 3) and (n, 4). `collide_lanes` explains the columns.
    """
    counts = np.zeros((scenes, 4), np.int64)
    return np.zeros((scenes, 2 * modes + 2)), np.zeros((scenes, 3)), counts


@njit(**KERNEL, nogil=True)
def collide_lanes(
    w: Array,
    w2: Array,
    bat: Counts,
    g: Array,
    given: Given,
    stiff: bool,
    scheme: Scheme,
    rule: StepRule,
    out: Out,
) -> None:
    """Integrate n collisions of bats with N flexible modes, and write the results to `out`.

    The collisions (scenes) are integrated in parallel lanes; a finished lane takes the next scene.
    The symbols are explained in `modal_kernel`. A scene is doubtful if a step may have hidden an
    event, such as a touch, or if the scene takes too many steps. The results of a doubtful scene
    are not valid.

    Parameters
    ----------
    w
        Working memory, from `prepare_lanes`.
    w2 : (bats, N) array
        Squared angular frequencies [1/s^2].
    bat : (n,) array
        Index of the bat of each scene.
    g : (n, N) array
        Squared mode shapes at the impact positions [1/kg].
    given
        Input of the scenes, arrays (n,).
    stiff
        True if the compliance of the stiff modes is above 0 for at least one scene.
    scheme : two arrays
        Coefficients of the kicks and of the drifts in a step. There is one kick more than drifts.
    rule
        Settings of the step size.
    out
        Results, from `prepare_results`:

        * states at the last release [SI], (n, 2 N + 2): displacements p and velocities p' of all
          modes, then displacement s and velocity s' of the rigid motion;
        * sums, (n, 3): time from first touch to last release [s], energy lost in the ball [J], and
          error of the energy balance as a share of the initial energy;
        * counts, (n, 4): number of contacts; number of reloads (times at which the compression of
          the ball grows again before the release); 1 for a doubtful scene, otherwise 0; and number
          of steps.
    """
    wide()
    kicks, drifts = scheme
    scenes, padded = len(g), (w.size - at.head) // MODE.size
    next_scene = finished = np.int64(0)  # not 0, for which numba would compile `_load` twice
    while True:
        for j in range(LANES):
            lane = w[j:]
            if lane[at.event] == EVENT.none:
                continue
            i = int(lane[at.scene])
            if i >= 0:
                after = _pass_event(lane, i, given, rule, out)
                if after == After.GOES_ON:
                    continue
                counts = out[2][i]
                counts[2], counts[3] = after == After.DOUBT, int(lane[at.steps])
                finished += 1
                lane[at.scene] = -1.0
            if next_scene < scenes:
                _load(lane, next_scene, w2[bat[next_scene]], g, given, rule.turn)
                next_scene += 1
        if finished == scenes:
            return
        for i in range(drifts.size):
            _stage(w, padded, kicks[i], drifts[i])
            if stiff:
                _forces_in_series(w)
                _forces_in_series(w)
            else:
                _forces(w)
        _stage(w, padded, kicks[drifts.size], 0.0)
        _look(w, padded)
        _plan(w, rule.growth, rule.window)


if not COMPILES:
    collide_lanes = np.errstate(all="ignore")(collide_lanes)  # an idle lane divides 0 by 0
