"""The algebra of the test: constants and readings to r, e_A, e, e0 and BPF.

Every function here broadcasts: a constant may be a number or a column of numbers (..., k, 1), a
reading is a row (..., n), and the result is (..., n) or (..., k, n). The uncertainty budget calls
the same functions with shifted constants, a block of laboratories with a leading axis for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.measurement.reduction.flights import FlightModel, Flights
from virtual_lab.measurement.reduction.kinematics import (
    parallel_axis,
    recoil_factor_free,
    recoil_factor_pivoted,
)
from virtual_lab.measurement.reduction.observations import (
    SLOPE_REPEATABILITY,
    BallReadings,
    ImpactReadings,
    restitution_names,
)
from virtual_lab.relations.flight import drag_rate
from virtual_lab.relations.pendulum import inertia_from_period, mean_amplitude_factor
from virtual_lab.units import Array, Mask

Constants = Mapping[str, Array]
# beginnings of the names of constants that the flight of a ball depends on
FLIGHT = ("bench.scale.", "hall.", "ball.radius")
# the same with the constants of the instruments that time the flight
AT_WALL, AT_BAT = (*FLIGHT, "balls."), (*FLIGHT, "impact.")
ADDED = ("balls.restitution_", "balls.slope_")  # errors added to results of the flights
HELD = tuple(f"impact.{name}." for name in ("pivot", "encoder", "swing", "cannon", "aim"))
PLACE_SLOPE = "procedure.place_slope"  # slope de_A/dz of e_A along the barrel [1/m]
SLOPE_ERROR = "procedure.place_slope_error"  # error of e_A caused by the error of the slope


@dataclass(frozen=True, slots=True, kw_only=True)
class BatProperties(AlignedArrays):
    """Measured inertial properties, numbers or columns of them [SI]."""

    mass: Array
    length: Array
    z_cm: Array
    inertia_cm: Array
    barrel_radius: Array

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredBalls(AlignedArrays):
    """Measured balls, shape (..., ball). `restitution` is e0 at `speed`."""

    mass: Array
    restitution: Array
    speed: Array  # mean nominal speed of the wall hits, (..., 1) [m/s]
    slope: Array  # slope of e0 over speed, (..., 1) [s/m]

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotResults(AlignedArrays):
    """Results of each shot, shape (..., shot)."""

    speed: Array  # speed of the ball at the bat [m/s]
    bat_speed: Array  # speed of the struck point toward the ball; 0 for a bat at rest [m/s]
    relative_speed: Array  # [m/s]
    recoil_rate: Array  # angular rate of a bat that was at rest, at the end of contact [rad/s]
    swing_rate: Array  # angular rate of a swung bat at contact; 0 for a bat at rest [rad/s]
    rebound_speed: Array  # rebound speed of the ball along the line of fire [m/s]
    rebound_slope: Array  # height gained per metre of distance in the rebound [m/m]
    ball_mass: Array  # mass of the ball [kg]
    place: Array  # impact position to which e_A refers, from the barrel tip [m]
    recoil_factor: Array  # recoil factor r with the support named by the procedure
    ball_restitution: Array  # e0 of the ball at the relative speed of the shot
    collision_efficiency: Array  # e_A at `place`, corrected for the offset across the bat
    restitution: Array
    bat_performance_factor: Array
    # e0 of the ball at the speed at which the procedure judges balls
    window_ball_restitution: Array
    # e0 of the lot's mean ball at the nominal relative speed; the next three fields
    # refer to the same ball and speed
    lot_ball_restitution: Array
    lot_recoil_factor: Array
    lot_restitution: Array
    lot_collision_efficiency: Array
    asked_recoil_factor: Array  # lot_recoil_factor at the aimed position
    rebound_efficiency: Array  # e_A from the ball's rebound; NaN: the gates did not see it
    recoil_efficiency: Array  # e_A from the bat's recoil; NaN: not recorded

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class ReductionSettings:
    """Settings of the reduction for a procedure."""

    reads: Literal["recoil", "rebound"]  # reading from which e_A is computed
    recoil: Literal["pivoted", "free"]  # support whose r is used in Eq. (6)
    pivot_from_knob: float  # distance of the pivot from the knob [m]
    ball_speed: float  # nominal speed of the ball [m/s]
    # nominal angular rate [rad/s] as a function of the bat's length [m]
    turn_rate: Callable[[Array], Array]
    window_speed: float  # speed at which balls are judged [m/s]


def bat_properties(x: Constants) -> BatProperties:
    """Return mass, balance and inertia from the bench's readings and calibrations."""
    mass = (x["bat.mass"] - x["bench.scale.zero"]) / x["bench.scale.span"]
    length = x["bat.length"] - x["bench.rule.offset"]
    z_cm = x["bat.balance"] - x["bench.stand.offset"]
    return BatProperties(
        mass=mass,
        length=length,
        z_cm=z_cm,
        inertia_cm=_inertia_cm(x, mass, length, z_cm),
        barrel_radius=x["bat.barrel_radius"] - x["bench.rule.offset"],
    )


