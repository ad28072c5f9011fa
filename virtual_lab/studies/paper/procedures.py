"""Results for Sec. V: proposed and existing procedures, from the exact curves of the bats."""

from __future__ import annotations

import numpy as np

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    besr,
    collision_efficiency,
    rebound_speed_from_recoil,
    restitution_from_efficiency,
)
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BATS,
    WOOD,
    beam,
    centre_of_percussion_in,
    model,
    nominal,
    paper_ball,
    peak_of,
    profiles_by_swing,
    recoil,
    rules,
    top,
    top_of,
)
from virtual_lab.units import INCH, MPH, Array

PLACES = np.arange(3.0, 9.01, 0.25)
PITCH, LIMIT = 70.0, 0.228  # pitch speed [mph], and limit of e_A


def rest_prediction_error(bat: str, n: float) -> float:
    """Return the peak v_f predicted from e_A of a bat at rest, minus the true peak v_f [mph]."""
    e_A = peak_of(bat, PLACES, speed=160.0).collision_efficiency
    highest = top_of(PLACES, e_A, 90.0, nominal(bat, PLACES, n))
    return highest.value - top(bat, "v_f_mph", n).value


def ends() -> float:
    """Return the smallest distance of a peak of v_f from an end of the scanned range [in]."""
    places = [top(bat, "v_f_mph", n).place for bat in BATS for n in (0.0, 0.5)]
    return min(min(place - float(PLACES[0]), float(PLACES[-1]) - place) for place in places)


def _factor(bat: str) -> float:
    """Return the BPF of the ASTM method: pivoted, 60 mph, at the centre of percussion."""
    place = np.array([centre_of_percussion_in(bat)])
    e_A = peak_of(
        bat, place, support_name="pivoted", speed=60.0, with_ball=BALL
    ).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(bat, place, "pivoted")))
    return float(e[0]) / float(paper_ball(BALL).restitution.at(60 * MPH))


def by_recoil() -> float:
    """Return the deviation of e_A by the recoil of a pivoted bat from e_A by the ball."""
    bat = model(WOOD, "pivoted")
    z, bat_beam = centre_of_percussion_in(WOOD), beam(WOOD)
    collision = peak_of(bat, [z], speed=60.0, with_ball=BALL)
    axis = bat_beam.length - 6 * INCH
    turn = float(bat.modes.rotation(axis)[0])  # rotation of the only rigid mode, per unit velocity
    omega = abs(turn * float(collision.modal_velocities[0, 0]))
    back = rebound_speed_from_recoil(
        bat_beam.inertia(axis), omega, paper_ball(BALL).mass, axis - z * INCH, 60 * MPH
    )
    return abs(float(back) / (60 * MPH) - float(collision.collision_efficiency[0]))


def reaction(distance: float) -> float:
    """Return the ratio of the impulses on pivot and barrel for a rigid R161.

    The impact is at `distance` [in] from the centre of percussion.
    """
    bat_beam, z = beam(WOOD), centre_of_percussion_in(WOOD) + distance
    axis = bat_beam.length - 6 * INCH
    arm = axis - z * INCH
    return abs(1 - bat_beam.mass * (axis - bat_beam.z_cm) * arm / bat_beam.inertia(axis))


def ncaa_bat_speed(place: float | Array, length: float) -> Array:
    """Return the bat speed at `place` [in] in the NCAA rig, for a bat of `length` [m], in mph."""
    pivot = (length - rules("ncaa-modified").pivot_from_knob) / INCH
    return np.asarray(66.0 * (pivot - np.asarray(place)) / (pivot - 6.0))


def _ncaa(bat: str) -> float:
    """Return the peak v_f at the speeds of the NCAA method [mph]."""
    speeds = ncaa_bat_speed(PLACES, beam(bat).length)
    e_A = peak_of(bat, PLACES, speed=PITCH + speeds, with_ball=BALL).collision_efficiency
    return top_of(PLACES, e_A, PITCH, speeds).value


def exponent_of_mass() -> float:
    """Return the exponent of asa's bat speed over the mass; NaN if it is over the inertia."""
    field = rules("asa").game
    return field.exponent if field and field.scales_with == "mass" else np.nan


def at_limit(place: float) -> float:
    """Return v_f [mph] of a bat with e_A = 0.228 at impact position `place` [in]."""
    return float(batted_speed(LIMIT, PITCH, ncaa_bat_speed(place, beam(WOOD).length)))


def besr_at_limit(place: float) -> float:
    """Return the BESR of a bat with v_f = 97 mph at impact position `place` [in]."""
    e_A = collision_efficiency(PITCH, ncaa_bat_speed(place, beam(WOOD).length), 97.0)
    return float(besr(e_A))


def below_field(speed: float) -> float:
    """Return the relative speed in the field minus `speed` [mph]."""
    return 90 + float(nominal(WOOD, top(WOOD, "v_f_mph").place)) - speed


def off_percussion() -> float:
    """Return the largest distance between peak of v_f and COP among the four bats [in]."""
    return max(abs(centre_of_percussion_in(bat) - top(bat, "v_f_mph").place) for bat in BATS)


def lighter_is_faster(light: str, heavy: str, swing: float | None) -> float:
    """Return the relative excess of the bat speed of one bat over another [%]."""
    speeds = [float(profiles_by_swing(bat)[swing].table["v_bat_mph"][0]) for bat in (light, heavy)]
    return 100 * (speeds[0] / speeds[1] - 1)


def swing_matters() -> float:
    """Return the change of the proposal's v_f of EA70 as n goes from 0 to 0.5 [mph]."""
    return top(ALUMINIUM, "v_f_mph", 0.5).value - top(ALUMINIUM, "v_f_mph", 0.0).value


def metrics_alike() -> float:
    """Return the relative difference of the NCAA metric between EA70 and R161 [%]."""
    return abs(_ncaa(ALUMINIUM) / _ncaa(WOOD) - 1) * 100


def ncaa_lead(first: str, second: str) -> float:
    """Return the NCAA metric of the first bat minus that of the second."""
    return _ncaa(first) - _ncaa(second)


def factor_lead(first: str, second: str) -> float:
    """Return the BPF of the first bat minus that of the second."""
    return _factor(first) - _factor(second)


def efficiency_of_besr(value: float) -> float:
    """Return the e_A that corresponds to a value of BESR."""
    return value - (float(besr(LIMIT)) - LIMIT)


def rule(procedure: str, name: str, unit: str = "1") -> float:
    """Return a number of a procedure, NaN if it has none."""
    unit_si = {"mph": MPH, "in": INCH, "1": 1.0}[unit]
    return (getattr(rules(procedure), name) or np.nan) / unit_si
