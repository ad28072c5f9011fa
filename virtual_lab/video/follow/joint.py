"""Flights fitted together: one g, one drag per length, a place and a velocity for each.

Pixels and frames throughout. Drag takes k v² off the speed; for a sphere of radius r and density
ρ_b k r = 3/8 C_d ρ/ρ_b: 0.0002 for a golf ball, 0.0025 for a table tennis ball, 0.01 for a ball
blown up (20 kg/m³; C_d 0.45, ρ 1.2 kg/m³). That is all that is known of it before, and where the
flights are too short to show more it keeps drag from taking the part of something else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

Ints = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFit:
    """What the fit takes for granted, and when it ends."""

    drag: float = 0.003  # k r before the clip says anything
    drag_u: float = 0.008
    tilt_u: float = 0.5  # of a camera's perspective, of which nothing is known: 30 degrees
    runge_kutta_steps: int = 2  # from a flight's middle to a place: 1e-6 of the way
    rounds: int = 12
    settled_u: float = 0.02  # standard uncertainties that a parameter still moves by at the end
    outlier_spreads: float = 4.0  # standard deviations: places beyond count less and less,
    outlier_radii: float = 0.05  # but none within so many radii
    least_spread: float = 0.02  # pixels
    correlation: float = 0.8  # of neighbouring residuals, at most


FLIGHT_FIT = FlightFit()


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The result; a flight's four numbers are place and velocity at its own middle."""

    pull: Array  # (flight, 2) acceleration without drag [px/frame²], alike where shared
    drag: float  # [1/px]
    tilt: Array  # (2,) of the perspective [1/px]
    states: Array  # (flight, 4)
    middles: Array  # (flight,) [frames]
    centre: Array  # (2,)
    covariance: Array  # of `vector`
    vector: Array
    residuals: list[Array]  # (place, 2) of each flight
    spread: float  # robust standard deviation of a coordinate's residual
    cost: float  # sum of squares, far ones clipped
    readout: float  # [frames]
    tilt_u: float  # of the perspective before, 0: there is none

    def with_vector(self, vector: Array) -> Fit:
        """Return the fit with other parameters."""
        return replace(self, vector=vector, **_parts(vector, len(self.states)))

    def drifting(self, velocity: Array) -> Fit:
        """Return the fit of the same places if the still frame moves, (2,) [px/frame]."""
        states = self.states.copy()
        states[:, :2] += self.middles[:, None] * velocity
        states[:, 2:] += velocity
        return self.with_vector(np.concatenate([self.vector[: -states.size], states.ravel()]))

    def at(self, flight: int, t: Array | float) -> Array:
        """Return place and velocity of a flight in the plane, (time, 4) [pixels, frames]."""
        dt = np.atleast_1d(np.asarray(t, float)) - self.middles[flight]
        states = np.broadcast_to(self.states[flight], (len(dt), 4))
        return _flown(states, self.pull[flight], self.drag, dt)

    def pictured(self, flight: int, t: Array | float) -> Array:
        """Return the same as the picture shows it: places alone, (time, 2)."""
        return _pictured(self.at(flight, t)[:, :2], self.tilt, self.centre)


def estimate_of(
    quantity: Callable[[Fit], float],
    fit: Fit,
    others: Sequence[tuple[Fit, float]] = (),
    *,
    unit: float = 1.0,
    relative_u: float = 0.0,
) -> Estimate:
    """Return what follows from a fit, in units with a relative u.

    The fit is moved by one standard uncertainty either way along each axis of its covariance, and
    the greater change counts: drag cannot fall below 0. Of the difference to each other fit its
    share is u.
    """
    value = quantity(fit)
    powers, axes = np.linalg.eigh(fit.covariance)
    kept = powers > 1e-15 * powers.max()
    moves = (axes[:, kept] * np.sqrt(powers[kept])).T
    both = [[quantity(fit.with_vector(fit.vector + s * m)) for s in (1, -1)] for m in moves]
    off = [float(np.abs(np.subtract(each, value)).max()) for each in both]
    off += [share * (value - quantity(other)) for other, share in others]
    u = float(np.linalg.norm([*off, value * relative_u]))
    return Estimate(value=unit * value, u=unit * u)