def _inertia_cm(x: Constants, mass: Array, length: Array, z_cm: Array) -> Array:
    """Return the inertia about the centre of mass, from the period of bat and clamp together."""
    lever = length - x["bench.pendulum.pivot_from_knob"] - z_cm
    sets = _sets_of(x, ("bench.pendulum.amplitude_offset", "bat.first", "bat.last"), ())
    first, last, offset = (
        sets.chosen(x[name])
        for name in ("bat.first_amplitude", "bat.last_amplitude", "bench.pendulum.amplitude_offset")
    )
    swings = int(x["bat.swings"].flat[0])
    longer = mean_amplitude_factor(first, last, swings)
    longer = longer / mean_amplitude_factor(first - offset, last - offset, swings)
    period = x["bat.period"] / x["bench.pendulum.clock"] * sets.spread(longer)
    moment = mass * lever + x["bench.pendulum.clamp_moment"]
    both = inertia_from_period(period, moment, x["hall.gravity"])
    return both - x["bench.pendulum.clamp_inertia"] - parallel_axis(0.0, mass, lever)


def measured_balls(x: Constants, readings: BallReadings) -> MeasuredBalls:
    """Return the balls' masses and their mean e0 over the wall hits, at the hits' mean speed.

    Most sets differ only in constants that a hit at the wall does not depend on, so the hits are
    reduced only for the sets that differ in one that matters.
    """
    from virtual_lab.measurement.reduction.shot_kernel import balls_of_sets

    mass = (readings.mass - x["bench.scale.zero"]) / x["bench.scale.span"]
    sets = _sets_of(x, AT_WALL, ADDED)
    own = {name: sets.chosen(value) for name, value in x.items() if name.startswith(AT_WALL)}
    drag = of_ball(drag_of(own, sets.chosen(mass)), np.maximum(readings.ball, 0))
    flights = readings.flights.corrected(own, drag)
    with np.errstate(all="ignore"):  # one nominal speed has no slope
        means, faster, nominal, slope = balls_of_sets(
            readings.mass,
            readings.ball,
            readings.nominal_speed,
            flights.speed_in,
            flights.speed_out,
        )
    speed = nominal[..., :1, None] if nominal.ndim else nominal
    given = x["ball.restitution_slope"]
    if SLOPE_REPEATABILITY in x:
        given = sets.spread(slope[..., None]) + x[SLOPE_REPEATABILITY]
    errors = (np.atleast_1d(x[error]) for error in restitution_names(mass.shape[-1]))
    scattered = np.concatenate(np.broadcast_arrays(*errors), axis=-1)
    restitution = sets.spread(means) - given * sets.spread(faster) + scattered
    return MeasuredBalls(
        mass=np.broadcast_to(mass, restitution.shape),
        restitution=restitution,
        speed=speed,
        slope=np.asarray(given),
    )


