"""The algebra of the test: constants and readings to r, e_A, e, e0 and BPF.

Every function here broadcasts. A constant may be a number or a column of numbers (..., k, 1), a
reading is a row (..., n), and the result is (..., n) or (..., k, n). The uncertainty budget calls
the same functions with shifted constants. A block of laboratories has a leading axis for the
laboratory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from math import prod
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.measurement.reduction.flights import FlightModel, Flights
from virtual_lab.measurement.reduction.kinematics import (
    DETAILS,
    RESULTS,
    ShotConstants,
    compiled_reduction,
    parallel_axis,
    restitution_at_speed,
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
R = TypeVar("R", bound="SetResults")
# prefixes of the names of constants on which the flight of a ball depends
FLIGHT = ("bench.scale.", "hall.", "ball.radius")
# prefixes of all constants of a flight, including the instruments that time it
AT_WALL, AT_BAT = (*FLIGHT, "balls."), (*FLIGHT, "impact.")
ADDED = ("balls.restitution_", "balls.slope_")  # errors added to results of the flights
# prefixes of constants of the bat rig on which the flight of a ball does not depend
NOT_OF_FLIGHT = tuple(f"impact.{each}." for each in ("pivot", "encoder", "swing", "cannon", "aim"))
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
    """Measured balls, shape (..., ball). `restitution` is e0 at `speed`, as measured."""

    mass: Array
    restitution: Array
    speed: Array  # mean nominal speed of the wall hits, (..., 1) [m/s]
    slope: Array  # slope of e0 over speed, (..., 1) [s/m]
    # share of a ball's deviation from the mean of its lot that its best e0 keeps, see `kept_shares`
    kept: Array | float = 1.0

    aligned: ClassVar = EVERY_FIELD

    @property
    def best_restitution(self) -> Array:
        """Best estimate of the e0 of each ball at `speed`: drawn toward the mean of its lot."""
        mean = _mean_of(self.restitution, np.ones(self.restitution.shape, dtype=bool))
        return mean + self.kept * (self.restitution - mean)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetResults(AlignedArrays):
    """Results of each shot for every set of constants, shape (..., shot)."""

    position: Array  # impact position to which e_A refers, from the barrel tip [m]
    # e0 of the lot's mean ball at the nominal relative speed. All results named `lot_...` refer to
    # this ball and speed.
    lot_ball_restitution: Array
    lot_recoil_factor: Array  # recoil factor r with the support named by the procedure
    aimed_recoil_factor: Array  # lot_recoil_factor at the aimed position
    bat_performance_factor: Array
    lot_restitution: Array
    lot_collision_efficiency: Array
    rebound_efficiency: Array  # e_A from the ball's rebound; NaN: not detected
    recoil_efficiency: Array  # e_A from the bat's recoil; NaN: not recorded

    aligned: ClassVar = EVERY_FIELD


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotResults(SetResults):
    """All results of each shot, for the best values of the constants, shape (..., shot)."""

    speed: Array  # speed of the ball at the bat [m/s]
    rebound_speed: Array  # rebound speed of the ball along the line of fire [m/s]
    rebound_slope: Array  # height gained per meter of distance in the rebound [m/m]
    swing_rate: Array  # angular rate of a swung bat at contact; 0 for a bat at rest [rad/s]
    ball_mass: Array  # mass of the ball [kg]
    bat_speed: Array  # speed of the struck point toward the ball; 0 for a bat at rest [m/s]
    relative_speed: Array  # [m/s]
    recoil_rate: Array  # angular rate of a bat that was at rest, at the end of contact [rad/s]
    recoil_factor: Array  # recoil factor r with the support named by the procedure
    ball_restitution: Array  # best e0 of the ball at the relative speed of the shot
    # measured e0 of the ball at the speed to which the procedure's window for balls refers
    window_ball_restitution: Array
    collision_efficiency: Array  # e_A at `position`, corrected for the offset across the bat
    restitution: Array


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
    """Return mass, length, balance, inertia and barrel radius of bats [SI].

    The readings are corrected by the calibration. In the result, `z_cm` is the distance of the
    center of mass from the tip. `inertia_cm` is the moment of inertia about the center of mass.

    `x` holds bench readings and calibration constants, keyed by name. Its values are numbers, or
    arrays of any common shape. The results have the same shape.
    """
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
    """Return the inertia about the center of mass, from the period of bat and clamp together."""
    lever = length - x["bench.pendulum.pivot_from_knob"] - z_cm
    sets = _sets_of(x, ("bench.pendulum.amplitude_offset", "bat.first", "bat.last"), ())
    first, last, offset = (
        sets.select(x[name])
        for name in ("bat.first_amplitude", "bat.last_amplitude", "bench.pendulum.amplitude_offset")
    )
    swings = int(x["bat.swings"].flat[0])
    longer = mean_amplitude_factor(first, last, swings)
    longer = longer / mean_amplitude_factor(first - offset, last - offset, swings)
    period = x["bat.period"] / x["bench.pendulum.clock"] * sets.expand(longer)
    moment = mass * lever + x["bench.pendulum.clamp_moment"]
    total = inertia_from_period(period, moment, x["hall.gravity"])
    return total - x["bench.pendulum.clamp_inertia"] - parallel_axis(0.0, mass, lever)


def ball_masses(x: Constants, readings: BallReadings) -> Array:
    """Return the masses of the balls [kg], (..., ball), corrected by the scale's calibration.

    `x` holds the calibration constants, keyed by name.
    """
    return (readings.mass - x["bench.scale.zero"]) / x["bench.scale.span"]


def measured_balls(x: Constants, readings: BallReadings) -> MeasuredBalls:
    """Return the measured mass and ball-wall restitution e0 of each ball.

    The result has the masses [kg] and the e0 (field `restitution`) of the balls, (..., ball). An e0
    is the mean of the ball's hits at the wall, converted to the mean nominal speed of all hits. The
    fields `speed` and `slope` are this speed [m/s] and the slope of e0 over speed [s/m]. They have
    the shape (..., 1), or are single numbers if the constants are single numbers.
    `x` holds the readings of the bench and the calibration constants, keyed by name.
    """
    from virtual_lab.measurement.reduction.wall_kernel import balls_of_sets

    mass = ball_masses(x, readings)
    sets = _sets_of(x, AT_WALL, ADDED)
    at_wall = {name: sets.select(value) for name, value in x.items() if name.startswith(AT_WALL)}
    drag = of_ball(drag_of(at_wall, sets.select(mass)), np.maximum(readings.ball, 0))
    flights = readings.flights.correct(at_wall, drag)
    with np.errstate(all="ignore"):  # the slope is NaN for a single nominal speed
        means, faster, nominal, slope = balls_of_sets(
            readings.mass,
            readings.ball,
            readings.nominal_speed,
            flights.speed_in,
            flights.speed_out,
        )
    speed = nominal[..., :1, None] if nominal.ndim else nominal
    slopes = x["ball.restitution_slope"]
    if SLOPE_REPEATABILITY in x:
        slopes = sets.expand(slope[..., None]) + x[SLOPE_REPEATABILITY]
    errors = (np.atleast_1d(x[error]) for error in restitution_names(mass.shape[-1]))
    scattered = np.concatenate(np.broadcast_arrays(*errors), axis=-1)
    restitution = sets.expand(means) - slopes * sets.expand(faster) + scattered
    return MeasuredBalls(
        mass=np.broadcast_to(mass, restitution.shape),
        restitution=restitution,
        speed=speed,
        slope=np.asarray(slopes),
        kept=readings.kept,
    )


def kept_shares(restitution: Array, u: Array) -> Array:
    """Return the share of each ball's deviation from the mean of its lot that its best e0 keeps.

    The rules set balls aside by their measured e0, so the errors of the admitted balls are not zero
    on average. A ball's e0 is therefore drawn toward the mean of all balls of its lot, by the share
    of their variance that is due to errors, u² / s². The error of a drawn e0 does not depend on
    whether its ball is set aside. The estimate with the least mean square error of single balls
    (Efron and Morris 1973) has n - 3 instead of the n - 1 of s². It draws too little for the mean
    of the admitted balls.

    Parameters
    ----------
    restitution, u
        Measured e0 of the balls of a lot, and its standard uncertainty by repeatability,
        (..., ball).
    """
    number, every = restitution.shape[-1], np.ones(restitution.shape, dtype=bool)
    square = number * _mean_of((restitution - _mean_of(restitution, every)) ** 2, every)
    spread = square > 0
    drawn = (number - 1) * u**2 / np.where(spread, square, 1.0)
    return np.where(spread, np.maximum(1 - drawn, 0.0), 1.0)


class Sets(NamedTuple):
    """The different sets of constants among all k sets (..., k, 1)."""

    rows: NDArray[np.intp] | None  # indices of the selected sets; None: all
    inverse: NDArray[np.intp]  # row of each of the k sets in `rows`

    def select(self, values: Array) -> Array:
        """Return the values for the selected sets only."""
        if self.rows is None or np.ndim(values) < 2:
            return values
        if is_broadcast(values):
            return values[..., : self.rows.size, :]
        return np.take(values, self.rows, axis=-2)

    def expand(self, values: Array) -> Array:
        """Return the values for all sets, (..., k, n), from the values for the selected sets."""
        return values if self.rows is None else np.take(values, self.inverse, axis=-2)


def is_broadcast(values: Array) -> bool:
    """Return whether k sets of constants share the same values in memory.

    `values` is an array (..., k, 1), and only its axis of length k is tested. The result is True if
    NumPy repeats one stored value along this axis. Equal values that are stored separately give
    False.
    """
    return values.strides[-2] == 0


def _sets_of(x: Constants, names: tuple[str, ...], others: tuple[str, ...]) -> Sets:
    """Return the sets of constants that differ in at least one relevant constant.

    A constant is relevant if its name begins with one of `names` but with none of `others`.
    """
    every = np.zeros(0, dtype=np.intp)
    arrays = [
        value
        for name, value in x.items()
        if name.startswith(names) and not name.startswith(others) and np.ndim(value) > 1
    ]
    number = max((value.shape[-2] for value in arrays), default=1)
    if number == 1:
        return Sets(None, every)
    mask = np.zeros(number, dtype=bool)
    for value in arrays:
        if is_broadcast(value):
            continue
        differs = value != value[..., :1, :]
        mask |= differs.any(axis=(*range(value.ndim - 2), value.ndim - 1))
    rows = np.flatnonzero(mask)
    if mask[1:].all():
        return Sets(None, every)
    inverse = np.zeros(mask.size, dtype=np.intp)
    inverse[rows] = np.arange(1, rows.size + 1)
    return Sets(np.append(0, rows), inverse)


def of_ball(values: Array, ball: NDArray[np.intp]) -> Array:
    """Return the value of each shot's ball, (..., shot).

    `values` are the values of the balls, (..., ball). `ball` is the index of each shot's ball,
    (shot,) or (..., shot).
    """
    if ball.ndim == 1:
        return values[..., ball]
    indices = np.broadcast_to(ball, (*values.shape[:-1], ball.shape[-1]))
    return np.take_along_axis(values, indices, axis=-1)


def shot_results(
    kind: type[R],
    x: Constants,
    bat: BatProperties,
    balls: MeasuredBalls,
    readings: ImpactReadings,
    settings: ReductionSettings,
    flight_model: FlightModel | None = None,
    used: Mask | None = None,
) -> R:
    """Return the results of the shots, computed by `kinematics.reduce_shot`, (..., shot) [SI].

    Parameters
    ----------
    kind
        Type of the results: `ShotResults` for all results, or `SetResults` for a part of them.
        `SetResults` saves time and memory if `x` holds many sets of constants.
    x, bat, balls
        Calibration constants, and the properties of bat and balls measured with these constants.
    readings, settings
        Readings of the shots, and the settings of the procedure.
    flight_model
        Function that returns the flights measured by another instrument. By default the flights of
        `readings` are used.
    used
        Mask of the balls whose mean is the mean ball of the lot, (..., ball). By default all balls
        are used.
    """
    if flight_model:
        flights = flight_model(x, drag_of(x, of_ball(balls.mass, readings.ball)))
    else:
        flights = _flights(x, balls, readings)
    cosine, swing_rate, counts, encoder = (np.asarray(each) for each in (1.0, 0.0, np.nan, 1.0))
    clock = readings.flights.clock(x)
    if readings.swing:
        turn = _angle_per_count(x, "swing")
        cosine = np.cos(turn * readings.swing.angle)
        swing_rate = turn * clock * readings.swing.rate
    if readings.recoil:
        counts, encoder = readings.recoil.rate, _angle_per_count(x, "encoder") * clock
    used = np.ones(balls.mass.shape[-1], dtype=bool) if used is None else used
    best = balls.best_restitution
    constants = ShotConstants(
        **{name: getattr(bat, name) for name in ("mass", "length", "z_cm", "inertia_cm")},
        turn_rate=settings.turn_rate(bat.length),
        pivot_from_knob=x["impact.pivot.from_knob"],
        aim=x.get("impact.cannon.along", 0.0),
        encoder=encoder,
        lot_mass=_mean_of(balls.mass, used),
        lot_restitution=_mean_of(best, used),
        speed=balls.speed,
        slope=balls.slope,
        place_slope=x.get(PLACE_SLOPE, 0.0),
        slope_error=x.get(SLOPE_ERROR, 0.0),
    )
    shots = (
        *(flights.speed_in, flights.speed_out, _sine_square(x, bat, flights), readings.position),
        *(readings.along if "impact.cannon.along" in x else 0.0, cosine, swing_rate, counts),
    )
    values = (*constants, *shots, readings.ball)
    shape = np.broadcast_shapes(*(np.shape(each)[:-1] for each in values))
    block = (prod(shape[:-1]), prod(shape[-1:]))
    number = readings.ball.shape[-1]

    def wide(each: Any, many: int) -> NDArray[Any]:
        whole = (*shape, many)  # `broadcast_to` takes microseconds, even if it has nothing to do
        every = each if np.shape(each) == whole else np.broadcast_to(each, whole)
        return every.reshape(*block, many)

    names = [each.name for each in fields(kind)]
    detailed = set(DETAILS) <= set(names)
    results = np.empty((len(RESULTS), *block, number))
    details = np.empty((len(DETAILS), *block, number) if detailed else (0, 0, 0, 0))
    compiled_reduction()(
        (
            *(PLACE_SLOPE in x, settings.reads == "recoil", settings.recoil == "free"),
            *(settings.pivot_from_knob, settings.ball_speed),
        ),
        tuple(wide(each, 1) for each in constants),
        tuple(wide(each, balls.mass.shape[-1]) for each in (balls.mass, best)),
        wide(readings.ball, number),
        tuple(wide(each, number) for each in shots),
        (results, details),
    )
    filled = zip(RESULTS + DETAILS, (*results, *details), strict=False)  # perhaps no details
    columns = {name: column.reshape(*shape, number) for name, column in filled}
    columns["speed"], columns["rebound_speed"] = flights.speed_in, flights.speed_out
    columns["rebound_slope"] = flights.slope_out
    # the rules judge a ball by its measured e0
    faster = settings.window_speed - balls.speed
    at_window = restitution_at_speed(balls.restitution, balls.slope, faster)
    columns["window_ball_restitution"] = of_ball(np.asarray(at_window), readings.ball)
    columns["swing_rate"] = np.broadcast_to(swing_rate, (*shape, number))
    return kind(**{name: columns[name] for name in names})


def _mean_of(values: Array, mask: Mask) -> Array:
    """Return the mean over the used balls, (..., 1), NaN without one.

    The balls are added one after another, so the last bits do not depend on the array's layout.
    """
    used_values = np.where(mask, values, 0.0)
    total = sum(used_values[..., ball, None] for ball in range(used_values.shape[-1]))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / np.sum(mask, axis=-1, keepdims=True))


def _flights(x: Constants, balls: MeasuredBalls, readings: ImpactReadings) -> Flights:
    """Return the flights, computed only for sets that differ in a constant of the flight."""
    sets = _sets_of(x, AT_BAT, NOT_OF_FLIGHT)
    at_bat = {name: sets.select(value) for name, value in x.items() if name.startswith(AT_BAT)}
    mass = of_ball(sets.select(balls.mass), readings.ball)
    flights = readings.flights.correct(at_bat, drag_of(at_bat, mass))
    if sets.rows is None:
        return flights
    names = [each.name for each in fields(Flights)]
    return Flights(**{name: sets.expand(getattr(flights, name)) for name in names})


def drag_of(x: Constants, mass: Array) -> Array:
    """Return the drag rate κ of balls in the air of the hall [1/m].

    κ is the relative loss of speed per meter of flight. `x` are the constants keyed by name. `mass`
    is the mass of the balls [kg]. The shape of the result is the broadcast shape of the constants
    and the mass.
    """
    return drag_rate(x["hall.air.density"], x["hall.air.drag_coefficient"], x["ball.radius"], mass)


def _angle_per_count(x: Constants, encoder: str) -> Array:
    """Return the angle of one count of an encoder [rad]."""
    scale, counts = x[f"impact.{encoder}.scale"], x[f"impact.{encoder}.counts_per_turn"]
    return np.asarray(2 * np.pi / (scale * counts))


def _sine_square(x: Constants, bat: BatProperties, flights: Flights) -> Array:
    """Return sin² of the contact angle, per shot if its height is measured, otherwise the mean."""
    touching = (bat.barrel_radius + x["ball.radius"]) ** 2
    if "impact.aim.across_square" in x:
        return np.asarray(x["impact.aim.across_square"] / touching)
    return np.asarray((flights.offset - x["impact.pivot.height"]) ** 2 / touching)
