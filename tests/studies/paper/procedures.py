"""Results for Sec. V: proposed and existing procedures, from the exact curves of the bats."""

from __future__ import annotations

import numpy as np

from tests.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BATS,
    WOOD,
    beam,
    centre_of_percussion_in,
    collide_at,
    game_bat_speed,
    model,
    paper_ball,
    peak_speed,
    profiles_by_swing,
    recoil,
    rules,
    top,
)
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    besr,
    collision_efficiency,
    rebound_speed_from_recoil,
    restitution_from_efficiency,
)
from virtual_lab.units import INCH, MPH, Array

PLACES = np.arange(3.0, 9.01, 0.25)
PITCH, LIMIT = 70.0, 0.228  # pitch speed [mph], and limit of e_A


def rest_prediction_error(bat: str, n: float) -> float:
    """Return the error of a peak batted-ball speed [mph] predicted from a test of the bat at rest.

    In the test, a free bat is hit at 160 mph at positions 3 to 9 in from the tip. The prediction
    uses the collision efficiency measured in this test. The error is the predicted minus the true
    peak speed. `n` is the swing exponent, 0 to 0.5 in steps of 0.1. Raises `KeyError` for another
    exponent, and `InputError` for an unknown bat.
    """
    e_A = collide_at(bat, PLACES, speed=160.0).collision_efficiency
    highest = peak_speed(PLACES, e_A, 90.0, game_bat_speed(bat, PLACES, n))
    return highest.value - top(bat, "batted_speed_mph", n).value


def distance_to_end() -> float:
    """Return the smallest distance [in] between a peak of v_f and an end of the scan.

    v_f is the batted-ball speed. The scan covers 3 to 9 in from the tip. The result is negative if
    a peak is outside. The peaks of the paper's four bats are used, for the swing exponents 0 and
    0.5.
    """
    places = [top(bat, "batted_speed_mph", n).place for bat in BATS for n in (0.0, 0.5)]
    return min(min(place - float(PLACES[0]), float(PLACES[-1]) - place) for place in places)


def _factor(bat: str) -> float:
    """Return the bat performance factor (BPF) of a bat by the ASTM method.

    The bat is pivoted and is hit at its center of percussion, at 60 mph.
    """
    place = np.array([centre_of_percussion_in(bat)])
    e_A = collide_at(
        bat, place, support_name="pivoted", speed=60.0, with_ball=BALL
    ).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(bat, place, "pivoted")))
    return float(e[0]) / float(paper_ball(BALL).restitution.at(60 * MPH))


def recoil_rebound_difference() -> float:
    """Return the absolute difference between e_A by the bat's recoil and e_A by the rebound speed.

    e_A is the collision efficiency. R161 is pivoted 6 in from the knob and is hit at its center of
    percussion, at 60 mph.
    """
    bat = model(WOOD, "pivoted")
    z, bat_beam = centre_of_percussion_in(WOOD), beam(WOOD)
    collision = collide_at(bat, [z], speed=60.0, with_ball=BALL)
    axis = bat_beam.length - 6 * INCH
    turn = float(bat.modes.rotation(axis)[0])  # rotation of the only rigid mode per unit velocity
    omega = abs(turn * float(collision.modal_velocities[0, 0]))
    back = rebound_speed_from_recoil(
        bat_beam.inertia(axis), omega, paper_ball(BALL).mass, axis - z * INCH, 60 * MPH
    )
    return abs(float(back) / (60 * MPH) - float(collision.collision_efficiency[0]))


def reaction(distance: float) -> float:
    """Return the absolute impulse on the pivot divided by the impulse of the ball, for rigid R161.

    The pivot is 6 in from the knob. The ball hits the bat `distance` [in] from the center of
    percussion; a positive distance is toward the handle.
    """
    bat_beam, z = beam(WOOD), centre_of_percussion_in(WOOD) + distance
    axis = bat_beam.length - 6 * INCH
    arm = axis - z * INCH
    return abs(1 - bat_beam.mass * (axis - bat_beam.z_cm) * arm / bat_beam.inertia(axis))


def ncaa_bat_speed(place: float | Array, length: float) -> Array:
    """Return the bat speed in the NCAA rig [mph] at one or more positions, in the shape of `place`.

    The speed is 66 mph at 6 in from the tip. It is proportional to the distance from the pivot.

    Parameters
    ----------
    place
        Distance from the tip [in].
    length
        Length of the bat [m].
    """
    pivot = (length - rules("ncaa-modified").pivot_from_knob) / INCH
    return np.asarray(66.0 * (pivot - np.asarray(place)) / (pivot - 6.0))


def _ncaa(bat: str) -> float:
    """Return the peak batted-ball speed of a bat at the speeds of the NCAA method [mph]."""
    speeds = ncaa_bat_speed(PLACES, beam(bat).length)
    e_A = collide_at(bat, PLACES, speed=PITCH + speeds, with_ball=BALL).collision_efficiency
    return peak_speed(PLACES, e_A, PITCH, speeds).value


