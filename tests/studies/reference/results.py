"""Results of this laboratory for the published numbers, each in the unit of its row.

Positions are in inches and speeds in mph here, as in the publications. Bats have their catalog
names. The ball is the catalog's baseball; its restitution decreases with speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from tests.studies.paper.computed import BALL, WOOD, beam, body, paper_ball, rules
from tests.studies.reference.published import published_value
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.lab.certify import certify_bat
from virtual_lab.lab.setup import TestSetup
from virtual_lab.lab.true_metric import TrueCurve
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    recoil_factor_pivoted,
    restitution_from_efficiency,
)
from virtual_lab.relations.peaks import Peak, peak
from virtual_lab.relations.swing import KNOB_OFFSET, PowerLawSwing, bat_speed
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes
from virtual_lab.studies.bats.profile import free_model, profiles
from virtual_lab.units import (
    DIMENSIONS,
    INCH,
    MPH,
    OUNCE,
    OZ_IN2,
    Array,
    from_si,
    to_si,
)

AXIS = 6 * INCH  # distance of the pivot from the knob end [m]
Z = np.arange(3.0, 9.01, 0.25)  # impact positions from the tip [in]
WOODEN = (WOOD, "russell-1", "russell-2", "russell-3", "russell-4", "wood-rw01")
HOOP_FREQUENCIES = range(1000, 3001, 200)  # [Hz]
LENGTHS = (31.0, 32.0, 33.0, 34.0)  # lengths of tested wood bats [in]
FOOT = 12 * INCH


# Numbers of the catalog


def entry(kind: str, name: str, key: str, unit: str = "1", index: int = 0) -> float:
    """Return a number from a file of the catalog, converted to `unit`.

    `kind` is a folder of the catalog, such as ``balls``, `name` is the file, and `key` is the key
    of the number. `index` selects one number of a list, and is ignored for a single number. Raises
    `InputError` for an unknown file, `ValueError` for an unknown key or a unit of another
    dimension, and `IndexError` for an index beyond the list.
    """
    (datum,) = (each for each in catalog.sheet(kind, name)[1] if each.key == key)
    value = datum.value[index] if isinstance(datum.value, list) else datum.value
    if unit == datum.unit:
        return float(value)
    (dimension,) = (each for each, units in DIMENSIONS.items() if {unit, datum.unit} <= set(units))
    return from_si(to_si(float(value), datum.unit, dimension), unit, dimension)


def entries(kind: str, name: str, key: str) -> float:
    """Return the number of items of a list in a file of the catalog.

    `kind` is a folder of the catalog, such as ``balls``, `name` is the file, and `key` is the key
    of the list. Raises `InputError` for an unknown file, `ValueError` for an unknown key, and
    `TypeError` if the key has a single number.
    """
    (datum,) = (each for each in catalog.sheet(kind, name)[1] if each.key == key)
    return len(datum.value)


def half_width(name: str, key: str) -> float:
    """Return the half width [in] of a rectangular distribution, from its standard uncertainty u.

    The half width is √3 u. `name` is the instrument in the catalog, and `key` is the key of u.
    Raises `InputError` for an unknown instrument, and `ValueError` for an unknown key.
    """
    return entry("instruments", name, key, "in") * 3**0.5


def _in_feet(length_in: float) -> float:
    return length_in * INCH / FOOT


def gate_distance(name: str) -> float:
    """Return the distance between the first two gates of an instrument of the catalog [ft].

    Raises `InputError` for an unknown instrument, and `ValueError` for one without gates.
    """
    near, far = (entry("instruments", name, "distances", "in", index) for index in (1, 0))
    return _in_feet(far - near)


def nearest_gate(name: str) -> float:
    """Return the distance of the nearest gate of an instrument from the bat or the wall [ft].

    Raises `InputError` for an unknown instrument, and `ValueError` for one without gates.
    """
    gates = range(int(entries("instruments", name, "distances")))
    return _in_feet(min(entry("instruments", name, "distances", "in", gate) for gate in gates))


def limit_in_feet_per_second(procedure: str) -> float:
    """Return the limit of the batted-ball speed in a procedure [ft/s].

    Raises `InputError` for an unknown procedure, and `ValueError` for one without this limit.
    """
    return entry("procedures", procedure, "speed_limit", "m/s") / FOOT


def circumference(ball: str) -> float:
    """Return the circumference of a ball of the catalog [in].

    Raises `InputError` for an unknown ball.
    """
    return 2 * np.pi * entry("balls", ball, "radius", "in")


# Mass, inertia and vibration of bats


def length(bat: str) -> float:
    """Return the length of a bat of the catalog [in]. Raises `InputError` for an unknown bat."""
    return beam(bat).length / INCH


def weight(bat: str) -> float:
    """Return the weight of a bat of the catalog [oz]. Raises `InputError` for an unknown bat."""
    return beam(bat).mass / OUNCE


def balance_point(bat: str) -> float:
    """Return the balance point of a bat: the distance of its center of mass from the knob end [in].

    Raises `InputError` for an unknown bat.
    """
    return (beam(bat).length - beam(bat).z_cm) / INCH


def pivot_inertia(bat: str) -> float:
    """Return the moment of inertia of a bat about an axis 6 in from the knob end [oz in^2].

    Raises `InputError` for an unknown bat.
    """
    return beam(bat).inertia(beam(bat).length - AXIS) / OZ_IN2


def inertia_ratio(bat: str) -> float:
    """Return a bat's moment of inertia about the knob end divided by that about the pivot.

    The pivot is 6 in from the knob end. Raises `InputError` for an unknown bat.
    """
    return beam(bat).inertia(beam(bat).length) / OZ_IN2 / pivot_inertia(bat)


def diameter(bat: str) -> float:
    """Return the largest outer diameter in the data sheet of a bat [in].

    Raises `InputError` for an unknown bat.
    """
    return max(body(bat).profile.outer_diameter) / INCH


def barrel_length(bat: str) -> float:
    """Return the distance from the tip to the beginning of the taper toward the handle [in].

    Raises `InputError` for an unknown bat.
    """
    profile = body(bat).profile
    widest = max(profile.outer_diameter)
    stations = zip(profile.z, profile.outer_diameter, strict=True)
    return max(z for z, across in stations if across == widest) / INCH


@lru_cache
def _shorten(length_in: float) -> BatBody:
    """Return the bat R161, compressed along its axis to a length; its diameters stay the same."""
    whole = body(WOOD)
    share = length_in * INCH / whole.length
    return replace(
        whole, profile=replace(whole.profile, z=tuple(share * z for z in whole.profile.z))
    )


def _body(bat: str | float) -> BatBody:
    """Return the body of a bat by name, or the body of R161 shortened to a length [in]."""
    return body(bat) if isinstance(bat, str) else _shorten(float(bat))


def frequency(bat: str | float, mode: int) -> float:
    """Return the frequency of a bending mode of a free bat [Hz].

    `bat` is a name in the catalog, or the length [in] to which R161 is shortened. `mode` counts
    from 1. Raises `InputError` for an unknown bat, and for a mode that the model does not have.
    """
    return _of_mode(free_model(_body(bat)).modes.bending_frequencies, mode)


def node(bat: str | float, mode: int) -> float:
    """Return the distance from the tip of the barrel node of a bending mode [in].

    The bat is free. The barrel node is the node nearest to the tip. `bat` is a name in the catalog,
    or the length [in] to which R161 is shortened. `mode` is 1 or 2. Raises `InputError` for an
    unknown bat, and for another mode.
    """
    return _of_mode(barrel_nodes(free_model(_body(bat)).modes), mode) / INCH


def _of_mode(values: Sequence[float] | Array, mode: int) -> float:
    if not 1 <= mode <= len(values):
        raise InputError("", "mode", mode, f"allowed: 1 to {len(values)}")
    return float(values[mode - 1])


def handle_node(bat: str) -> float:
    """Return the position [in from the knob end] of the handle node of the first bending mode.

    The bat is free. The handle node is the node nearest to the knob end. Raises `InputError` for an
    unknown bat.
    """
    modes = free_model(body(bat)).modes
    z = np.linspace(0.0, modes.length, 3401)
    shape = modes.shape(z)[:, modes.rigid]
    last = np.flatnonzero(shape[:-1] * shape[1:] < 0)[-1]
    return float(modes.length - z[last]) / INCH


# Collisions


def _collide(
    bat: BatBody, speed: Array | float, ball: BallSpec | None = None
) -> tuple[Array, Collisions, Scenes]:
    """Return recoil factors, collisions and scenes at the positions `Z` along the barrel.

    The recoil factor r, (position,), is that of the pivoted bat; the collisions are with a free
    bat.
    """
    ball = ball or paper_ball(BALL)
    z, drawn = Z * INCH, beam_of(bat)
    scenes = Scenes.with_ball(
        ball, impact_position=z, relative_speed=np.broadcast_to(speed, Z.shape) * MPH
    )
    axis = drawn.length - AXIS
    recoil = np.asarray(recoil_factor_pivoted(ball.mass, drawn.inertia(axis), axis - z))
    return recoil, free_model(bat).collide(scenes), scenes


def _restitution_peak(bat: BatBody, speed: float, ball: BallSpec | None = None) -> Peak:
    recoil, collisions, _ = _collide(bat, speed, ball)
    e = restitution_from_efficiency(collisions.collision_efficiency, recoil)
    return peak(Z, np.asarray(e))


def peak_restitution(bat: str, speed: float) -> float:
    """Return the peak BBCOR of a bat over impacts 3 to 9 in from the tip, dimensionless.

    BBCOR is computed from e_A of the free bat and the recoil factor r of the rigid bat with a pivot
    6 in from the knob. `speed` is the relative speed of ball and bat [mph]. The ball is the nominal
    baseball. Raises `InputError` for an unknown bat.
    """
    return _restitution_peak(body(bat), speed).value


def peak_restitution_position(bat: str, speed: float) -> float:
    """Return the distance of the peak BBCOR from the tip [in].

    BBCOR is the bat-ball coefficient of restitution. Positions from 3 to 9 in are searched. The
    peak is computed by `peak_restitution`. `speed` is the relative speed of ball and bat [mph].
    Raises `InputError` for an unknown bat.
    """
    return _restitution_peak(body(bat), speed).place


def restitution_change(bat: str, first: str, speed: float) -> float:
    """Return the peak BBCOR of `bat` minus the peak BBCOR of the bat `first`, dimensionless.

    `speed` is the relative speed of ball and bat [mph]. The peak BBCOR is computed by
    `peak_restitution`. Raises `InputError` for an unknown bat.
    """
    return peak_restitution(bat, speed) - peak_restitution(first, speed)


def procedure_result(bat: str, procedure: str) -> float:
    """Return the exact result of a procedure for a nominal bat, in SI units or dimensionless.

    It is the largest value of the procedure's metric over impacts 3 to 9 in from the tip. The
    metric is converted to the standard ball if the procedure has one. Both names are names in the
    catalog. Raises `InputError` for an unknown bat or procedure.
    """
    rule = rules(procedure)
    recoil, collisions, scenes = _collide(body(bat), rule.ball_speed / MPH)
    e_A = collisions.collision_efficiency
    curve = TrueCurve(
        procedure=rule,
        bat=beam(bat),
        position=Z * INCH,
        collision_efficiency=e_A,
        restitution=np.asarray(restitution_from_efficiency(e_A, recoil)),
        recoil_factor=recoil,
        ball_restitution=scenes.ball_restitution,
    )
    return peak(Z, curve.metric()).value


def hit_scatter(bat: str, speed: float) -> float:
    """Return the standard deviation of BBCOR caused by the scatter of the ball's e0, dimensionless.

    Each hit uses a new ball. The ball-wall restitution e0 differs between balls, and between hits
    of one ball; both kinds of scatter are included. BBCOR is the largest bat-ball restitution along
    the barrel. `speed` is the relative speed of ball and bat [mph]. Raises `InputError` for an
    unknown bat.
    """
    ball = paper_ball(BALL)
    step = 0.005  # change of e0 for the slope, small beside the curvature of e(e0)
    ends = [
        _restitution_peak(
            body(bat),
            speed,
            replace(
                ball, restitution=replace(ball.restitution, value=ball.restitution.value + change)
            ),
        ).value
        for change in (-step, step)
    ]
    spread = np.hypot(ball.spread.restitution, ball.spread.hit_restitution)
    return (ends[1] - ends[0]) / (2 * step) * float(spread)


def peak_efficiency(bat: str, speed: float) -> float:
    """Return the largest collision efficiency of a free bat, 3 to 9 in from the tip.

    `speed` is the relative speed of ball and bat [mph]. Raises `InputError` for an unknown bat.
    """
    return peak(Z, _collide(body(bat), speed)[1].collision_efficiency).value


def humid_loss(bat: str, first: float, last: float, speed: float) -> float:
    """Return the loss of the largest v_f [mph] if balls are kept at `last` instead of `first` % RH.

    Only e0 of the nominal baseball depends on its humidity. The positions are 3 to 9 in from the
    tip. `speed` is the relative speed of ball and bat [mph]. Raises `InputError` for an unknown
    bat.
    """
    ball = paper_ball(BALL)
    line, law = ball.restitution, ball.humidity
    assert law is not None
    dry, humid = (
        replace(
            ball, restitution=replace(line, value=factor * line.value, slope=factor * line.slope)
        )
        for factor in law.factor([first / 100, last / 100]).tolist()
    )
    best = [
        peak(Z, _collide(body(bat), speed, each)[1].collision_efficiency) for each in (dry, humid)
    ]
    return speed * (best[0].value - best[1].value)


def peak_contact_time(bat: str, speed: float) -> float:
    """Return the contact time [s] of a ball and a free bat at the position of the largest e_A.

    e_A is the collision efficiency. Positions from 3 to 9 in from the tip are compared, in steps of
    0.25 in. `speed` is the relative speed of ball and bat [mph]. Raises `InputError` for an unknown
    bat.
    """
    collisions = _collide(body(bat), speed)[1]
    return float(collisions.contact_time[np.argmax(collisions.collision_efficiency)])


def barrel_travel(bat: str, speed: float) -> float:
    """Return the travel of the barrel during contact [in]: half its final speed times contact time.

    The factor of one half is exact if the force is symmetric in time. The impact is where the
    collision efficiency e_A of the free bat is largest, 3 to 9 in from the tip. The contact time is
    computed for the free bat. The final speed follows from e_A and the recoil of the rigid bat with
    a pivot 6 in from the knob. `speed` is the relative speed of ball and bat [mph]. Raises
    `InputError` for an unknown bat.
    """
    recoil, collisions, _ = _collide(body(bat), speed)
    best = int(np.argmax(collisions.collision_efficiency))
    final = recoil[best] * (1 + collisions.collision_efficiency[best]) * speed * MPH
    return float(final * collisions.contact_time[best] / 2) / INCH


def soft_ball(bat: str, speed: float) -> float:
    """Return the change of the peak BBCOR if the ball has a tenth of its stiffness, dimensionless.

    The soft ball has the same e0. A positive result is a higher BBCOR with the soft ball. `speed`
    is the relative speed of ball and bat [mph]. Raises `InputError` for an unknown bat.
    """
    ball = paper_ball(BALL)
    soft = replace(ball, stiffness=ball.stiffness / 10)
    return _restitution_peak(body(bat), speed, soft).value - peak_restitution(bat, speed)


def hoop_trend(bat: str, speed: float) -> float:
    """Return Spearman's rank correlation of peak BBCOR and hoop frequency, from -1 to 1.

    The frequency is varied from 1000 to 3000 Hz at constant modal mass. `speed` is the relative
    speed of ball and bat [mph]. The bat must have a hoop mode. Raises `InputError` for an unknown
    bat.
    """
    hoop = body(bat).hoop
    assert hoop is not None
    tops = [
        _restitution_peak(
            replace(body(bat), hoop=replace(hoop, frequency=float(hertz))), speed
        ).value
        for hertz in HOOP_FREQUENCIES
    ]
    return float(spearmanr(list(HOOP_FREQUENCIES), tops).statistic)


def length_trend(speed: float) -> float:
    """Return the change of the peak BBCOR per inch of bat length [1/in].

    BBCOR is the bat-ball coefficient of restitution. Its peak is computed for the wood bat R161
    with lengths of 31, 32, 33 and 34 in. A straight line is fitted to the four peaks, and its slope
    is returned. `speed` is the relative speed of ball and bat [mph].
    """
    tops = [_restitution_peak(_shorten(inches), speed).value for inches in LENGTHS]
    return float(np.polyfit(LENGTHS, tops, 1)[0])


def restitution_on_wall(ball: str, feet_per_second: float) -> float:
    """Return e0 of a ball of the catalog on a rigid wall, dimensionless.

    The impact speed is `feet_per_second` [ft/s]. The data sheet of the ball states e0 at measured
    speeds. e0 is a linear function of the speed, which is also used beyond these speeds. The result
    is never below the lowest e0 in the sheet. Raises `InputError` for an unknown ball.
    """
    return float(paper_ball(ball).restitution.at(feet_per_second * FOOT))


# Tests and the field


def _swing_test(bat: str, procedure: str) -> float:
    """Return the largest batted-ball speed of a bat on the swing machine [mph].

    The bat speed is proportional to the distance from the machine's axis.
    """
    rule = rules(procedure)
    assert rule.bat_speed is not None
    drawn = beam(bat)
    turning = float(rule.turn_rate(drawn.length))
    moving = turning * (drawn.length - rule.pivot_from_knob - Z * INCH) / MPH
    pitch = rule.ball_speed / MPH
    e_A = _collide(body(bat), pitch + moving)[1].collision_efficiency
    return peak(Z, np.asarray(batted_speed(e_A, pitch, moving))).value


def best_wood(procedure: str) -> float:
    """Return the largest batted-ball speed [mph] of the bats `WOODEN` on a swing machine.

    They are wood baseball bats of the catalog. `procedure` is the name of the procedure that states
    the ball and bat speeds. Raises `InputError` for an unknown procedure.
    """
    return max(_swing_test(bat, procedure) for bat in WOODEN)


def expanded_speed_u(bat: str, procedure: str) -> float:
    """Return the half width [mph] of the 95 % interval of v_f in one test on the swing machine.

    v_f is the batted-ball speed. The test is simulated with seed 1, and it must have a result.
    Raises `InputError` for an unknown bat or procedure.
    """
    metric = certify_bat(TestSetup.of(bat, procedure=procedure, seed=1)).certification.metric
    rule = rules(procedure)
    assert metric is not None
    assert rule.bat_speed is not None
    low, high = metric.interval_95
    return (high - low) / 2 * (rule.ball_speed + rule.bat_speed) / MPH


def batted_lead(first: str, second: str, exponent: float) -> float:
    """Return the peak v_f of the first bat minus the peak v_f of the second bat [mph].

    v_f is the batted-ball speed. Both bats are swung under standard game conditions. `exponent` is
    the n of the swing law. Raises `InputError` for an exponent outside 0 to 0.5, and for an unknown
    bat.
    """
    one, other = (_swung_peak(bat, exponent) for bat in (first, second))
    return one.value - other.value


def sweet_spot_lead(first: str, second: str, exponent: float) -> float:
    """Return by how much the peak v_f of the first bat is farther from the tip [in].

    The arguments are those of `batted_lead`.
    """
    one, other = (_swung_peak(bat, exponent) for bat in (first, second))
    return one.place - other.place


def _swung_peak(bat: str, exponent: float) -> Peak:
    """Return the largest v_f of a bat [mph], and its position from the tip [in]."""
    return profiles(bat, swings=(exponent,))[0].peaks["batted_speed_mph"]


def cage_speed(exponent: float) -> float:
    """Return the bat speed [mph] of the metal bat in a published batting-cage study.

    It is computed from the published bat speed of the wood bat, with an angular speed proportional
    to I^-n, where n is `exponent`. The impact position of both bats is assumed to be 6 in from the
    tip.
    """
    bats = {name: _cage_bat(name) for name in ("wood", "metal")}
    law = PowerLawSwing(angular_speed_0=1.0, inertia_0=bats["wood"].inertia, exponent=exponent)
    wood, metal = (
        float(bat_speed(law.angular_speed(bat.inertia), bat.length, 6 * INCH))
        for bat in bats.values()
    )
    return published_value("batting cage, wood bat: bat speed in the cage") * metal / wood


class _CageBat(NamedTuple):
    length: float  # [m]
    inertia: float  # about the point 1 in from the knob [kg m^2]


def _cage_bat(name: str) -> _CageBat:
    """Return a bat of the cage study from its published length, weight, balance and inertia."""
    inches, ounces, balance, moment = (
        published_value(f"batting cage, {name} bat: {quantity}")
        for quantity in ("length", "weight", "balance point from knob", "MOI about 6 in from knob")
    )
    near, far = balance - AXIS / INCH, balance - KNOB_OFFSET / INCH
    return _CageBat(inches * INCH, (moment + ounces * (far**2 - near**2)) * OZ_IN2)
