"""Compiled peers: a DOP853 with events, written here, and numbalsoda's if it is installed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import carray, cfunc, njit
from numpy.typing import NDArray
from scipy.integrate import DOP853

from tests.benchmarks.peers import FAST, WINDOW, Law, Peer, Scaled, approach, derivative

__all__ = ["by_compiled_dop853", "numbalsoda_peers"]

Floats = NDArray[np.float64]
Tableau = tuple[Floats, Floats, Floats, Floats]  # A, B, E3, E5
Bat = tuple[Floats, Floats]  # g, w^2
NONE, TURN, RELEASE, BACK, FULL = range(5)
TRIES = 20  # largest number of steps to meet an event
FIRST_STEP = 1e-2
ORDER = 8.0
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0  # constants of step control, as in SciPy


def by_compiled_dop853(tolerance: float) -> Peer:
    """Return a compiled DOP853 that meets events by shortening the last step."""
    tableau = (DOP853.A, DOP853.B, DOP853.E3, DOP853.E5)

    def rates(scaled: Scaled) -> Floats:
        out = _all(scaled.shapes, scaled.squares, scaled.balls, tolerance, tableau)
        return np.asarray(out)

    return rates


@njit(fastmath=FAST)
def _step(h: float, y: Floats, K: Floats, new: Floats, law: Law, bat: Bat, rule: Tableau) -> None:
    """Step from y, whose derivative is K[0], to `new`, whose derivative is written to K[-1]."""
    A, B, g, w2 = rule[0], rule[1], bat[0], bat[1]
    for stage in range(1, B.size + 1):
        for i in range(y.size):
            new[i] = 0.0
        for j in range(stage):
            share = A[stage, j] if stage < B.size else B[j]
            if share != 0.0:
                for i in range(y.size):
                    new[i] += share * K[j, i]
        for i in range(y.size):
            new[i] = y[i] + h * new[i]
        derivative(new, law, g, w2, K[stage])


@njit(fastmath=FAST)
def _error(h: float, y: Floats, K: Floats, new: Floats, tolerance: float, rule: Tableau) -> float:
    """Return the error of a step divided by its tolerance, mixed of two orders as in SciPy."""
    E3, E5 = rule[2], rule[3]
    third, fifth = 0.0, 1e-300
    for i in range(y.size):
        scale = tolerance * (1.0 + max(abs(y[i]), abs(new[i])))
        e3, e5 = 0.0, 0.0
        for j in range(E3.size):
            e3 += E3[j] * K[j, i]
            e5 += E5[j] * K[j, i]
        third += (e3 / scale) ** 2
        fifth += (e5 / scale) ** 2
    return float(h * fifth / np.sqrt((fifth + 0.01 * third) * y.size))


@njit
def _event(y: Floats, new: Floats, g: Floats, loading: bool, rising: bool, peak: float) -> int:
    """Return the event within a step."""
    before, rate = approach(y, g, g.size + 1), approach(new, g, g.size + 1)
    x = approach(new, g, 0)
    if rising:
        full = not loading and x > peak
        return TURN if rate < 0.0 else FULL if full else NONE
    return RELEASE if x < 0.0 else BACK if rate > 0.0 > before else NONE


@njit
def _meet(
    event: int,
    h: float,
    y: Floats,
    K: Floats,
    new: Floats,
    law: Law,
    bat: Bat,
    peak: float,
    rule: Tableau,
) -> float:
    """Shorten the last step until it ends on its event, and return its length."""
    g, span = bat[0], h
    for _ in range(TRIES):
        if event in (TURN, BACK):
            miss, slope = approach(new, g, g.size + 1), approach(K[-1], g, g.size + 1)
        else:
            level = peak if event == FULL else 0.0
            miss, slope = approach(new, g, 0) - level, approach(new, g, g.size + 1)
        change = miss / slope
        span = min(max(span - change, 1e-6 * h), h)
        _step(span, y, K, new, law, bat, rule)
        if abs(change) < 1e-4 * h:
            break
    return span


@njit
def _one(y: Floats, ball: Floats, bat: Bat, tolerance: float, rule: Tableau) -> float:
    k, a, b = ball
    g, w2 = bat
    K, new = np.empty((rule[1].size + 1, y.size)), np.empty_like(y)
    loading, rising, peak, law = True, True, 0.0, (k, 1.0, a)
    t, h = 0.0, FIRST_STEP
    derivative(y, law, g, w2, K[0])
    while t < WINDOW:
        _step(h, y, K, new, law, bat, rule)
        error = _error(h, y, K, new, tolerance, rule)
        factor = SAFETY * error ** (-1.0 / ORDER)
        if error > 1.0:
            h *= max(SHRINK, factor)
            continue
        event = _event(y, new, g, loading, rising, peak)
        t += h if event == NONE else _meet(event, h, y, K, new, law, bat, peak, rule)
        y[:] = new
        if event == RELEASE:
            return float(y[-1])
        if event == NONE:
            K[0] = K[-1]
            h *= min(GROW, factor)
            continue
        if event == TURN and loading:
            peak = approach(y, g, 0)
            loading, law = False, (k * peak**a, peak, b)
        elif event == FULL:
            loading, law = True, (k, 1.0, a)
        rising = event in (BACK, FULL)
        derivative(y, law, g, w2, K[0])
    return np.nan


@njit
def _all(shapes: Floats, squares: Floats, balls: Floats, tolerance: float, rule: Tableau) -> Floats:
    out = np.empty(len(balls))
    for i in range(len(balls)):
        y = np.zeros(2 * shapes.shape[1] + 2)
        y[-1] = 1.0
        out[i] = _one(y, balls[i], (shapes[i], squares[i]), tolerance, rule)
    return out


def numbalsoda_peers() -> Callable[[float], Peer]:
    """Return a function that makes a peer of numbalsoda's DOP853 for a tolerance.

    It steps and finds events in Fortran. Re-loading is not watched, which saves one event.

    Raises
    ------
    ImportError, OSError
        If it is not installed (which needs a Fortran compiler), or its libraries do not load.
    """
    from numbalsoda import lsoda_sig, solve_ivp

    # data: N, kind of event, coefficient, scale, power, then g and w^2
    @cfunc(lsoda_sig)
    def slope(_, y, out, data):
        n = int(data[0])
        values = carray(data, 5 + 2 * n)
        law = (values[2], values[3], values[4])
        derivative(
            carray(y, 2 * n + 2), law, values[5 : 5 + n], values[5 + n :], carray(out, 2 * n + 2)
        )

    @cfunc(lsoda_sig)
    def ends(_, y, out, data):
        n = int(data[0])
        g = carray(data, 5 + n)[5:]
        out[0] = approach(carray(y, 2 * n + 2), g, n + 1 if data[1] == TURN else 0)

    slope_at, ends_at = slope.address, ends.address

    @njit
    def run(shapes: Floats, squares: Floats, balls: Floats, tolerance: float) -> Floats:
        n = shapes.shape[1]
        out, span = np.empty(len(balls)), np.array([0.0, WINDOW])
        data, last = np.empty(5 + 2 * n), np.array([WINDOW])
        for i in range(len(balls)):
            k, a, b = balls[i]
            y = np.zeros(2 * n + 2)
            y[-1] = 1.0
            data[:5] = np.array([n, TURN, k, 1.0, a])
            data[5 : 5 + n], data[5 + n :] = shapes[i], squares[i]
            for _ in range(2):
                solution = solve_ivp(
                    slope_at, span, y, last, "DOP853", 1, ends_at, data.ctypes.data,
                    0.0, 0.0, tolerance, tolerance,
                )  # fmt: skip
                y[:] = solution.y_event
                peak = approach(y, shapes[i], 0)
                data[1:5] = np.array([RELEASE, k * peak**a, peak, b])
            out[i] = y[-1]
        return out

    def peer(tolerance: float) -> Peer:
        return lambda scaled: np.asarray(
            run(scaled.shapes, scaled.squares, scaled.balls, tolerance)
        )

    return peer
