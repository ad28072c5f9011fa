"""Flights fitted together: one g, one drag per length, a place and a velocity for each.

Pixels and frames throughout. Drag takes k v² off the speed; for a sphere of radius r and density
ρ_b k r = 3/8 C_d ρ/ρ_b: 0.0002 for a golf ball, 0.0025 for a table tennis ball, 0.01 for a ball
blown up (20 kg/m³; C_d 0.45, ρ 1.2 kg/m³). That is all that is known of it before, and where the
flights are too short to show more it keeps drag from taking the part of something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

__all__ = ["DRAG", "DRAG_U", "Fit", "Way", "fit_flights"]

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

DRAG, DRAG_U = 0.003, 0.008  # k r before the clip says anything
STEPS = 2  # of Runge and Kutta's method, from a flight's middle to a place: 1e-6 of the way
ROUNDS = 12
SETTLED = 0.02  # standard uncertainties
FAR, SOFT = 4.0, 0.05  # standard deviations, radii: places beyond count less and less
LEAST_SPREAD = 0.02  # pixels
ALIKE = 0.8  # correlation of neighbouring residuals, at most
TILT_U = 0.5  # over the picture's longer side, of the perspective before: 30 degrees


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """The places of one flight."""

    t: Array  # (place,) [frames]
    xy: Array  # (place, 2) still frame [pixels]
    late: Array  # (place,) share of the readout at which the ball was read, 0 to 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The result; a flight's four numbers are place and velocity at its own middle."""

    pull: Array  # (flight, 2) acceleration without drag [px/frame²], alike where shared
    drag: float  # [1/px]
    states: Array  # (flight, 4)
    middles: Array  # (flight,) [frames]
    tilt: Array  # (2,) of the perspective [1/px]
    centre: Array  # (2,)
    covariance: Array  # of `vector`
    vector: Array
    residuals: list[Array]  # (place, 2) of each flight
    spread: float  # robust standard deviation of a coordinate's residual
    cost: float  # sum of squares, far ones clipped
    readout: float  # [frames]
    shared: bool

    def with_vector(self, vector: Array) -> Fit:
        """Return the fit with other parameters."""
        n = len(self.states)
        m = 2 if self.shared else 2 * n
        return replace(
            self,
            vector=vector,
            pull=np.broadcast_to(vector[:m].reshape(-1, 2), (n, 2)),
            drag=max(0.0, float(vector[m])),
            tilt=vector[m + 1 : m + 3],
            states=vector[m + 3 :].reshape(n, 4),
        )

    def drifting(self, velocity: Array) -> Fit:
        """Return the fit of the same places if the still frame moves, (2,) [px/frame]."""
        states = self.states + np.hstack(
            [self.middles[:, None] * velocity, np.broadcast_to(velocity, (len(self.states), 2))]
        )
        return self.with_vector(np.concatenate([self.vector[: -states.size], states.ravel()]))

    def at(self, flight: int, t: Array | float) -> Array:
        """Return place and velocity of a flight in the plane, (time, 4) [pixels, frames]."""
        t = np.atleast_1d(np.asarray(t, float))
        pull = np.broadcast_to(self.pull[flight], (len(t), 2))
        return _flown(
            np.broadcast_to(self.states[flight], (len(t), 4)),
            pull,
            self.drag,
            t - self.middles[flight],
        )

    def seen(self, flight: int, t: Array) -> Array:
        """Return the same as the picture shows it: places alone, (time, 2)."""
        return _pictured(self.at(flight, t)[:, :2], self.tilt, self.centre)


def fit_flights(
    ways: Sequence[Way],
    radius: float,
    size: tuple[int, int],
    *,
    readout: float = 0.0,
    drag: bool = True,
    shared: bool = True,
    tilted: bool = False,
) -> Fit:
    """Return the joint fit of some flights.

    Parameters
    ----------
    ways
        The flights, of four places or more each.
    radius
        Of the ball [pixels].
    size
        Columns and rows of the picture.
    readout
        From the first row to the last [frames].
    drag, shared, tilted
        Whether there is drag, one g for all, and a perspective.
    """
    problem = _Problem(ways, radius, size, readout, drag, shared, tilted)
    return problem.solved()


