"""Reference values of e_A by scipy's DOP853, for the tests of the integrator.

This module shares the physical parameters of a scene with the program, but no code of the
integration, the force law or the events. Each branch of the force law is one call of `solve_ivp`.
Between contacts the modes vibrate freely, so the next touch is a root of a sum of sines.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from virtual_lab.simulation.collision.stepping import CollisionBatch

__all__ = ["Reference", "solve"]

Floats = NDArray[np.float64]
WINDOW = 0.01  # time after first touch within which contacts begin [s]
TOLERANCE = 1e-12
# largest step: times the highest angular frequency, and in time [s], so that no event is missed
PHASE, LONGEST = 0.5, 4e-6
FLIGHT_PHASE = 0.05  # the same of the search for the next touch
LOADING, DOWN, UP = range(3)  # branches: loading; unloading, falling; unloading, rising


@dataclass(frozen=True, slots=True)
class Reference:
    """Result of one scene."""

    efficiency: float  # e_A
    contacts: int
    reloads: int  # number of times the compression grew again before a release


def solve(batch: CollisionBatch) -> list[Reference]:
    """Return the results of all scenes of a batch."""
    return [_Scene(batch, i).run() for i in range(len(batch.speed))]


class _Scene:
    """One scene. The state has p of each mode, s, and the rates of both."""

    def __init__(self, batch: CollisionBatch, i: int) -> None:
        moving = batch.shapes[i] > 0
        self.g, self.w2 = batch.shapes[i][moving], batch.squares[batch.bat[i]][moving]
        self.w, self.n = np.sqrt(self.w2), int(moving.sum())
        self.c, self.k, self.a, self.b, self.series, self.speed = (
            float(each[i])
            for each in (
                batch.inverse_mass,
                batch.stiffness,
                batch.exponent,
                batch.unloading,
                batch.compliance,
                batch.speed,
            )
        )
        self.momentum = float(batch.ball_mass[i]) * self.speed
        self.step = min(PHASE / max(float(self.w.max(initial=0.0)), 1.0), LONGEST)
        sizes = self.speed * np.repeat([1e-3, 1.0], self.n + 1)
        self.absolute = TOLERANCE * sizes

    def approach(self, y: Floats) -> float:
        return float(y[self.n] - self.g @ y[: self.n])

    def rate(self, y: Floats) -> float:
        return self.approach(y[self.n + 1 :])

    def force(self, x: float, law: tuple[float, float]) -> float:
        """Return the force at an approach: x = u + C F(u), F = exp(log_k + power log u)."""
        if x <= 0:
            return 0.0
        log_k, power = law
        u = x
        for _ in range(200):
            force = exp(min(log_k + power * log(u), 600.0))
            change = (u + self.series * force - x) / (1 + self.series * power * force / u)
            u -= change
            if abs(change) <= 1e-15 * x:
                break
        return exp(min(log_k + power * log(u), 600.0))

    def run(self) -> Reference:
        y, t, contacts, reloads = np.zeros(2 * self.n + 2), 0.0, 0, 0
        y[-1] = self.speed
        while True:
            y, t, again = self.contact(y, t)
            contacts, reloads = contacts + 1, reloads + again
            touch = self.touch(y, WINDOW - t)
            if touch is None:
                break
            y, t = self.ring(y, touch), t + touch
        efficiency = (self.speed - float(y[-1])) / (self.c * self.momentum) - 1
        return Reference(efficiency, contacts, reloads)

    def contact(self, y: Floats, t: float) -> tuple[Floats, float, int]:
        """Integrate from a touch to the release, and count the reloads."""
        first = (log(self.k), self.a)
        branch, law, peak, reloads = LOADING, first, 0.0, 0
        while True:
            release, turn = (self.approach, -1), (self.rate, -1)
            full = (lambda y, at=peak: self.approach(y) - at, 1)
            events = {
                LOADING: [turn],
                DOWN: [release, (self.rate, 1)],
                # A turn in the first step is missed, so the release is searched for here, too.
                UP: [release, turn, full],
            }[branch]
            start = (y, t)
            y, t, event = self.phase(*start, law, events)
            if branch == UP and event == 1 and self.approach(y) > peak:
                # One step passed the peak and turned back, so only an end at the turn shows it.
                y, t, _ = self.phase(*start, law, [full], t)
                event = 2
            if event == 0 and branch != LOADING:
                return y, t, reloads
            if branch == LOADING:
                peak = self.approach(y)
                force = self.force(peak, first)
                u = peak - self.series * force
                branch, law = DOWN, (log(force) - self.b * log(u), self.b)
            elif branch == DOWN:
                branch, reloads = UP, reloads + 1
            else:
                branch, law = (DOWN, law) if event == 1 else (LOADING, first)

    def phase(self, y, t, law, events, end=inf):  # type: ignore[no-untyped-def]
        """Integrate to the first event. Return state, time and number of the event."""

        def slope(_: float, y: Floats) -> Floats:
            force = self.force(self.approach(y), law)
            return np.concatenate(
                (y[self.n + 1 :], force - self.w2 * y[: self.n], [-self.c * force])
            )

        def ending(function, direction):  # type: ignore[no-untyped-def]
            def event(_: float, y: Floats) -> float:
                return float(function(y))

            event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
            return event

        solution = solve_ivp(
            slope,
            (t, min(t + 1.0, end)),
            y,
            method="DOP853",
            rtol=TOLERANCE,
            atol=self.absolute,
            max_step=self.step,
            events=[ending(*event) for event in events],
        )
        number = next(i for i, at in enumerate(solution.t_events) if at.size)
        return solution.y_events[number][0], float(solution.t_events[number][0]), number

    def ring(self, y: Floats, t: float) -> Floats:
        """Return the state after a time of free vibration."""
        p, v = y[: self.n], y[self.n + 1 : -1]
        sine, cosine = np.sin(self.w * t), np.cos(self.w * t)
        place, rate = p * cosine + v / self.w * sine, v * cosine - self.w * p * sine
        return np.concatenate((place, [y[self.n] + y[-1] * t], rate, [y[-1]]))

    def touch(self, y: Floats, limit: float) -> float | None:
        """Return the time from a release to the next touch; None without one within `limit`."""
        p, v = y[: self.n], y[self.n + 1 : -1]
        amplitude = float(self.g @ np.hypot(p, v / self.w))
        if y[-1] < 0:
            limit = min(limit, (float(y[self.n]) + amplitude) / -float(y[-1]))
        if limit <= 0:
            return None
        times = np.linspace(0, limit, int(limit * self.w.max(initial=1.0) / FLIGHT_PHASE) + 2)[1:]
        angle = self.w * times[:, None]
        bent = (np.cos(angle) * p + np.sin(angle) * (v / self.w)) @ self.g
        x = y[self.n] + y[-1] * times - bent
        touched = np.flatnonzero((x[1:] > 0) & (x[:-1] <= 0))
        if not touched.size:
            return None
        low, high = times[touched[0]], times[touched[0] + 1]
        return float(brentq(lambda t: self.approach(self.ring(y, t)), low, high, xtol=1e-18))