def exponent_of_mass() -> float:
    """Return the exponent n of the swing law of the procedure ``asa``, dimensionless.

    The bat speed in the game is proportional to (1 / mass of the bat)^n. The result is NaN if the
    procedure has no swing law, or a law in terms of the moment of inertia.
    """
    field = rules("asa").game
    return field.exponent if field and field.scales_with == "mass" else np.nan


def speed_at_limit(place: float) -> float:
    """Return the batted-ball speed [mph] in the NCAA rig for a bat with e_A = 0.228.

    `place` is the distance of the impact from the tip [in]. The pitch speed of the rig is 70 mph.
    The bat has the length of R161, the wood bat of the paper.
    """
    return float(batted_speed(LIMIT, PITCH, ncaa_bat_speed(place, beam(WOOD).length)))


def besr_at_limit(place: float) -> float:
    """Return the ball exit speed ratio (BESR) at a batted-ball speed of 97 mph in the NCAA rig.

    `place` is the distance of the impact from the tip [in]. The pitch speed of the rig is 70 mph.
    The bat has the length of R161, the wood bat of the paper.
    """
    e_A = collision_efficiency(PITCH, ncaa_bat_speed(place, beam(WOOD).length), 97.0)
    return float(besr(e_A))


def field_speed_excess(speed: float) -> float:
    """Return the relative speed of ball and bat in the field minus the test speed `speed` [mph].

    The bat is R161, hit at the position of its peak batted-ball speed. The pitch speed is 90 mph,
    and the swing exponent is 0.
    """
    return 90 + float(game_bat_speed(WOOD, top(WOOD, "batted_speed_mph").place)) - speed


def distance_to_percussion() -> float:
    """Return the largest distance [in] between the peak of v_f and the center of percussion.

    v_f is the batted-ball speed. The distance is computed for the paper's four bats, with swing
    exponent 0. The center of percussion is computed for a pivot 6 in from the knob.
    """
    return max(
        abs(centre_of_percussion_in(bat) - top(bat, "batted_speed_mph").place) for bat in BATS
    )


def light_bat_gain(light: str, heavy: str, swing: float | None) -> float:
    """Return the bat speed of a light bat minus that of a heavy bat [% of the heavy bat's speed].

    The result is positive if the light bat is faster. The speeds are computed at 0.5 in from the
    tip, under standard game conditions. `swing` is the exponent n of the swing law, 0 to 0.5 in
    steps of 0.1, or None for a swing of constant energy. Raises `KeyError` for another exponent,
    and `InputError` for an unknown bat.
    """
    speeds = [
        float(profiles_by_swing(bat)[swing].table["bat_speed_mph"][0]) for bat in (light, heavy)
    ]
    return 100 * (speeds[0] / speeds[1] - 1)


def swing_exponent_effect() -> float:
    """Return the change of the peak batted-ball speed v_f due to the swing exponent [mph].

    The bat is EA70, the paper's aluminum bat. The peak is the largest value along the bat under
    standard game conditions. The bat speed is proportional to I^-n, where I is the moment of
    inertia and n the swing exponent. The result is the peak for n = 0.5 minus the peak for n = 0.
    """
    return (
        top(ALUMINIUM, "batted_speed_mph", 0.5).value
        - top(ALUMINIUM, "batted_speed_mph", 0.0).value
    )


def ncaa_metric_difference() -> float:
    """Return the size of the difference of the NCAA metric between EA70 and R161 [% of R161].

    EA70 is the aluminum bat of the paper, and R161 the wood bat. The NCAA metric is the peak
    batted-ball speed at the speeds of the NCAA rig. The result is never negative.
    """
    return abs(_ncaa(ALUMINIUM) / _ncaa(WOOD) - 1) * 100


def ncaa_lead(first: str, second: str) -> float:
    """Return the NCAA metric of the first bat minus the NCAA metric of the second bat [mph].

    The NCAA metric is the peak batted-ball speed at the speeds of the NCAA rig. Raises `InputError`
    for an unknown bat.
    """
    return _ncaa(first) - _ncaa(second)


def factor_lead(first: str, second: str) -> float:
    """Return the bat performance factor (BPF) of the first bat minus the BPF of the second bat.

    Each bat is pivoted 6 in from the knob and hit at its center of percussion, at 60 mph. Raises
    `InputError` for an unknown bat.
    """
    return _factor(first) - _factor(second)


def efficiency_of_besr(value: float) -> float:
    """Return the collision efficiency e_A = BESR - 0.5, where BESR is `value`."""
    return value - (float(besr(LIMIT)) - LIMIT)


def rule_value(procedure: str, name: str, unit: str = "1") -> float:
    """Return a number of a procedure by its name, converted to a unit.

    `name` is an attribute of `Procedure`. `unit` is mph or in, or 1 for a dimensionless number. The
    result is NaN if the procedure states None or 0. Raises `InputError` for an unknown procedure,
    `AttributeError` for an unknown name, and `KeyError` for another unit.
    """
    unit_si = {"mph": MPH, "in": INCH, "1": 1.0}[unit]
    return (getattr(rules(procedure), name) or np.nan) / unit_si