class Sets(NamedTuple):
    """Selected sets of constants (..., k, 1), and the selected set that represents each set."""

    rows: NDArray[np.intp] | None  # indices of the selected sets; None: all
    back: NDArray[np.intp]

    def chosen(self, values: Array) -> Array:
        """Return the values for some sets, (..., k, n)."""
        if self.rows is None or np.ndim(values) < 2:
            return values
        if is_certain(values):
            return values[..., : self.rows.size, :]
        return np.take(values, self.rows, axis=-2)

    def spread(self, values: Array) -> Array:
        """Return the values for all the sets from those for some."""
        return values if self.rows is None else np.take(values, self.back, axis=-2)


def is_certain(values: Array) -> bool:
    """Tell if all sets (..., k, 1) share one number in memory: a constant without uncertainty."""
    return values.strides[-2] == 0


def _sets_of(x: Constants, names: tuple[str, ...], others: tuple[str, ...]) -> Sets:
    """Return the sets that differ in a constant whose name begins with `names`, not `others`."""
    every = np.zeros(0, dtype=np.intp)
    known = [
        value
        for name, value in x.items()
        if name.startswith(names) and not name.startswith(others) and np.ndim(value) > 1
    ]
    if not known:
        return Sets(None, every)
    moved = np.zeros(max(value.shape[-2] for value in known), dtype=bool)
    for value in known:
        if is_certain(value):
            continue
        differs = value != value[..., :1, :]
        moved |= differs.any(axis=(*range(value.ndim - 2), value.ndim - 1))
    rows = np.flatnonzero(moved)
    if moved[1:].all():
        return Sets(None, every)
    back = np.zeros(moved.size, dtype=np.intp)
    back[rows] = np.arange(1, rows.size + 1)
    return Sets(np.append(0, rows), back)


def of_ball(values: Array, ball: NDArray[np.intp]) -> Array:
    """Return the value of the ball of each shot, (..., shot), from those of balls (..., ball)."""
    if ball.ndim == 1:
        return values[..., ball]
    wide = np.broadcast_to(ball, (*values.shape[:-1], ball.shape[-1]))
    return np.take_along_axis(values, wide, axis=-1)


def shot_results(
    x: Constants,
    bat: BatProperties,
    balls: MeasuredBalls,
    readings: ImpactReadings,
    asked: ReductionSettings,
    flown: FlightModel | None = None,
    used: Mask | None = None,
) -> ShotResults:
    """Return e_A by Eq. (2) or by angular momentum, e by Eq. (6), BPF by Eq. (5).

    `flown` returns the flights by another instrument than that of the readings. `used` are the
    balls that define the mean of the lot, (..., ball); None: all.
    """
    from virtual_lab.measurement.reduction.shot_kernel import RESULTS, shots_of_sets

    if flown:
        flights = flown(x, drag_of(x, of_ball(balls.mass, readings.ball)))
    else:
        flights = _flights(x, balls, readings)
    cosine, swing_rate, counts, encoder = (np.asarray(each) for each in (1.0, 0.0, np.nan, 1.0))
    clock = readings.flights.clock(x)
    if readings.swing:
        turn = _turn(x, "swing")
        cosine = np.cos(turn * readings.swing.angle)
        swing_rate = turn * clock * readings.swing.rate
    if readings.recoil:
        counts, encoder = readings.recoil.rate, _turn(x, "encoder") * clock
    used = np.ones(balls.mass.shape[-1], dtype=bool) if used is None else used
    of_set = (
        asked.pivot_from_knob,
        asked.ball_speed,
        asked.window_speed,
        asked.turn_rate(bat.length),
        *(bat.mass, bat.length, bat.z_cm, bat.inertia_cm),
        x["impact.pivot.from_knob"],
        x.get("impact.cannon.along", 0.0),
        encoder,
        *(balls.slope, balls.speed),
        *(x.get(PLACE_SLOPE, 0.0), x.get(SLOPE_ERROR, 0.0)),
    )
    along = readings.along if "impact.cannon.along" in x else 0.0
    of_shot = (
        *(flights.speed_in, flights.speed_out, _sine_square(x, bat, flights)),
        *(readings.place, along, cosine, swing_rate, counts),
    )
    with np.errstate(all="ignore"):  # NaN: not seen
        found = shots_of_sets(
            PLACE_SLOPE in x,
            asked.reads == "recoil",
            asked.recoil == "free",
            *(_less_shots(each) for each in of_set),
            *(balls.mass, balls.restitution, used, readings.ball),
            *(_with_shots(each, readings.ball.shape[-1]) for each in of_shot),
        )
    return ShotResults(
        speed=flights.speed_in,
        swing_rate=np.broadcast_to(swing_rate, found[0].shape),
        rebound_speed=flights.speed_out,
        rebound_slope=flights.slope_out,
        **dict(zip(RESULTS, found, strict=True)),
    )


