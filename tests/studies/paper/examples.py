"""Results for Secs. IV and VI: Table I, Figs. 3 and 4, the conclusions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from tests.studies.paper.claim import Claim
from tests.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BARREL,
    BATS,
    KNOB,
    WOOD,
    Z,
    beam,
    body,
    collide_at,
    game_bat_speed,
    model,
    paper_ball,
    peak_speed_lead,
    profiles_by_swing,
    recoil,
    restitution,
    top,
)
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
    recoil_factor_free,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2


def table_one() -> Iterator[Claim]:
    """Yield the claims of Table I, nine for each of the four bats, with tolerances of 0.5 %.

    The printed numbers are taken from the data sheets of the bats.
    """
    for bat in BATS:
        published = catalog.load_bat(bat).spec.published
        assert published is not None
        printed = {
            "length": (published.length, INCH, "in"),
            "mass": (published.mass, OUNCE, "oz"),
            "z_cm": (published.z_cm, INCH, "in"),
            "I_cm": (published.inertia_cm, OZ_IN2, "oz in^2"),
            "I_knob": (published.inertia_knob, OZ_IN2, "oz in^2"),
            "f_1": (published.bending_frequencies[0], 1.0, "Hz"),
            "f_2": (published.bending_frequencies[1], 1.0, "Hz"),
            "node 1": (published.barrel_nodes[0], INCH, "in"),
            "node 2": (published.barrel_nodes[1], INCH, "in"),
        }
        for name, (value_si, unit_si, unit) in printed.items():
            assert value_si is not None
            value = value_si / unit_si
            yield Claim(
                section="IV",
                where="Table I",
                says=f"{bat}: {name}",
                paper=value,
                low=value - 5e-3 * value,
                high=value + 5e-3 * value,
                unit=unit,
                why="fit of the drawing, 0.5 %",
                find=partial(drawing_entry, bat, name),
            )


def drawing_entry(bat: str, name: str) -> float:
    """Return an entry of Table I computed from the drawing of a bat, in the unit of the table.

    `name` is length, z_cm, node 1 or node 2 [in], mass [oz], I_cm or I_knob [oz in^2], f_1 or f_2
    [Hz]. Positions are distances from the tip. The axis of I_knob is 33 inches from the tip. Raises
    `KeyError` for another name, and `InputError` for an unknown bat.
    """
    bat_beam, profile = beam(bat), profiles_by_swing(bat)[0.0]
    return {
        "length": bat_beam.length / INCH,
        "mass": bat_beam.mass / OUNCE,
        "z_cm": bat_beam.z_cm / INCH,
        "I_cm": bat_beam.inertia_cm / OZ_IN2,
        "I_knob": bat_beam.inertia(33 * INCH) / OZ_IN2,
        "f_1": float(profile.frequencies[0]),
        "f_2": float(profile.frequencies[1]),
        "node 1": profile.nodes[0] / INCH,
        "node 2": profile.nodes[1] / INCH,
    }[name]


def added_weight(bat: str) -> float:
    """Return the mass of the last item in a bat's list of added weights, such as an end cap [oz].

    Raises `IndexError` for a bat whose data sheet has no added weight, and `InputError` for an
    unknown bat.
    """
    return body(bat).lumps[-1].mass / OUNCE


def peak_change(curve: str, first: str, second: str) -> float:
    """Return the relative difference of two bats in the peak of a curve [%].

    It is 100 (first / second - 1), negative if the first bat has the lower peak. `curve` is
    ``restitution``, ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``,
    under standard game conditions with swing exponent 0. Raises `KeyError` for an unknown curve,
    and `InputError` for an unknown bat.
    """
    return 100 * (top(first, curve).value / top(second, curve).value - 1)


def peak_shift(curve: str) -> float:
    """Return the peak position of a curve on EA70 minus the peak position on R161 [in].

    The result is positive if the peak of EA70 is farther from the tip. `curve` is ``restitution``,
    ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``, under standard
    game conditions with swing exponent 0. Raises `KeyError` for an unknown curve.
    """
    return top(ALUMINIUM, curve).place - top(WOOD, curve).place


def bat_speed_difference(curve: str) -> float:
    """Return the bat speed at the peak of R161 minus the bat speed at the peak of EA70 [mph].

    R161 is the wood bat and EA70 the aluminum bat of the paper. The peak of a bat is the impact
    position at which its `curve` is largest. `curve` is ``restitution``,
    ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``, under standard
    game conditions with swing exponent 0. Raises `KeyError` for an unknown curve.
    """
    speeds = [float(game_bat_speed(bat, top(bat, curve).place)) for bat in (WOOD, ALUMINIUM)]
    return speeds[0] - speeds[1]


def mass_share(light: str, heavy: str) -> float:
    """Return the effective mass of the light bat divided by the effective mass of the heavy bat.

    Both bats are free, and the impact is 6 in from the tip. Raises `InputError` for an unknown bat.
    """
    return float(recoil(heavy, 6.0) / recoil(light, 6.0))


def factor_gain_of_thin_wall() -> float:
    """Return the increase of the peak bat performance factor (BPF) due to a thinner wall.

    The bat is EA70, the aluminum bat of the paper. The thinner wall is the wall of the catalog bat
    ``barrel-loaded``. The result is the peak with the thinner wall minus the peak with the original
    wall. The two peaks belong to different conditions:

    * thinner wall: a free bat at rest, hit at 160 mph, 3 to 8 in from the tip
    * original wall: standard game conditions
    """
    struck_body = body(ALUMINIUM).with_wall(_thickness())
    bat_beam, mass = beam_of(struck_body), paper_ball().mass
    r = recoil_factor_free(mass, bat_beam.mass, bat_beam.inertia_cm, Z * INCH - bat_beam.z_cm)
    e_A = collide_at(ModalModel.of(struck_body, Free()), Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, r))
    return float(e.max()) / 0.5 - top(ALUMINIUM, "bat_performance_factor").value


def wall_reduction() -> float:
    """Return the relative reduction in wall thickness from bat EA70 to the loaded bats [%].

    EA70 is the paper's aluminum bat. The loaded bats are two other aluminum bats with a mass added
    in the barrel or in the knob; both have the same wall. The result is positive if they have the
    thinner wall.
    """
    return 100 * (1 - _thickness())


def _thickness() -> float:
    """Return the wall thickness of the loaded bats divided by the wall thickness of EA70."""
    thin, whole = body(BARREL).profile.wall, body(ALUMINIUM).profile.wall
    assert thin is not None
    assert whole is not None
    return thin[0] / whole[0]


def node_shift(i: int) -> float:
    """Return the position of a barrel node on EA70 minus its position on R161 [in].

    The result is positive if the node of EA70 is farther from the tip. `i` is 0 for the first
    bending mode and 1 for the second. Raises `InputError` for another number.
    """
    if i not in (0, 1):
        raise InputError("", "bending mode", i, "allowed: 0, 1")
    return (
        profiles_by_swing(ALUMINIUM)[0.0].nodes[i] - profiles_by_swing(WOOD)[0.0].nodes[i]
    ) / INCH


def load_difference() -> float:
    """Return the difference in mass between the barrel-loaded and the knob-loaded bat [oz].

    It is positive if the barrel-loaded bat is heavier.
    """
    return (beam(BARREL).mass - beam(KNOB).mass) / OUNCE


def balance_point_difference() -> float:
    """Return the balance point of EA70 minus the balance point of R161 [in], both from the tip."""
    return (beam(ALUMINIUM).z_cm - beam(WOOD).z_cm) / INCH


def smallest_lead(first: str, second: str, *swings: float) -> float:
    """Return the smallest lead of the first bat over several swing exponents [mph].

    The lead is the peak batted-ball speed of the first bat minus the peak of the second, under
    standard game conditions. Each of `swings` is one of 0, 0.1, 0.2, 0.3, 0.4 and 0.5. Raises
    `ValueError` without an exponent, `KeyError` for another exponent, and `InputError` for an
    unknown bat.
    """
    return min(peak_speed_lead(first, second, n) for n in swings)


def lead_decrease(first: str, second: str, n: float, n_second: float) -> float:
    """Return the decrease of the first bat's lead [mph] if the swing exponent rises to `n_second`.

    The lead is the peak batted-ball speed of the first bat minus the peak of the second, under
    standard game conditions. The result is the lead at exponent `n` minus the lead at exponent
    `n_second`. Both are 0 to 0.5 in steps of 0.1. Raises `KeyError` for another exponent, and
    `InputError` for an unknown bat.
    """
    return peak_speed_lead(first, second, n) - peak_speed_lead(first, second, n_second)


def change_with_other_recoil() -> float:
    """Return the change of a batted-ball speed if the recoil factor of another bat is used [mph].

    The absolute change is returned. The batted-ball speed of the wood bat R161 is computed with its
    own recoil factor, and with the recoil factor of the aluminum bat EA70. The bat-ball restitution
    is that of R161 both times. The impact is 6 in from the tip, the pitch speed is 90 mph, and the
    bat speed is 70 mph.
    """
    e = restitution(WOOD, [6.0])
    speeds = [
        float(np.asarray(batted_speed(efficiency_from_restitution(e, recoil(bat, 6.0)), 90, 70))[0])
        for bat in (WOOD, ALUMINIUM)
    ]
    return abs(speeds[1] - speeds[0])


def opposite_rankings(curve: str) -> float:
    """Return the number of pairs of bats that two curves rank in opposite order, 0 to 6.

    The four bats of the paper are ranked by the peak of `curve`, and by the peak of the batted-ball
    speed, both under standard game conditions with swing exponent 0. `curve` is ``restitution``,
    ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``. Pairs with a tie
    are not counted. Raises `KeyError` for an unknown curve.
    """
    return sum(
        (top(first, curve).value - top(second, curve).value) * peak_speed_lead(first, second) < 0
        for first, second in combinations(BATS, 2)
    )


def restitution_drop_with_speed() -> float:
    """Return the peak bat-ball restitution e of free R161 at 60 mph minus its peak at 160 mph.

    The peak is the largest e 3 to 8 in from the tip. The ball is ``baseball-2003``; its ball-wall
    restitution decreases with speed.
    """
    slow, fast = (restitution(WOOD, Z, speed=v, with_ball=BALL).max() for v in (60.0, 160.0))
    return float(slow - fast)


def restitution_gain_with_ball() -> float:
    """Return the increase of the peak bat-ball restitution e with a livelier ball.

    The bat is R161 without a support. The ball-wall restitution e0 rises from 0.525 to 0.555, the
    limits of the NCAA. The peak is the largest value of e at distances from the tip between 3 in
    and 8 in. The relative speed is 60 mph.
    """

    def peak_e(e0: float) -> float:
        scenes = Scenes.with_ball(
            paper_ball(BALL), impact_position=Z * INCH, relative_speed=60 * MPH
        )
        struck = replace(scenes, ball_restitution=np.full(Z.shape, e0))
        e_A = model(WOOD).collide(struck).collision_efficiency
        return float(np.asarray(restitution_from_efficiency(e_A, recoil(WOOD, Z))).max())

    return peak_e(0.555) - peak_e(0.525)
