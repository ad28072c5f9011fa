"""Joint fit of flights: a common g and drag, and a position and velocity of each flight.

The camera is assumed to be level, so that its perspective is small. The scene may state g and drag.
If positions have no u, it is estimated from their scatter. Errors that change slowly along a flight
reduce their weight, because such errors look like drag. Positions of a calibrated camera have a u
from noise and a u from the pattern of the ball, which moves the apparent center slowly as the ball
turns. The errors that the pattern causes in neighboring frames are similar, so they do not appear
in the residuals, and they affect the speed fully. The size of this effect is computed from the
pictures, its correlation time from the residuals.

Units are pixels and frames. Drag is a deceleration k v². For a sphere of radius r and density ρ_b,
k r = 3/8 C_d ρ/ρ_b: 0.0002 for a golf ball, 0.0025 for a table tennis ball, 0.01 for an inflated
ball (20 kg/m³; C_d 0.45, ρ 1.2 kg/m³). The parameter of the fit is the logarithm of the drag, so
that drag is positive, and prior knowledge prevents it from absorbing other effects.

Contacts with one floor are on a line that is level to `slant_u`. Without this condition, drag, a
turned camera and a tilted picture could not be distinguished, because a codec moves positions by
tenths of a pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array
from virtual_lab.video.follow.pieces import FAR_U, Ints, Piece
from virtual_lab.video.follow.scene import FlightScene

Floor = Sequence[tuple[int, float]]  # contacts: number of the flight before, and time [frames]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightFit:
    """Assumptions of the joint fit of flights, and its criteria for convergence."""

    drag: float = 0.0005  # prior value of k r
    drag_u: float = 1.1  # relative u: a factor of 3
    rounds: int = 12
    settled_u: float = 0.02  # largest step of a converged parameter [standard uncertainties]
    # distance up to which a position has full weight [ball radii], unless FAR_U allows more
    outlier_radii: float = 0.05
    least_spread: float = 0.02  # pixels
    correlation: float = 0.8  # largest correlation of neighboring residuals
    # range of the correlation time of a pattern [durations of the flight]
    lags: tuple[float, float] = (0.02, 30.0)
    slant_u: float = 0.0035  # u of the slope of a floor or wall relative to g, about 4 mm per meter
    # prior of an unknown readout time, and its u [frames]; phones have 0.3 to 0.95
    readout: tuple[float, float] = (0.5, 0.3)


FLIGHT_FIT = FlightFit()


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The result of a fit; `states` are position and velocity of each flight at its middle time."""

    pull: Array  # (flight, 2), acceleration without drag, equal for all if shared [px/frame²]
    drag: float  # [1/px]
    tilt: Array  # (2,) tilt of the perspective: relative change of the scale [1/px]
    states: Array  # (flight, 4)
    middles: Array  # (flight,) [frames]
    centre: Array  # (2,)
    covariance: Array  # covariance of `vector`
    vector: Array
    residuals: list[Array]  # (position, 2) for each flight
    spread: float  # robust standard deviation of a coordinate's residual
    readout: float  # readout time of a rolling shutter [frames]
    focal: float  # deviation of the focal length from the usual one [its u]
    floor: Floor  # contacts with a common floor

    @property
    def size(self) -> Any:
        """Size of the acceleration of the first flight [px/frame²]."""
        return np.linalg.norm(self.pull[..., 0, :], axis=-1)

    @property
    def down(self) -> Any:
        """Direction into the floor if contacts show it, otherwise of g; 0 if unknown."""
        down = self.pull.mean(axis=-2) @ [1, 1j]
        if self.floor:
            first, *_, last = (self.meeting(*each) @ [1, 1j] for each in self.floor)
            across = 1j * (last - first)
            down = np.where((across / down).real > 0, across, -across)[()]
        return down / np.maximum(np.abs(down), 1e-12)

    def with_vector(self, vector: Array) -> Fit:
        """Return the fit with other parameters.

        If there are several vectors, (…, parameter), its values are arrays with this shape first.
        """
        return replace(self, vector=vector, **_parts(vector, len(self.states)))

    def with_drift(self, velocity: Array) -> Fit:
        """Return the fit of the same positions if the still frame has a `velocity` [px/frame]."""
        states = self.states.copy()
        states[:, :2] += self.middles[:, None] * velocity
        states[:, 2:] += velocity
        return self.with_vector(np.concatenate([self.vector[: -states.size], states.ravel()]))

    def at(self, flight: int, t: Array | float) -> Array:
        """Return position and velocity of a flight in the plane, (…, time, 4) [pixels, frames]."""
        dt = np.atleast_1d(np.asarray(t, float)) - self.middles[flight]
        states, pull = (each[..., flight, None, :] for each in (self.states, self.pull))
        return _fly(states, pull, self.drag, dt)

    def meeting(self, flight: int, t: float) -> Array:
        """Return the point (…, 2) where a flight and the next one meet, near a time [pixels]."""
        return _meeting(*(self.at(k, t)[..., 0, :] for k in (flight, flight + 1)))

    def in_picture(self, flight: int, t: Array | float) -> Array:
        """Return the positions of a flight in the picture, (time, 2) [pixels]."""
        return _project(self.at(flight, t)[:, :2], self.tilt, self.centre)

    def in_plane(self, places: Array) -> Array:
        """Return the points of the plane that are seen at `places`, (position, 2) [pixels]."""
        return _project(places, -self.tilt, self.centre)