class _Problem:
    def __init__(
        self,
        ways: Sequence[Way],
        radius: float,
        size: tuple[int, int],
        readout: float,
        drag: bool,
        shared: bool,
        tilted: bool,
    ) -> None:
        self.ways, self.radius, self.size = ways, radius, size
        self.readout, self.shared = readout, shared
        self.t = np.concatenate([w.t + readout * w.late for w in ways])
        self.xy = np.concatenate([w.xy for w in ways])
        self.of = np.repeat(np.arange(len(ways)), [len(w.t) for w in ways])
        self.middles = np.array([float(np.mean(w.t + readout * w.late)) for w in ways])
        self.centre = (np.array(size) - 1) / 2
        n = len(ways)
        self.pulls = 1 if shared else n
        self.fixed = np.zeros(2 * self.pulls + 1 + 2 + 4 * n, bool)
        self.fixed[2 * self.pulls] = not drag
        self.fixed[2 * self.pulls + 1 : 2 * self.pulls + 3] = not tilted
        self.start = self._start()

    def _start(self) -> Array:
        pulls, states, weights = [], [], []
        for way, middle in zip(self.ways, self.middles, strict=True):
            s = way.t + self.readout * way.late - middle
            solved = np.linalg.lstsq(np.vander(s, 3), way.xy, rcond=None)[0]
            pulls.append(2 * solved[0])
            states.append([*solved[2], *solved[1]])
            weights.append(max(len(s) - 3, 0.1) ** 2.5)
        pull = np.array(pulls)
        if self.shared:
            pull = np.average(pull, axis=0, weights=weights)[None]
        return np.concatenate([pull.ravel(), [0.0], [0.0, 0.0], np.ravel(states)])

    def _parts(self, vector: Array) -> tuple[Array, float, Array, Array]:
        m = 2 * self.pulls
        pull = vector[:m].reshape(self.pulls, 2)
        pull = np.broadcast_to(pull, (len(self.ways), 2))
        return pull, float(vector[m]), vector[m + 1 : m + 3], vector[m + 3 :].reshape(-1, 4)

    def _places(self, vector: Array) -> Array:
        pull, drag, tilt, states = self._parts(vector)
        flown = _flown(states[self.of], pull[self.of], drag, self.t - self.middles[self.of])
        return _pictured(flown[:, :2], tilt, self.centre)

    def _jacobian(self, vector: Array) -> Array:
        """Return the derivative of all places, (place, 2, parameter): flights move together."""
        base, m = self._places(vector), 2 * self.pulls
        jacobian = np.zeros((len(self.t), 2, len(vector)))
        rows = np.arange(len(self.t))
        reach = max(1.0, float(np.abs(self.t - self.middles[self.of]).max()))
        for k in range(2):
            moved, step = vector.copy(), 0.1 / reach**2
            moved[k:m:2] += step
            column = k if self.shared else k + 2 * self.of
            jacobian[rows, :, column] = (self._places(moved) - base) / step
        for k, step in ((m, 1e-4 / self.radius), (m + 1, 1e-6), (m + 2, 1e-6)):
            if not self.fixed[k]:
                moved = vector.copy()
                moved[k] += step
                jacobian[:, :, k] = (self._places(moved) - base) / step
        for k, step in enumerate((0.1, 0.1, 0.1 / reach, 0.1 / reach)):
            moved = vector.copy()
            moved[m + 3 + k :: 4] += step
            jacobian[rows, :, m + 3 + k + 4 * self.of] = (self._places(moved) - base) / step
        return jacobian

    def solved(self) -> Fit:
        m, vector = 2 * self.pulls, self.start.copy()
        free = ~self.fixed
        before, u = np.zeros(len(vector)), np.full(len(vector), np.inf)
        before[m], u[m] = DRAG / self.radius, DRAG_U / self.radius
        u[m + 1 : m + 3] = TILT_U / max(self.size)
        if free[m]:
            vector[m] = before[m]
        spread, held = 1.0, False
        inverse = np.zeros((len(vector), len(vector)))
        for _ in range(ROUNDS):
            left = self.xy - self._places(vector)
            far = np.hypot(*left.T)
            spread = max(LEAST_SPREAD, float(np.median(far)) / 1.1774)
            weight = 1 / np.sqrt(1 + (far / max(FAR * spread, SOFT * self.radius)) ** 2)
            jacobian = self._jacobian(vector)[:, :, free]
            weighted = jacobian * weight[:, None, None]
            normal = np.einsum("rci,rcj->ij", weighted, jacobian) / spread**2
            right = np.einsum("rci,rc->i", weighted, left) / spread**2
            normal[np.diag_indices_from(normal)] += 1 / u[free] ** 2
            right += (before - vector)[free] / u[free] ** 2
            scale = np.sqrt(np.diagonal(normal)) + 1e-12
            part = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12)
            part = part / np.outer(scale, scale)
            inverse = np.zeros((len(vector), len(vector)))
            inverse[np.ix_(free, free)] = part
            step = np.zeros(len(vector))
            if held:  # drag would be negative: the others have their best without it
                kept = np.flatnonzero(free) != m
                others = normal[np.ix_(kept, kept)]
                step[free & (np.arange(len(vector)) != m)] = np.linalg.solve(others, right[kept])
            else:
                step[free] = part @ right
            vector = vector + step
            if vector[m] < 0:
                vector[m], held = 0.0, True
                continue
            if np.abs(step[free] * scale).max() < SETTLED:
                break
        left = self.xy - self._places(vector)
        far = np.hypot(*left.T)
        spare = max(1.0, 2 * len(self.t) - free.sum())
        clipped = np.minimum(far, max(FAR * spread, SOFT * self.radius)) ** 2
        assumed, spread = spread, float(max(LEAST_SPREAD, np.sqrt(clipped.sum() / spare)))
        inverse *= (spread / assumed) ** 2 * _alike(left, self.of)
        pull, drag, tilt, states = self._parts(vector)
        bounds = np.cumsum([len(w.t) for w in self.ways])[:-1]
        return Fit(
            pull=np.array(pull),
            drag=drag,
            states=states,
            middles=self.middles,
            tilt=tilt,
            centre=self.centre,
            covariance=inverse,
            vector=vector,
            residuals=np.split(left, bounds),
            spread=spread,
            cost=float(clipped.sum()),
            readout=self.readout,
            shared=self.shared,
        )