def _flights(x: Constants, balls: MeasuredBalls, readings: ImpactReadings) -> Flights:
    """Return the flights, computed only for sets that differ in a constant of the flight."""
    sets = _sets_of(x, AT_BAT, HELD)
    own = {name: sets.chosen(value) for name, value in x.items() if name.startswith(AT_BAT)}
    mass = of_ball(sets.chosen(balls.mass), readings.ball)
    flights = readings.flights.corrected(own, drag_of(own, mass))
    if sets.rows is None:
        return flights
    return Flights(
        speed_in=sets.spread(flights.speed_in),
        speed_out=sets.spread(flights.speed_out),
        offset=sets.spread(flights.offset),
        slope_in=sets.spread(flights.slope_in),
        slope_out=sets.spread(flights.slope_out),
    )


def _less_shots(values: Array | float) -> Array:
    """Return a constant, a number or (..., k, 1), without the axis of shots."""
    return np.asarray(values) if np.ndim(values) == 0 else np.asarray(values)[..., 0]


def _with_shots(values: Array | float, shots: int) -> Array:
    """Return values with an axis of so many shots, (..., shot)."""
    return np.broadcast_to(values, (*np.shape(values)[:-1], shots))


def recoil_factor(
    support: str, bat: BatProperties, mass: Array, place: Array, pivot_from_knob: float
) -> Array:
    """Return r of a ball of `mass` [kg] at `place` [m], the bat free or on its pivot."""
    if support == "free":
        free = recoil_factor_free(mass, bat.mass, bat.inertia_cm, place - bat.z_cm)
        return np.asarray(free)
    axis = bat.length - pivot_from_knob
    inertia = parallel_axis(bat.inertia_cm, bat.mass, axis - bat.z_cm)
    return np.asarray(recoil_factor_pivoted(mass, inertia, axis - place))


def drag_of(x: Constants, mass: Array) -> Array:
    """Return κ [1/m] of balls of `mass` [kg] in the hall's air."""
    return drag_rate(x["hall.air.density"], x["hall.air.drag_coefficient"], x["ball.radius"], mass)


def _turn(x: Constants, encoder: str) -> Array:
    """Return the angle of one count of an encoder [rad]."""
    return np.asarray(
        2 * np.pi / (x[f"impact.{encoder}.scale"] * x[f"impact.{encoder}.counts_per_turn"])
    )


def _sine_square(x: Constants, bat: BatProperties, flights: Flights) -> Array:
    """Return sin² of the contact angle: per shot if its height is measured, else the mean."""
    touching = (bat.barrel_radius + x["ball.radius"]) ** 2
    if "impact.aim.across_square" in x:
        return np.asarray(x["impact.aim.across_square"] / touching)
    return np.asarray((flights.offset - x["impact.pivot.height"]) ** 2 / touching)
