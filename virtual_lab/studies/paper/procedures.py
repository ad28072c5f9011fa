"""Claims of Sec. V: the proposed procedure, and the four in use, by the bats' exact curves."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    besr,
    collision_efficiency,
    rebound_speed_from_recoil,
    restitution_from_efficiency,
)
from virtual_lab.studies.paper.claim import Claim, about, at_least, at_most
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BARREL,
    BATS,
    KNOB,
    WOOD,
    beam,
    centre_of_percussion_in,
    lead,
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
from virtual_lab.units import INCH, MPH

__all__ = ["CLAIMS"]

Array = NDArray[np.float64]
STATED = "as stated in our data"
PLACES = np.arange(3.0, 9.01, 0.25)
PITCH, SWUNG, LIMIT = 70.0, 66.0, 0.228  # mph, mph at 6 in, e_A
MODIFIED = 97.0  # mph


def _proposed(bat: str, n: float) -> float:
    """Return the greatest v_f predicted from e_A at one speed, a bat at rest, less the field's."""
    e_A = peak_of(bat, PLACES, speed=160.0).collision_efficiency
    found = top_of(PLACES, e_A, 90.0, nominal(bat, PLACES, n))
    return found.value - top(bat, "v_f_mph", n).value


def _ends() -> float:
    """Return the least distance of a peak of v_f from the ends of the range scanned [in]."""
    places = [top(bat, "v_f_mph", n).place for bat in BATS for n in (0.0, 0.5)]
    return min(min(place - float(PLACES[0]), float(PLACES[-1]) - place) for place in places)


def _factor(bat: str) -> float:
    """Return the BPF of the ASTM method: pivoted, 60 mph, at the centre of percussion."""
    place = np.array([centre_of_percussion_in(bat)])
    e_A = peak_of(bat, place, held="pivoted", speed=60.0, with_ball=BALL).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(bat, place, "pivoted")))
    return float(e[0]) / float(paper_ball(BALL).restitution.at(60 * MPH))


def _by_recoil() -> float:
    """Return v_f by the recoil of a pivoted bat less that of the ball, over v_ball."""
    bat = model(WOOD, "pivoted")
    z, own = centre_of_percussion_in(WOOD), beam(WOOD)
    found = peak_of(bat, [z], speed=60.0, with_ball=BALL)
    axis = own.length - 6 * INCH
    turn = float(bat.modes.rotation(axis)[0])  # of the only rigid mode, unit modal velocity
    omega = abs(turn * float(found.modal_velocities[0, 0]))
    back = rebound_speed_from_recoil(
        own.inertia(axis), omega, paper_ball(BALL).mass, axis - z * INCH, 60 * MPH
    )
    return float(back) / (60 * MPH) - float(found.collision_efficiency[0])


def _reaction(z: float) -> float:
    """Return the blow on the pivot of a rigid R161 over that on the barrel."""
    own = beam(WOOD)
    axis = own.length - 6 * INCH
    arm = axis - z * INCH
    return 1 - own.mass * (axis - own.z_cm) * arm / own.inertia(axis)


def _swung(place: float | Array, length: float) -> Array:
    """Return the bat's speed of the NCAA method, about the pivot of its rig [mph]."""
    pivot = (length - rules("ncaa-modified").pivot_from_knob) / INCH
    return np.asarray(SWUNG * (pivot - np.asarray(place)) / (pivot - 6.0))


def _ncaa(bat: str) -> float:
    """Return the greatest v_f of the NCAA's own speeds [mph]."""
    speeds = _swung(PLACES, beam(bat).length)
    e_A = peak_of(bat, PLACES, speed=PITCH + speeds, with_ball=BALL).collision_efficiency
    return top_of(PLACES, e_A, PITCH, speeds).value


def _exponent_of_mass() -> float:
    field = rules("asa").game
    return field.exponent if field and field.scales_with == "mass" else np.nan


def _at_limit(place: float) -> float:
    """Return v_f of a bat of e_A = 0.228 struck at a place [mph]."""
    return float(batted_speed(LIMIT, PITCH, _swung(place, beam(WOOD).length)))


def _besr_at_limit(place: float) -> float:
    """Return BESR of a bat of v_f = 97 mph struck at a place."""
    e_A = collision_efficiency(PITCH, _swung(place, beam(WOOD).length), MODIFIED)
    return float(besr(e_A))