def _alike(left: Array, of: Ints) -> float:
    """Return by how much neighbours that err alike make the variance larger than chance would."""
    same = of[1:] == of[:-1]
    power = float((left**2).mean())
    if not same.any() or power == 0:
        return 1.0
    alike = float((left[1:] * left[:-1])[same].mean()) / power
    alike = min(max(alike, 0.0), ALIKE)
    return (1 + alike) / (1 - alike)


def _flown(states: Array, pull: Array, drag: float, dt: Array) -> Array:
    """Return states (place, 4) after times, by Runge and Kutta's method."""
    if drag == 0.0:
        later = dt[:, None]
        velocity = states[:, 2:] + pull * later
        return np.hstack([states[:, :2] + states[:, 2:] * later + pull * later**2 / 2, velocity])
    step = (dt / STEPS)[:, None]

    def rate(s: Array) -> Array:
        changed = np.empty_like(s)
        changed[:, :2] = s[:, 2:]
        changed[:, 2:] = pull - drag * np.hypot(s[:, 2], s[:, 3])[:, None] * s[:, 2:]
        return changed

    s = np.array(states, float)
    for _ in range(STEPS):
        one = rate(s)
        two = rate(s + step / 2 * one)
        three = rate(s + step / 2 * two)
        s = s + step / 6 * (one + 2 * two + 2 * three + rate(s + step * three))
    return s


def _pictured(places: Array, tilt: Array, centre: Array) -> Array:
    if not tilt.any():
        return places
    off = places - centre
    return centre + off / (1 + off @ tilt)[:, None]
