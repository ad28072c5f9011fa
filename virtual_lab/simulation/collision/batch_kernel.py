"""Many collisions at once: blocks of lanes, their events, and a scene for every lane that is free.

A lane that is done takes the next scene: none waits for the slowest, and no scene knows its
neighbours. What a step may have hidden - a dip out of contact, a brush in flight, too many
steps - leaves a scene in doubt.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.simulation.collision import lanes as at
from virtual_lab.simulation.collision import powers
from virtual_lab.simulation.collision.powers import COMPILES, log2, wide

__all__ = ["GIVEN", "collide_lanes"]

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Scheme = tuple[Floats, Floats]  # kicks, drifts
# growth, turn and brush of `InStep`; the time in which contacts count
Rule = tuple[float, float, float, float]
Out = tuple[Floats, Floats, Counts]

# what is given of a scene, by column: a, b, log2 k, C, speed, c, first compression and force,
# step of the modes, step of the ball times sqrt(k a u^(a-1)), nearness of a release
GIVEN = 11
A, B, LOG, SERIES, V, INVERSE, FIRST, FIRST_FORCE, MODE_STEP, BALL_STEP, NEAR_END = range(GIVEN)

DONE, GOES_ON, DOUBT = range(3)
AFRESH = 1 / 256  # of the step of the modes, the first step of a later contact
FLAT = 3.0  # squares of the nearness of a turn: what is left beyond that, of the way, is no turn
FALL = 0.3  # of the time to release from rest, the first step down
NO_FORCE = -5000.0  # its logarithm
SCALAR: dict[str, Any] = {"forceinline": True, "error_model": "numpy"}


@njit(**SCALAR)
def _load(w: Floats, j: int, i: int, w2: Floats, g: Floats, given: Floats, near: float) -> None:
    """Put scene i into lane j, a moment after touch: there ``u^a`` is not smooth."""
    a, series, speed, c = given[i, A], given[i, SERIES], given[i, V], given[i, INVERSE]
    u, force = given[i, FIRST], given[i, FIRST_FORCE]
    x = u + series * force
    impulse = (u * force / (a + 1.0) + 0.5 * series * force**2) / speed
    drift = impulse * x / speed / (a + 2.0)
    total = c
    for m in range(w2.size):
        row = at.HEAD + m * at.MODE + j
        w[row + at.P], w[row + at.V] = drift, impulse
        w[row + at.G], w[row + at.W2] = g[i, m], w2[m]
        total += g[i, m]
    time = (x + total * drift) / speed
    w[at.S + j], w[at.S_RATE + j], w[at.X + j] = speed * time - c * drift, speed - c * impulse, x
    w[at.RATE + j], w[at.BEND + j] = speed - total * impulse, -total * force
    w[at.FORCE + j], w[at.U + j], w[at.U_SHARE + j] = force, u, u / x
    w[at.LOG_K + j], w[at.POWER + j], w[at.C + j], w[at.COMPLIANCE + j] = (
        given[i, LOG],
        a,
        c,
        series,
    )
    w[at.TIME + j], w[at.H_GROWN + j], w[at.H_MODE + j] = time, time, given[i, MODE_STEP]
    w[at.H + j], w[at.BALL + j] = min(time, given[i, MODE_STEP]), given[i, BALL_STEP]
    w[at.PHASE + j], w[at.NEAR + j], w[at.PEAK + j], w[at.TURNED + j] = (
        at.LOADING,
        near * speed,
        0.0,
        0.0,
    )
    w[at.SCENE + j], w[at.STEPS + j], w[at.LOSS + j], w[at.REACH + j] = float(i), 0.0, 0.0, 0.0


@njit(**SCALAR)
def _switch(w: Floats, j: int, phase: float, power: float, log_k: float, near: float) -> None:
    """Put lane j under another law; its force is the same in both."""
    w[at.PHASE + j], w[at.POWER + j], w[at.LOG_K + j], w[at.NEAR + j] = phase, power, log_k, near
    w[at.TURNED + j] = 0.0
    if phase == at.UNLOADING:
        softness = w[at.U + j] / (power * w[at.FORCE + j])
        fall = np.sqrt(-2.0 * w[at.X + j] / w[at.BEND + j])  # time to release from rest
        w[at.SOFTNESS + j] = softness
        w[at.H_GROWN + j] = min(w[at.H_GROWN + j], w[at.BALL + j] * np.sqrt(softness), FALL * fall)
    w[at.H + j] = w[at.H_GROWN + j]


@njit(**SCALAR)
def _ring(p: float, v: float, w2: float, t: float) -> tuple[float, float]:
    """Return displacement and velocity of a mode a time t later without force."""
    angle2 = w2 * t * t
    if angle2 < 0.1:  # series, for speed
        sine = t * (1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0 * (1.0 - angle2 / 42.0)))
        cosine = 1.0 - angle2 / 2.0 * (1.0 - angle2 / 12.0 * (1.0 - angle2 / 30.0))
    else:
        angle = np.sqrt(angle2)
        sine, cosine = t * np.sin(angle) / angle, np.cos(angle)
    return cosine * p + sine * v, cosine * v - sine * w2 * p


@njit(**SCALAR)
def _release(w: Floats, j: int, i: int, states: Floats, sums: Floats, speed: float) -> bool:
    """Write down the state of lane j; return whether ball and bat can still meet."""
    modes = (states.shape[1] - 2) // 2
    s_rate, c, loss = w[at.S_RATE + j], w[at.C + j], w[at.LOSS + j]
    t = -w[at.X + j] / w[at.RATE + j]  # still to go, or gone too far
    t -= 0.5 * w[at.BEND + j] / w[at.RATE + j] * t * t
    if abs(w[at.BEND + j] * t) > 0.5 * abs(w[at.RATE + j]):  # it grazes
        t = 0.0
    closing, energy, reach = s_rate, 0.0, 0.0
    for m in range(modes):
        row = at.HEAD + m * at.MODE + j
        p, v, g, w2 = w[row + at.P], w[row + at.V], w[row + at.G], w[row + at.W2]
        states[i, m], states[i, modes + m] = _ring(p, v, w2, t)
        square = v * v + w2 * p * p
        closing += g * np.sqrt(square)
        energy += g * square
    if closing > 0.0:
        for m in range(modes):
            row = at.HEAD + m * at.MODE + j
            p, v = w[row + at.P], w[row + at.V]
            reach += w[row + at.G] * np.sqrt(v * v / w[row + at.W2] + p * p)
    w[at.REACH + j] = reach
    states[i, 2 * modes], states[i, 2 * modes + 1] = w[at.S + j] + s_rate * t, s_rate
    sums[i, 0], sums[i, 1] = w[at.TIME + j] + t, loss
    sums[i, 2] = 1.0 - (s_rate**2 + c * (energy + 2.0 * loss)) / speed**2
    return bool(closing > 0.0)


@njit(**SCALAR)
def _extreme(w: Floats, j: int) -> float:
    """Return the approach where it turned within the last step, by its last derivatives."""
    rate, bend, jerk = w[at.RATE + j], w[at.BEND + j], w[at.JERK + j]
    root = np.sqrt(max(bend**2 - 2.0 * jerk * rate, 0.0))
    ago = 2.0 * rate / (bend + np.copysign(root, bend))
    return float(w[at.X + j] - ago * (rate - ago * (0.5 * bend - ago * jerk / 6.0)))


@njit(**SCALAR)
def _pass_event(
    w: Floats, j: int, i: int, given: Floats, near: float, brush: float, out: Out
) -> int:
    """Take lane j over its event; return what that leaves of its scene i to do."""
    states, sums, counts = out
    a, b, speed, log_k = given[i, A], given[i, B], given[i, V], given[i, LOG]
    event, phase, rate = w[at.EVENT + j], w[at.PHASE + j], w[at.RATE + j]
    lost = 1.0 / (a + 1.0) - 1.0 / (b + 1.0)  # in the ball, over its greatest force times u
    if event in (at.CLEAR, at.LOST):
        return DONE if event == at.CLEAR else DOUBT
    if event == at.TURNED_BACK:
        peak, extreme = w[at.PEAK + j], _extreme(w, j)
        if phase == at.FLYING:
            hidden = extreme > -brush * peak
        elif rate < 0.0:
            hidden = extreme > (1.0 - brush) * peak
        else:
            counts[i, 1] += 1
            w[at.TURNED + j] = 1.0
            hidden = extreme < 0.1 * brush * peak
        return DOUBT if hidden else GOES_ON
    if phase == at.LOADING:
        left = -0.5 * rate**2 / w[at.BEND + j]  # to where it turns
        if left > FLAT * near**2 * w[at.X + j]:
            return DOUBT
        u = w[at.U + j] + left
        w[at.PEAK + j] = w[at.X + j] + left
        w[at.LOSS + j] += lost * u * w[at.FORCE + j] * (1.0 + a * left / w[at.U + j])
        _switch(w, j, at.UNLOADING, b, log_k - (b - a) * log2(u), w[at.X + j] * given[i, NEAR_END])
    elif phase == at.FLYING:
        w[at.U_SHARE + j], w[at.H_GROWN + j] = 1.0, AFRESH * w[at.H_MODE + j]
        _switch(w, j, at.LOADING, a, log_k, near * rate)
    elif rate > 0.0:
        w[at.LOSS + j] -= lost * w[at.U + j] * w[at.FORCE + j]
        _switch(w, j, at.LOADING, a, log_k, near * rate)
    else:
        counts[i, 0] += 1
        if not _release(w, j, i, states, sums, speed):
            return DONE
        if w[at.BEND + j] > 0.0 and rate**2 < 2.0 * brush * w[at.PEAK + j] * w[at.BEND + j]:
            return DOUBT
        w[at.FORCE + j] = 0.0
        _switch(w, j, at.FLYING, 1.0, NO_FORCE, 0.0)
    return GOES_ON


def _kernel(sources: str) -> Any:
    """Return the kernel. A compiled one is kept for these sources only.

    The compiler's own cache looks for changes in this file alone; what a function takes from
    around it is part of the key.
    """

    @njit(cache=True, nogil=True)
    def collide_lanes(
        w2: Floats, bat: Counts, g: Floats, given: Floats, scheme: Scheme, rule: Rule
    ) -> Out:
        """Run n collisions with N flexible modes.

        Parameters
        ----------
        w2 : (bats, N) array
            Squared angular frequencies [1/s^2].
        bat : (n,) array
            Which bat each scene is of.
        g : (n, N) array
            Squared shapes at the impacts [1/kg].
        given : (n, GIVEN) array
            See above, all in SI.
        scheme : two arrays
            Kicks and drifts, one kick more than drifts.
        rule : tuple

        Returns
        -------
        states : (n, 2 N + 2) array
            p, p', s, s' at the last release.
        sums : (n, 3) array
            First touch to last release [s]; work lost in the ball [J]; share of the energy that
            does not close.
        counts : (n, 5) array
            Contacts; turns back before release; 1 where the scene is in doubt; 1 where ball and
            bat may meet after all the time; steps.
        """
        wide()
        _ = sources
        scenes, modes = g.shape
        (kicks, drifts), (growth, near, brush, window) = scheme, rule
        out = (
            np.zeros((scenes, 2 * modes + 2)),
            np.zeros((scenes, 3)),
            np.zeros((scenes, 5), np.int64),
        )
        padded = -(-modes // at.CHUNK) * at.CHUNK
        room = np.zeros(at.HEAD + padded * at.MODE + 8)
        w = room[(-room.ctypes.data // 8) % 8 :][: at.HEAD + padded * at.MODE]
        stiff = False
        for i in range(scenes):
            stiff |= given[i, SERIES] > 0.0
        w[at.SCENE : at.SCENE + at.LANES] = -1.0
        w[at.EVENT : at.EVENT + at.LANES] = at.CLEAR
        taken = left = 0
        while True:
            for j in range(at.LANES):
                if w[at.EVENT + j] == at.NONE:
                    continue
                i = int(w[at.SCENE + j])
                if i >= 0:
                    state = _pass_event(w, j, i, given, near, brush, out)
                    if state == GOES_ON:
                        continue
                    near_yet = w[at.S + j] + w[at.REACH + j] >= 0.0
                    out[2][i, 2], out[2][i, 4] = state == DOUBT, int(w[at.STEPS + j])
                    out[2][i, 3] = w[at.EVENT + j] == at.CLEAR and near_yet
                    left += 1
                    w[at.SCENE + j] = -1.0
                if taken < scenes:
                    _load(w, j, taken, w2[bat[taken]], g, given, near)
                    taken += 1
            if left == scenes:
                return out
            for i in range(drifts.size):
                at.stage(w, padded, kicks[i], drifts[i])
                if stiff:
                    at.forces_in_series(w)
                    at.forces_in_series(w)
                else:
                    at.forces(w)
            at.stage(w, padded, kicks[drifts.size], 0.0)
            at.look(w, padded)
            at.plan(w, growth, window)

    if COMPILES:
        return collide_lanes
    return np.errstate(all="ignore")(collide_lanes)  # a lane that waits divides 0 by 0


def _digest(*modules: Any) -> str:
    return hashlib.sha256(b"".join(Path(m.__file__).read_bytes() for m in modules)).hexdigest()


collide_lanes = _kernel(_digest(at, powers))
