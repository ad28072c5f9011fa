"""Results for Sec. V: procedures, proposed and in use, from the bats' exact curves."""

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
    profiled,
    recoil,
    rules,
    top,
    top_of,
)
from virtual_lab.units import INCH, MPH, Array

PLACES = np.arange(3.0, 9.01, 0.25)
PITCH, LIMIT = 70.0, 0.228  # pitch speed [mph], limit of e_A


def proposed(bat: str, n: float) -> float:
    """Return the largest v_f predicted from e_A of a bat at rest, minus that in the field [mph]."""
    e_A = peak_of(bat, PLACES, speed=160.0).collision_efficiency
    found = top_of(PLACES, e_A, 90.0, nominal(bat, PLACES, n))
    return found.value - top(bat, "v_f_mph", n).value


def ends() -> float:
    """Return the least distance of a peak of v_f from the ends of the range scanned [in]."""
    places = [top(bat, "v_f_mph", n).place for bat in BATS for n in (0.0, 0.5)]
    return min(min(place - float(PLACES[0]), float(PLACES[-1]) - place) for place in places)


def _factor(bat: str) -> float:
    """Return the BPF of the ASTM method: pivoted, 60 mph, at the centre of percussion."""
    place = np.array([centre_of_percussion_in(bat)])
    e_A = peak_of(bat, place, held="pivoted", speed=60.0, with_ball=BALL).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(bat, place, "pivoted")))
    return float(e[0]) / float(paper_ball(BALL).restitution.at(60 * MPH))


def by_recoil() -> float:
    """Return the difference of v_f from a pivoted bat's recoil and from the ball [v_ball]."""
    bat = model(WOOD, "pivoted")
    z, own = centre_of_percussion_in(WOOD), beam(WOOD)
    found = peak_of(bat, [z], speed=60.0, with_ball=BALL)
    axis = own.length - 6 * INCH
    turn = float(bat.modes.rotation(axis)[0])  # rotation of the only rigid mode, per unit velocity
    omega = abs(turn * float(found.modal_velocities[0, 0]))
    back = rebound_speed_from_recoil(
        own.inertia(axis), omega, paper_ball(BALL).mass, axis - z * INCH, 60 * MPH
    )
    return abs(float(back) / (60 * MPH) - float(found.collision_efficiency[0]))


def reaction(off: float) -> float:
    """Return the impulse on the pivot of a rigid R161 relative to that on the barrel.

    The impact is `off` [in] from the centre of percussion.
    """
    own, z = beam(WOOD), centre_of_percussion_in(WOOD) + off
    axis = own.length - 6 * INCH
    arm = axis - z * INCH
    return abs(1 - own.mass * (axis - own.z_cm) * arm / own.inertia(axis))


def swung(place: float | Array, length: float) -> Array:
    """Return the bat's speed of the NCAA method, about the pivot of its rig [mph]."""
    pivot = (length - rules("ncaa-modified").pivot_from_knob) / INCH
    return np.asarray(66.0 * (pivot - np.asarray(place)) / (pivot - 6.0))


def _ncaa(bat: str) -> float:
    """Return the greatest v_f of the NCAA's own speeds [mph]."""
    speeds = swung(PLACES, beam(bat).length)
    e_A = peak_of(bat, PLACES, speed=PITCH + speeds, with_ball=BALL).collision_efficiency
    return top_of(PLACES, e_A, PITCH, speeds).value


def exponent_of_mass() -> float:
    field = rules("asa").game
    return field.exponent if field and field.scales_with == "mass" else np.nan


def at_limit(place: float) -> float:
    """Return v_f of a bat of e_A = 0.228 struck at a place [mph]."""
    return float(batted_speed(LIMIT, PITCH, swung(place, beam(WOOD).length)))


def besr_at_limit(place: float) -> float:
    """Return BESR of a bat of v_f = 97 mph struck at a place."""
    e_A = collision_efficiency(PITCH, swung(place, beam(WOOD).length), 97.0)
    return float(besr(e_A))


def below_field(speed: float) -> float:
    """Return the field's v_rel less a speed [mph]."""
    return 90 + float(nominal(WOOD, top(WOOD, "v_f_mph").place)) - speed


def off_percussion() -> float:
    """Return the largest distance of the peak of v_f from the COP, of the four bats [in]."""
    return max(abs(centre_of_percussion_in(bat) - top(bat, "v_f_mph").place) for bat in BATS)


def lighter_is_faster(light: str, heavy: str, swing: float | None) -> float:
    """Return the relative excess of the bat speed of one bat over another [%]."""
    speeds = [float(profiled(bat)[swing].table["v_bat_mph"][0]) for bat in (light, heavy)]
    return 100 * (speeds[0] / speeds[1] - 1)


def swing_matters() -> float:
    """Return the change of the proposal's v_f of EA70 as n goes from 0 to 0.5 [mph]."""
    return top(ALUMINIUM, "v_f_mph", 0.5).value - top(ALUMINIUM, "v_f_mph", 0.0).value


def metrics_alike() -> float:
    return abs(_ncaa(ALUMINIUM) / _ncaa(WOOD) - 1) * 100


def ncaa_lead(first: str, second: str) -> float:
    return _ncaa(first) - _ncaa(second)


def factor_lead(first: str, second: str) -> float:
    return _factor(first) - _factor(second)


def efficiency_of_besr(value: float) -> float:
    return value - (float(besr(LIMIT)) - LIMIT)


def rule(procedure: str, name: str, unit: str = "1") -> float:
    """Return a number of a procedure, NaN if it has none."""
    unit_si = {"mph": MPH, "in": INCH, "1": 1.0}[unit]
    return (getattr(rules(procedure), name) or np.nan) / unit_si