def _field_speed() -> float:
    return 90 + float(nominal(WOOD, top(WOOD, "v_f_mph").place))


def _off_percussion(bat: str) -> float:
    return abs(centre_of_percussion_in(bat) - top(bat, "v_f_mph").place)


def _lighter_is_faster() -> float:
    speeds = [float(profiled(bat)[0.3].bat_speed[0]) for bat in (ALUMINIUM, WOOD)]
    return 100 * (speeds[0] / speeds[1] - 1)


def _swing_matters() -> float:
    """Return how far the proposal's v_f of EA70 moves as n goes from 0 to 0.5 [mph]."""
    return top(ALUMINIUM, "v_f_mph", 0.5).value - top(ALUMINIUM, "v_f_mph", 0.0).value


def _metrics_alike() -> float:
    return abs(_ncaa(ALUMINIUM) / _ncaa(WOOD) - 1) * 100


CLAIMS: tuple[Claim, ...] = (
    *(
        about(
            "V A",
            "text",
            f"v_f from e_A of a bat at rest at 160 mph is the field's: {bat}, n = {n:g}",
            0.0,
            0.1,
            partial(_proposed, bat, n),
            unit="mph",
            why="e_A depends weakly on v_rel",
        )
        for bat in BATS
        for n in (0.0, 0.5)
    ),
    at_least(
        "V A",
        "text",
        "the places must encompass the peak of v_f: least distance from the ends, 3 to 9 in",
        0.5,
        _ends,
        unit="in",
        why="two steps of the scan",
    ),
    at_least(
        "V B",
        "text",
        "n of 0 to 0.5 is to be considered: v_f of EA70 moves by",
        3.0,
        _swing_matters,
        unit="mph",
        why="more than bats differ by",
    ),
    about(
        "V B 1",
        "text",
        "ASTM: speed of the ball",
        60.0,
        1e-9,
        lambda: rules("astm-f1881").ball_speed / MPH,
        unit="mph",
        why=STATED,
    ),
    about(
        "V B 1",
        "text",
        "ASTM: pivot from the knob",
        6.0,
        1e-9,
        lambda: rules("astm-f1881").pivot_from_knob / INCH,
        unit="in",
        why=STATED,
    ),
    about(
        "V B 1",
        "text",
        "ASTM: an agency's limit of BPF",
        1.2,
        1e-9,
        lambda: rules("astm-f1881").limit or np.nan,
        why=STATED,
    ),
    at_most(
        "V B 1",
        "text",
        "recoil and rebound agree by angular momentum: difference over v_ball",
        1e-6,
        lambda: abs(_by_recoil()),
        why="the model's own momentum balance",
    ),
    about(
        "V B 1",
        "text",
        "a hit at the COP turns the bat smoothly: blow on the pivot over that on the barrel",
        0.0,
        1e-9,
        lambda: _reaction(centre_of_percussion_in(WOOD)),
        why="algebra: rounding alone",
    ),
    at_least(
        "V B 1",
        "text",
        "elsewhere the pivot reacts: the same 2 in nearer the tip",
        0.05,
        lambda: abs(_reaction(centre_of_percussion_in(WOOD) - 2)),
        why="plain beside the algebra",
    ),
    at_most(
        "V B 1",
        "text",
        "a higher BPF is not a better bat: BPF of barrel- less knob-loaded",
        0.0,
        lambda: _factor(BARREL) - _factor(KNOB),
        why="a sign: v_f goes the other way",
    ),
    at_least(
        "V B 1",
        "text",
        "while the barrel-loaded bat performs better: v_f at n = 0.3",
        0.5,
        lambda: lead(BARREL, KNOB, 0.3),
        unit="mph",
        why="plain beside the model's error",
    ),
    at_least(
        "V B 1",
        "text",
        "60 mph is well below the field's v_rel: below by",
        80.0,
        lambda: _field_speed() - 60,
        unit="mph",
        why="well below: more than half",
    ),
    at_least(
        "V B 1",
        "text",
        "the COP is not where v_f peaks: farthest apart of the four bats",
        0.5,
        lambda: max(_off_percussion(bat) for bat in BATS),
        unit="in",
        why="plain beside the step",
    ),
    about(
        "V B 2",
        "text",
        "ASA: speed of the ball",
        60.0,
        1e-9,
        lambda: rules("asa").ball_speed / MPH,
        unit="mph",
        why=STATED,
    ),
    about("V B 2", "text", "ASA: exponent of the mass", 0.25, 1e-9, _exponent_of_mass, why=STATED),
    about(
        "V B 3",
        "text",
        "NCAA: speed of the ball",
        PITCH,
        1e-9,
        lambda: rules("ncaa-besr").ball_speed / MPH,
        unit="mph",
        why=STATED,
    ),
    about(
        "V B 3",
        "text",
        "NCAA: speed of the bat 6 in from the tip",
        SWUNG,
        1e-9,
        lambda: (rules("ncaa-besr").bat_speed or np.nan) / MPH,
        unit="mph",
        why=STATED,
    ),
    about(
        "V B 3",
        "text",
        "NCAA: limit of BESR",
        0.728,
        1e-9,
        lambda: rules("ncaa-besr").limit or np.nan,
        why=STATED,
    ),
    about(
        "V B 3",
        "text",
        "e_A at that limit",
        LIMIT,
        1e-12,
        lambda: 0.728 - (float(besr(LIMIT)) - LIMIT),
        why="algebra: rounding alone",
    ),
    about(
        "V B 3",
        "text",
        "v_f at that limit, struck 6 in from the tip",
        MODIFIED,
        0.5,
        lambda: _at_limit(6.0),
        unit="mph",
    ),
    at_least(
        "V B 3",
        "text",
        "struck closer to the tip, v_f at the limit is greater than 97 mph: at 5 in",
        97.5,
        lambda: _at_limit(5.0),
        unit="mph",
        why="beyond the rounding of 97",
    ),
    at_most(
        "V B 3",
        "text",
        "struck farther from the tip, less: at 7 in",
        96.5,
        lambda: _at_limit(7.0),
        unit="mph",
        why="beyond the rounding of 97",
    ),
    about(
        "V B 3",
        "text",
        "v_rel of 136 mph is somewhat low for baseball: below the field's by",
        24.0,
        5.0,
        lambda: _field_speed() - PITCH - SWUNG,
        unit="mph",
        why="160 in print, typically",
    ),
    about(
        "V B 4",
        "text",
        "modified NCAA: limit of v_f",
        MODIFIED,
        1e-9,
        lambda: (rules("ncaa-modified").speed_limit or np.nan) / MPH,
        unit="mph",
        why=STATED,
    ),
    about(
        "V B 4",
        "text",
        "BESR of a bat at that limit, struck 6 in from the tip",
        0.728,
        1e-3,
        lambda: _besr_at_limit(6.0),
        why="rounding of 97",
    ),
    at_most(
        "V B 4",
        "text",
        "struck closer to the tip, BESR is less than 0.728: at 5 in",
        0.7275,
        lambda: _besr_at_limit(5.0),
        why="beyond the rounding",
    ),
    at_least(
        "V B 4",
        "text",
        "struck farther from the tip, greater: at 7 in",
        0.7285,
        lambda: _besr_at_limit(7.0),
        why="beyond the rounding",
    ),
    at_least(
        "IV, V B 4",
        "text",
        "a test at one bat speed concludes that R161 outperforms EA70: v_f at 70 and 66 mph, by",
        0.0,
        lambda: _ncaa(WOOD) - _ncaa(ALUMINIUM),
        unit="mph",
        why="a sign",
    ),
    at_most(
        "V B 4",
        "text",
        "wood and aluminium perform nearly identically there: v_f apart",
        2.0,
        _metrics_alike,
        unit="%",
        why="nearly: 2 %",
    ),
    at_least(
        "V B 4",
        "text",
        "yet aluminium outperforms wood in the field: n = 0.3",
        2.0,
        lambda: lead(ALUMINIUM, WOOD, 0.3),
        unit="mph",
        why="plain beside the model's error",
    ),
    at_least(
        "V B 4",
        "text",
        "for it is swung faster, n = 0.3: by",
        1.0,
        _lighter_is_faster,
        unit="%",
        why="plain beside the fit",
    ),
)