def fit_flights(
    scene: FlightScene,
    flights: Sequence[Piece],
    *,
    readout: float | None = None,
    drag: bool = True,
    shared: bool = True,
    tilt_u: float = 0.0,
) -> Fit:
    """Return the joint fit of flights of four places or more each.

    Parameters
    ----------
    readout
        From the first row to the last [frames]; None: the scene's, 0 where that is unknown.
    drag, shared
        Whether there is drag, and one g for all.
    tilt_u
        Of the perspective before, over the picture's longer side; 0: there is none.
    """
    readout = (scene.readout or 0.0) if readout is None else readout
    times = [each.t + readout * scene.late(each.blobs) for each in flights]
    of = np.repeat(np.arange(len(flights)), [len(t) for t in times])
    middles = np.array([t.mean() for t in times])
    xy = np.concatenate([each.xy for each in flights])
    radius = float(np.median([each.radius for each in flights]))
    model = _FlightModel(
        dt=np.concatenate(times) - middles[of],
        of=of,
        centre=(np.array(scene.size) - 1) / 2,
        radius=radius,
    )
    vector = model.start(xy, shared=shared)
    k = len(vector) - 4 * len(flights) - 3  # drag's place in the vector, before the tilt's
    before, u = np.zeros(len(vector)), np.full(len(vector), np.inf)
    before[k], u[k] = FLIGHT_FIT.drag / radius, FLIGHT_FIT.drag_u / radius
    u[k + 1 : k + 3] = tilt_u / max(scene.size)
    parts = [k, 1, 2, 4 * len(flights)]
    free = np.flatnonzero(np.repeat([True, drag, tilt_u > 0, True], parts))
    vector[k] = before[k] if drag else 0.0
    dragless = False
    for _ in range(FLIGHT_FIT.rounds):
        left = xy - model.places(vector)
        off = np.hypot(*left.T)
        spread = max(FLIGHT_FIT.least_spread, float(np.median(off)) / 1.1774)
        room = max(FLIGHT_FIT.outlier_spreads * spread, FLIGHT_FIT.outlier_radii * radius)
        jacobian = model.jacobian(vector, free)
        weighted = jacobian * (1 / np.sqrt(1 + (off / room) ** 2))[:, None, None]
        normal = np.einsum("rci,rcj->ij", weighted, jacobian) / spread**2
        right = np.einsum("rci,rc->i", weighted, left) / spread**2
        normal[np.diag_indices_from(normal)] += 1 / u[free] ** 2
        right += (before - vector)[free] / u[free] ** 2
        scale = np.sqrt(np.diagonal(normal)) + 1e-12
        inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12)
        inverse = inverse / np.outer(scale, scale)
        step = inverse @ right
        if dragless:  # drag would be negative: the others have their best without it
            others = free != k
            step = np.zeros(len(free))
            step[others] = np.linalg.solve(normal[np.ix_(others, others)], right[others])
        vector[free] += step
        if vector[k] < 0:
            vector[k], dragless = 0.0, True
        elif np.abs(step * scale).max() < FLIGHT_FIT.settled_u:
            break
    left = xy - model.places(vector)
    off = np.hypot(*left.T)
    clipped = np.minimum(off, room) ** 2
    scatter = float(np.sqrt(clipped.sum() / max(1.0, 2 * len(xy) - len(free))))
    scatter = max(FLIGHT_FIT.least_spread, scatter)
    covariance = np.zeros((len(vector), len(vector)))
    covariance[np.ix_(free, free)] = inverse * ((scatter / spread) ** 2 * _alike(left, of))
    # a flight whose places scatter more than all do knows less of itself
    own = [float(np.median(off[of == n])) / 1.1774 / scatter for n in range(len(flights))]
    grown = np.concatenate([np.ones(k + 3), np.repeat(np.maximum(own, 1.0), 4)])
    covariance *= np.outer(grown, grown)
    return Fit(
        **_parts(vector, len(flights)),
        middles=middles,
        centre=model.centre,
        covariance=covariance,
        vector=vector,
        residuals=np.split(left, np.flatnonzero(np.diff(of)) + 1),
        spread=scatter,
        cost=float(clipped.sum()),
        readout=readout,
        tilt_u=tilt_u,
    )


