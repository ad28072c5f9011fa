"""A block of scenes that are stepped together, a lane of a vector register to each.

Every pass runs over the lanes, so that the compiler makes one instruction of eight scenes.
Coordinates, ball and scheme are those of `modal_kernel`. Steps follow the stiffness of the
moment and are shortened to end on what each lane heads for: loading, the turn of the approach;
unloading, release, or when it rises again the greatest compression so far; flying, the touch.
Where a step went too far the next goes back, for each law is smooth past its own end.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.collision.powers import SIMD, exp2, log2, wide

Floats = NDArray[np.float64]

LANES = 64
ROW = LANES + 8  # rows are whole cache lines apart, and not a power of two
CHUNK = 5  # modes a pass: 15 and 20, which the ladder takes most, leave no rest
# rows of a block, a number a lane; after them p, v, g and w^2 of each mode
S, S_RATE, X, RATE, BEND, JERK, OLD_RATE, OLD_BEND = range(0, 8 * ROW, ROW)
FORCE, U, U_SHARE, LOG_K, POWER, C, COMPLIANCE = range(8 * ROW, 15 * ROW, ROW)
TIME, H, H_MODE, H_GROWN, BALL, EVENT, STEPS, SCENE = range(15 * ROW, 23 * ROW, ROW)
PHASE, PEAK, NEAR, TURNED, REACH, LOSS, SOFTNESS = range(23 * ROW, 30 * ROW, ROW)
HEAD = 30 * ROW
P, V, G, W2 = range(0, 4 * ROW, ROW)
MODE = 4 * ROW

LOADING, UNLOADING, FLYING = 1.0, 0.0, -1.0  # phases
NONE, REACHED, TURNED_BACK, CLEAR, LOST = range(5)  # events
MOST_STEPS = 1500.0
SWEEP = 0.5  # of the greatest compression over b, the most a rising ball moves in a step
TOUCH = 1e-7  # of the greatest compression: how near a branch is left or a contact begun
HIDDEN = 10.0  # times what counts as turned: a slower approach may have turned in a step
LEAST_U, LEAST_LOG, LEAST_FORCE = 1e-12, -200.0, 1e-9  # nothing becomes a denormal


@njit(**SIMD)
def forces(w: Floats) -> None:
    """Set the force of each lane at its approach."""
    wide()
    for j in range(LANES):
        x = w[X + j]
        u = max(x, LEAST_U)
        y = w[LOG_K + j] + w[POWER + j] * log2(u)
        w[FORCE + j] = exp2(max(y, LEAST_LOG)) if x > 0.0 else 0.0
        w[U + j] = u


@njit(**SIMD)
def forces_in_series(w: Floats) -> None:
    """Bring forces closer to those of ball and stiff modes in series: x = u + C F(u).

    One pass of Newton's method from the ball's last share u / x of the approach, which
    hardly changes from stage to stage.
    """
    wide()
    for j in range(LANES):
        x, power, series = w[X + j], w[POWER + j], w[COMPLIANCE + j]
        given = max(x, LEAST_U)
        u = given * w[U_SHARE + j]
        force = exp2(max(w[LOG_K + j] + power * log2(u), LEAST_LOG))
        slope = power * force / u
        change = max((given - u - series * force) / (1.0 + series * slope), -0.5 * u)
        force += slope * change
        w[U + j] = u + change
        w[U_SHARE + j] = (u + change) / given
        w[FORCE + j] = force if x > 0.0 else 0.0


@njit(**SIMD)
def _stage_chunk(w: Floats, modes: Floats, kick: float, drift: float) -> None:
    wide()
    for j in range(LANES):
        h = w[H + j]
        force = w[FORCE + j]
        x = w[X + j]
        for m in range(CHUNK):
            p = modes[m * MODE + P + j]
            v = modes[m * MODE + V + j]
            g = modes[m * MODE + G + j]
            v += kick * h * (force - modes[m * MODE + W2 + j] * p)
            p += drift * h * v
            modes[m * MODE + P + j] = p
            modes[m * MODE + V + j] = v
            x -= g * p
        w[X + j] = x


@njit(**SIMD)
def stage(w: Floats, modes: int, kick: float, drift: float) -> None:
    """Kick all velocities by the present force, then drift."""
    wide()
    for j in range(LANES):
        h = w[H + j]
        rate = w[S_RATE + j] - kick * h * w[C + j] * w[FORCE + j]
        s = w[S + j] + drift * h * rate
        w[S_RATE + j] = rate
        w[S + j] = s
        w[X + j] = s
    for i in range(0, modes, CHUNK):
        _stage_chunk(w, w[HEAD + i * MODE : HEAD + (i + CHUNK) * MODE], kick, drift)


@njit(**SIMD)
def _look_chunk(w: Floats, modes: Floats) -> None:
    wide()
    for j in range(LANES):
        force = w[FORCE + j]
        rate = w[RATE + j]
        bend = w[BEND + j]
        for m in range(CHUNK):
            g = modes[m * MODE + G + j]
            rate -= g * modes[m * MODE + V + j]
            bend -= g * (force - modes[m * MODE + W2 + j] * modes[m * MODE + P + j])
        w[RATE + j] = rate
        w[BEND + j] = bend


@njit(**SIMD)
def look(w: Floats, modes: int) -> None:
    """Set the first and second derivative of the approach."""
    wide()
    for j in range(LANES):
        w[OLD_RATE + j] = w[RATE + j]
        w[OLD_BEND + j] = w[BEND + j]
        w[RATE + j] = w[S_RATE + j]
        w[BEND + j] = -w[C + j] * w[FORCE + j]
    for i in range(0, modes, CHUNK):
        _look_chunk(w, w[HEAD + i * MODE : HEAD + (i + CHUNK) * MODE])


@njit(**SIMD)
def plan(w: Floats, growth: float, window: float) -> None:
    """Say which lanes have come to an event, and how far the others are to step."""
    wide()
    for j in range(LANES):
        h = w[H + j]
        w[TIME + j] += h
        w[STEPS + j] += 1.0
        x, rate, bend, peak = w[X + j], w[RATE + j], w[BEND + j], w[PEAK + j]
        loading, flying = w[PHASE + j] > 0.0, w[PHASE + j] < 0.0
        unloading = (not loading) & (not flying)
        jerk = (bend - w[OLD_BEND + j]) / h
        w[JERK + j] = jerk
        # what is to vanish, falling, and its derivatives
        filling = unloading & (rate > 0.0) & ((w[TURNED + j] > 0.0) | (x > peak))
        upward = filling | flying
        sign = -1.0 if upward else 1.0
        miss = sign * (rate if loading else (x - peak if filling else x))
        first = sign * (bend if loading else rate)
        second = sign * (jerk if loading else bend)
        square = first * first - 2.0 * second * miss
        to = 2.0 * miss / (np.sqrt(max(square, 0.0)) - first)
        seen = (square >= 0.0) & ((to > 0.0) | (miss < 0.0)) & (first < 0.0)
        # a ball that rises, or is about to, comes back to its stiffest
        step = min(w[H_MODE + j], growth * w[H_GROWN + j])
        rising = unloading & (rate + step * bend > 0.0)
        softness = w[U + j] / (w[POWER + j] * max(w[FORCE + j], LEAST_FORCE))
        softness = w[SOFTNESS + j] if rising else softness
        step = min(step, w[BALL + j] * np.sqrt(softness))
        sweep = SWEEP * peak / (w[POWER + j] * max(rate, 1e-3))
        step = min(step, sweep) if rising else step
        w[H_GROWN + j] = step
        far = abs(to)
        landing = far if far < step else (0.5 * far if far < 2.0 * step else step)
        w[H + j] = (landing if to > 0.0 else -landing) if seen else step
        reached = (abs(miss) <= (TOUCH * peak if upward else w[NEAR + j])) & (first < 0.0)
        again = (rate > 0.0) | (w[TURNED + j] > 0.0)
        turned = (w[OLD_RATE + j] * rate < 0.0) & (not loading) & (rate < 0.0 if flying else again)
        gone = flying & ((w[S + j] + w[REACH + j] < 0.0) | (w[TIME + j] > window))
        event = TURNED_BACK if turned else NONE
        event = REACHED if reached else event
        event = CLEAR if gone else event
        # a touch, or a turn and a turn back, that one step may have hidden
        missed = flying & (x > 0.0) & (rate < 0.0)
        slow = (rate - HIDDEN * w[NEAR + j]) * jerk < 0.5 * bend * bend
        dipped = loading & (bend > 0.0) & (w[OLD_BEND + j] < 0.0) & slow
        w[EVENT + j] = LOST if missed | dipped | (w[STEPS + j] > MOST_STEPS) else event