def estimate_of(
    quantity: Callable[[Fit], Any],
    fit: Fit,
    others: Sequence[Fit] = (),
    *,
    unit: float = 1.0,
    relative_u: float = 0.0,
) -> Estimate:
    """Return the value ``unit * quantity(fit)`` with its standard uncertainty u.

    u is `unit` times the root sum of squares of these parts:

    * For each principal axis of the fit's covariance, the parameters are moved along the axis by
      one standard uncertainty. This is done in both directions. The part is the larger of the two
      changes of the quantity. The changes differ if the quantity is not linear in the parameters.
    * For each fit in `others`, the part is the difference of the quantity between the two fits.
    * The last part is `relative_u` times the quantity.

    Parameters
    ----------
    quantity
        Function of a fit that returns a number; for a fit with several vectors, an array.
    unit
        Conversion factor of this number, for example to SI units.
    relative_u
        Relative standard uncertainty of `unit`.
    """
    value = quantity(fit)
    powers, axes = np.linalg.eigh(fit.covariance)
    significant = powers > 1e-15 * powers.max()
    moves = (axes[:, significant] * np.sqrt(powers[significant])).T
    both = quantity(fit.with_vector(fit.vector + np.stack([moves, -moves])))
    off = [*np.abs(both - value).max(axis=0), *(value - quantity(other) for other in others)]
    u = float(np.linalg.norm([*off, value * relative_u]))
    return Estimate(value=float(unit * value), u=unit * u)