def _parts(vector: Array, flights: int) -> dict[str, Any]:
    """Return what vectors (…, parameter) consist of, by the names of `Fit`."""
    some, k = vector.shape[:-1], vector.shape[-1] - 4 * flights - 3
    return {
        "pull": np.broadcast_to(vector[..., :k].reshape(*some, -1, 2), (*some, flights, 2)),
        "drag": np.maximum(0.0, vector[..., k]),
        "tilt": vector[..., k + 1 : k + 3],
        "states": vector[..., k + 3 :].reshape(*some, flights, 4),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _FlightModel:
    """The places that a vector of parameters gives."""

    dt: Array  # (place,) from the middle of its flight [frames]
    of: Ints  # (place,) number of its flight
    centre: Array
    radius: float

    def start(self, xy: Array, *, shared: bool) -> Array:
        """Return the parameters of parabolas, without drag and tilt."""
        solved, weights = [], []
        for k in range(self.of[-1] + 1):
            own = self.of == k
            solved.append(np.linalg.lstsq(np.vander(self.dt[own], 3), xy[own], rcond=None)[0])
            weights.append(max(own.sum() - 3, 0.1) ** 2.5)
        half, velocity, place = np.moveaxis(np.array(solved), 1, 0)
        pull = 2 * (np.average(half, axis=0, weights=weights) if shared else half)
        return np.concatenate([pull.ravel(), np.zeros(3), np.hstack([place, velocity]).ravel()])

    def places(self, vector: Array) -> Array:
        """Return the places of vectors (…, parameter), (…, place, 2)."""
        parts = _parts(vector, self.of[-1] + 1)
        states, pull = (parts[name][..., self.of, :] for name in ("states", "pull"))
        flown = _flown(states, pull, parts["drag"], self.dt)
        return _pictured(flown[..., :2], parts["tilt"], self.centre)

    def jacobian(self, vector: Array, free: Ints) -> Array:
        """Return the derivative of places, (place, 2, free parameter).

        A parameter is moved for all flights at once: a place depends on its own flight's alone.
        """
        rows = np.arange(len(self.dt))
        reach = max(1.0, float(np.abs(self.dt).max()))
        k = len(vector) - 4 * (self.of[-1] + 1) - 3
        own = 0 * self.of if k == 2 else 2 * self.of
        moves = [(slice(n, k, 2), n + own, 0.1 / reach**2) for n in range(2)]
        moves += [
            (slice(n, n + 1), np.array(n), step)
            for n, step in ((k, 1e-4 / self.radius), (k + 1, 1e-6), (k + 2, 1e-6))
            if n in free
        ]
        moves += [
            (slice(k + 3 + n, None, 4), k + 3 + n + 4 * self.of, step)
            for n, step in enumerate((0.1, 0.1, 0.1 / reach, 0.1 / reach))
        ]
        moved = np.tile(vector, (len(moves) + 1, 1))
        for one, (some, _, step) in zip(moved, moves, strict=False):
            one[some] += step
        *there, base = self.places(moved)
        jacobian = np.zeros((len(rows), 2, len(vector)))
        for place, (_, columns, step) in zip(there, moves, strict=True):
            jacobian[rows, :, columns] = (place - base) / step
        return jacobian[:, :, free]


def _alike(left: Array, of: Ints) -> float:
    """Return by how much neighbours that err alike make the variance larger than chance would."""
    same = of[1:] == of[:-1]
    power = float((left**2).mean())
    if power == 0:
        return 1.0
    alike = float((left[1:] * left[:-1])[same].mean()) / power
    alike = min(max(alike, 0.0), FLIGHT_FIT.correlation)
    return (1 + alike) / (1 - alike)


def _flown(states: Array, pull: Array, drag: Array | float, dt: Array) -> Array:
    """Return states (…, place, 4) after times (place,), by Runge and Kutta's method."""
    later, slowing = dt[:, None], np.asarray(drag)[..., None, None]
    if not np.any(drag):
        place = states[..., :2] + states[..., 2:] * later + pull * later**2 / 2
        return np.concatenate([place, states[..., 2:] + pull * later], axis=-1)

    def rate(v: Array) -> Array:
        return pull - slowing * np.hypot(v[..., :1], v[..., 1:]) * v

    place, velocity = states[..., :2], states[..., 2:]
    step = later / FLIGHT_FIT.runge_kutta_steps
    for _ in range(FLIGHT_FIT.runge_kutta_steps):
        one = rate(velocity)
        two = rate(velocity + step / 2 * one)
        three = rate(velocity + step / 2 * two)
        place = place + step * (velocity + step / 6 * (one + two + three))
        velocity = velocity + step / 6 * (one + 2 * (two + three) + rate(velocity + step * three))
    return np.concatenate([place, velocity], axis=-1)


def _pictured(places: Array, tilt: Array, centre: Array) -> Array:
    """Return where a tilted camera shows places of the plane."""
    if not tilt.any():
        return places
    off = places - centre
    return np.asarray(centre + off / (1 + (off * tilt[..., None, :]).sum(axis=-1, keepdims=True)))