def fit_flights(
    scene: FlightScene, flights: Sequence[Piece], *, shared: bool = True, floor: Floor = ()
) -> Fit:
    """Return the joint fit of flights: common g and drag, and the motion of each flight.

    Each flight needs at least four positions, or three if g is known. This is not checked.

    The positions of a flight are sharp if they come from a fit of the ball's outline. Each sharp
    position has a standard uncertainty (`Piece.u`). The positions of other flights come from bright
    regions. The drag is fitted, except for flights with sharp positions, and if the drag of the
    scene is 0. Their drag is the drag of the scene.

    Parameters
    ----------
    shared
        Whether all flights have the same g; otherwise each flight has its own.
    floor
        Contacts with a common floor, which is assumed to be level within `FLIGHT_FIT.slant_u`.
    """
    # readout time and its u
    rolled = FLIGHT_FIT.readout if scene.readout is None else (scene.readout, scene.readout_u)
    blobs = np.concatenate([each.blobs for each in flights])
    late = [scene.late(each.blobs) for each in flights]
    times = [each.t + rolled[0] * rows for each, rows in zip(flights, late, strict=True)]
    of = np.repeat(np.arange(len(flights)), [len(t) for t in times])
    middles = np.array([t.mean() for t in times])
    radius = float(np.median([each.radius for each in flights]))
    slow = [0.0 if each.sharp else len(each.t) * each.pattern_u**2 for each in flights]
    model = _FlightModel(
        dt=np.concatenate([each.t for each in flights]) - middles[of],
        late=np.concatenate(late),
        lens=np.zeros(()) if scene.lens is None else scene.lens[blobs],
        of=of,
        xy=np.concatenate([each.xy for each in flights]),
        place_u=np.concatenate([each.u for each in flights]),
        slow=np.array(slow)[of],
        sharp=flights[0].sharp,
        centre=(np.array(scene.size) - 1) / 2,
        radius=radius,
        middles=middles,
        floor=floor,
    )
    k = 2 if shared else 2 * len(flights)  # index of the drag in the vector, before the tilt
    before = np.zeros(k + 5 + 4 * len(flights))
    u = np.full(len(before), np.inf)
    if scene.pull is not None:
        before[:k], u[:k] = np.tile(scene.pull, k // 2), 0.0
    said = scene.drag or (FLIGHT_FIT.drag, FLIGHT_FIT.drag * FLIGHT_FIT.drag_u)
    length = radius if scene.in_radii or scene.drag is None else 1.0
    before[k] = np.log(said[0] / length) if said[0] else -np.inf
    u[k] = said[1] / said[0] if said[0] else 0.0
    u[k + 1 : k + 3] = scene.tilt_u
    before[k + 3], u[k + 3] = rolled
    u[k + 4] = 0.0 if scene.lens is None else 1.0
    # Drag and tilt are fixed, because a pattern would be mistaken for drag, and the plane is known.
    if model.sharp:
        u[k : k + 4] = 0.0
    vector, alike = before.copy(), 1.0
    vector[k + 5 :].reshape(-1, 4)[:, :2] = [each.xy.mean(axis=0) for each in flights]
    # Correlated errors of neighboring positions reduce the weight of each position.
    for _ in range(1 if model.sharp else 2):
        vector, inverse, weighted, room = _solve(model, vector, before, u, k, alike)
        left = model.xy - model.places(vector)
        off = np.hypot(*left.T) / model.place_u
        # An outlier would hide the correlation of the others.
        alike = _alike(np.where(off < room, left.T, 0.0).T, of)
    clipped = np.minimum(off, room) ** 2
    free = np.flatnonzero(u > 0)
    scatter = float(np.sqrt(clipped.sum() / max(1.0, 2 * len(off) - len(free))))
    scatter = max(FLIGHT_FIT.least_spread, scatter)
    covariance = np.zeros((len(vector), len(vector)))
    covariance[np.ix_(free, free)] = inverse
    residuals, parts = (np.split(e, np.flatnonzero(np.diff(of)) + 1) for e in (left, weighted))
    if model.sharp:
        for n, (flight, rest) in enumerate(zip(flights, residuals, strict=True)):
            added = pattern_covariance(flight, rest, model.after(vector)[of == n])
            for axis in (0, 1):
                at = k + 5 + 4 * n + np.array([axis, 2 + axis])
                covariance[np.ix_(at, at)] += added
    else:
        # The weights treat a slow error as one that does not average down. Its covariance is that
        # of an error that changes during half of the flight.
        for flight, rows in zip(flights, parts, strict=True):
            apart = np.subtract.outer(flight.t, flight.t) / np.ptp(flight.t)
            change = np.exp(-2 * apart**2) - len(apart) * np.eye(len(apart))
            effect = np.einsum("rci,rs,scj->ij", rows, change, rows, optimize=True)
            covariance[np.ix_(free, free)] += flight.pattern_u**2 * inverse @ effect @ inverse
        covariance *= scatter**2
        # A flight whose positions scatter more than those of all flights gets a larger u.
        wide = [float(np.median(off[of == n])) / 1.1774 / scatter for n in range(len(flights))]
        grown = np.concatenate([np.ones(k + 5), np.repeat(np.maximum(wide, 1.0), 4)])
        covariance *= np.outer(grown, grown)
    return Fit(
        **_parts(vector, len(flights)),
        middles=middles,
        centre=model.centre,
        covariance=covariance,
        vector=vector,
        residuals=residuals,
        spread=scatter * float(np.median(model.place_u)),
        floor=model.floor,
    )


def _solve(
    model: _FlightModel, start: Array, before: Array, u: Array, k: int, alike: float
) -> tuple[Array, Array, Array, float]:
    """Return parameters, their covariance, their weighted Jacobian, and the limit of outliers.

    The method is Gauss-Newton. Covariance and Jacobian are those for a scatter of 1.

    Parameters
    ----------
    start
        Parameters from which the method starts.
    before, u
        Prior values of the parameters and their u, inf for an unknown value and 0 for a fixed
        value.
    k
        Index of the drag among the parameters.
    alike
        Number of positions whose errors are equivalent to one independent error.
    """
    free, vector = np.flatnonzero(u > 0), start.copy()
    reach = max(1.0, float(np.abs(model.dt).max()))
    steps = np.tile([0.1, 0.1, 0.1 / reach, 0.1 / reach], model.of[-1] + 1)
    steps = np.concatenate([np.full(k, 0.1 / reach**2), [1e-2, 1e-6, 1e-6, 1e-2, 1e-2], steps])
    steps = np.diag(steps)[free]
    for turn in range(FLIGHT_FIT.rounds):
        places = model.places(vector)
        left = (model.xy - places) / model.place_u[:, None]
        off = np.hypot(*left.T)
        spread = max(FLIGHT_FIT.least_spread, float(np.median(off)) / 1.1774)
        room = max(FAR_U * spread, FLIGHT_FIT.outlier_radii * model.radius)
        if model.sharp:  # the stated u of the positions is used
            room, spread = np.inf, 1.0
        change = np.moveaxis(model.places(vector + steps) - places, 0, -1) / steps.sum(axis=1)
        jacobian = change / model.place_u[:, None, None]
        weighted = jacobian * (1 / np.sqrt(1 + (off / room) ** 2))[:, None, None]
        weighted = weighted / (alike * spread**2 + model.slow)[:, None, None]
        normal = np.einsum("rci,rcj->ij", weighted, jacobian)
        right = np.einsum("rci,rc->i", weighted, left)
        normal[np.diag_indices_from(normal)] += 1 / u[free] ** 2
        right += (before[free] - vector[free]) / u[free] ** 2
        if model.floor and turn:  # in the first round the flights do not meet yet
            slants = model.slants(vector)
            change = (model.slants(vector + steps) - slants).T / steps.sum(axis=1)
            normal += change.T @ change / FLIGHT_FIT.slant_u**2
            right -= change.T @ slants / FLIGHT_FIT.slant_u**2
        scale = np.sqrt(np.diagonal(normal)) + 1e-12
        inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        inverse = inverse / np.outer(scale, scale)
        step = inverse @ right
        if u[k] and (leap := abs(step[free == k][0])) > 1:
            step /= leap
        vector[free] += step
        if np.abs(step * scale).max() < FLIGHT_FIT.settled_u:
            break
    return vector, inverse / spread**2, weighted * spread, room


def pattern_covariance(flight: Piece, residuals: Array, late: Array) -> Array:
    """Return the covariance of a flight's position and velocity that a print on the ball causes.

    A print or a seam shifts the measured positions in neighboring frames by similar amounts. The
    covariance, (2, 2), is for position and velocity along one axis, in pixels and frames. It is the
    same for both axes.

    Parameters
    ----------
    flight
        Flight with sharp positions.
    residuals
        Residuals of the positions, (position, axis) [pixels]. If the scatter of the residuals is
        larger than the scatter caused by noise and pattern, the covariance is increased.
    late
        Time of each position since the middle of the flight, (position,) [frames].
    """
    t, u, pattern_u = flight.t, flight.u, flight.pattern_u
    design = np.stack([np.ones_like(late), late], axis=1)
    solver = np.linalg.pinv(design / u[:, None]) / u
    noise = (solver * u**2) @ solver.T
    span, spare = float(np.ptp(t)), len(t) - 2
    apart = np.subtract.outer(t, t) / span
    lags = np.geomspace(*FLIGHT_FIT.lags, 24)[:, None, None]
    slow = solver @ np.exp(-0.5 * (apart / lags) ** 2) @ solver.T
    worst = slow[slow[:, 1, 1].argmax()]
    excess = float(np.mean(residuals**2)) * len(t) / max(spare, 1) - float(np.mean(u**2))
    if spare < 1 or excess <= pattern_u**2:
        return np.asarray(pattern_u**2 * worst)
    # Scatter beyond noise and pattern has an unknown cause, and its size is uncertain with few
    # residuals.
    from scipy.special import stdtrit

    wide = (float(stdtrit(2 * spare, 0.975)) / 1.959964) ** 2
    return np.asarray(wide * (noise + excess * worst) - noise)


def _parts(vector: Array, flights: int) -> dict[str, Any]:
    """Return the parts of vectors, (…, parameter), keyed by the names of fields of `Fit`."""
    some, k = vector.shape[:-1], vector.shape[-1] - 4 * flights - 5
    return {
        "pull": np.broadcast_to(vector[..., :k].reshape(*some, -1, 2), (*some, flights, 2)),
        "drag": np.exp(vector[..., k]),
        "tilt": vector[..., k + 1 : k + 3],
        "readout": vector[..., k + 3][()],  # a number, if `vector` is one vector
        "focal": vector[..., k + 4][()],
        "states": vector[..., k + 5 :].reshape(*some, flights, 4),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _FlightModel:
    """Observed positions, and the positions predicted by a vector of parameters."""

    dt: Array  # (position,), time of the first row from the middle of its flight [frames]
    late: Array  # (position,), share of the readout time at the row of the ball
    lens: Array  # (position, 2), change of positions by u of the focal length; or 0
    of: Ints  # (position,), number of its flight
    xy: Array  # (position, 2)
    place_u: Array  # (position,), u; 1 if it is not known
    # (position,), variance of an error that changes slowly along a flight and does not average
    # down, times the number of positions [px²]; 0 for sharp positions
    slow: Array
    sharp: bool  # True if u is known
    centre: Array
    radius: float
    middles: Array  # (flight,) [frames]
    floor: Floor

    def after(self, vector: Array) -> Array:
        """Return times from the middle of each flight for vectors (…, parameter), (…, position)."""
        readout = _parts(vector, self.of[-1] + 1)["readout"]
        return np.asarray(self.dt + readout[..., None] * self.late)

    def slants(self, vector: Array) -> Array:
        """Return the slopes of lines from the first floor contact to the others, relative to g.

        The shape is (…, contact - 1).
        """
        parts = _parts(vector, self.of[-1] + 1)
        first, t = (np.array(each) for each in zip(*self.floor, strict=True))
        states, pull, drag = parts["states"], parts["pull"], parts["drag"]
        pairs = ((n, t - self.middles[n]) for n in (first, first + 1))
        ends = [_fly(states[..., n, :], pull[..., n, :], drag, late) for n, late in pairs]
        places = _meeting(*ends)
        lines = places[..., 1:, :] - places[..., :1, :]
        down = pull.mean(axis=-2, keepdims=True)
        across = lines[..., 0] * down[..., 1] - lines[..., 1] * down[..., 0]
        return np.asarray((lines * down).sum(axis=-1) / across)

    def places(self, vector: Array) -> Array:
        """Return the positions for vectors (…, parameter), (…, place, 2)."""
        parts = _parts(vector, self.of[-1] + 1)
        states, pull = (parts[name][..., self.of, :] for name in ("states", "pull"))
        flown = _fly(states, pull, parts["drag"], self.after(vector))
        seen = _project(flown[..., :2], parts["tilt"], self.centre)
        return np.asarray(seen - parts["focal"][..., None, None] * self.lens)


def _meeting(before: Array, after: Array) -> Array:
    """Return the point (…, 2) where two flights meet, from their states (…, 4) near that time."""
    apart, change = np.split(after - before, 2, axis=-1)
    late = -(apart * change).sum(axis=-1) / (change**2).sum(axis=-1)
    place, velocity = np.split((before + after) / 2, 2, axis=-1)
    return np.asarray(place + late[..., None] * velocity)


def _alike(left: Array, of: Ints) -> float:
    """Return the factor by which correlated errors of neighboring positions increase variances."""
    same = of[1:] == of[:-1]
    power = float((left**2).mean())
    if power == 0:
        return 1.0
    alike = float((left[1:] * left[:-1])[same].mean()) / power
    alike = min(max(alike, 0.0), FLIGHT_FIT.correlation)
    return (1 + alike) / (1 - alike)


def _fly(states: Array, pull: Array, drag: Array | float, dt: Array) -> Array:
    """Return the states (…, position, 4) after times (position,), by one Runge-Kutta step."""
    slowing = np.asarray(drag)[..., None]
    # complex numbers, because arithmetic of pairs is slow
    place, velocity = np.moveaxis(np.ascontiguousarray(states).view(complex), -1, 0)
    fall = np.ascontiguousarray(pull).view(complex)[..., 0]
    rates: list[Array] = []
    for share in (0.0, 0.5, 0.5, 1.0):
        now = velocity + share * dt * (rates[-1] if rates else 0.0)
        rates.append(fall - slowing * np.abs(now) * now)
    one, two, three, four = rates
    later = place + dt * (velocity + dt / 6 * (one + two + three))
    faster = velocity + dt / 6 * (one + 2 * (two + three) + four)
    return np.stack([later, faster], axis=-1).view(float)


def _project(places: Array, tilt: Array, centre: Array) -> Array:
    """Return points of the plane in the picture of a tilted camera, (position, 2) [pixels]."""
    if not tilt.any():
        return places
    off = places - centre
    return np.asarray(centre + off / (1 + off @ tilt[..., None]))
