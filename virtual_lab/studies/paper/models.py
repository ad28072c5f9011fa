"""Results for Sec. III: collision model, swing, the wooden bat of Fig. 2, the game."""

from __future__ import annotations

import numpy as np

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
)
from virtual_lab.relations.peaks import peak
from virtual_lab.relations.swing import KNOB_OFFSET
from virtual_lab.simulation.collision.modal import BENDING_MODES
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    WOOD,
    Z,
    beam,
    body,
    collide_at,
    energy_loss,
    game,
    game_bat_speed,
    model,
    paper_ball,
    profiles_by_swing,
    recoil,
    top,
    top_of,
)
from virtual_lab.units import INCH, MPH, OZ_IN2

INERTIAS = np.linspace(1.5e4, 2.0e4, 11) * OZ_IN2  # range of bats in the measured swings


def compression_free_restitution() -> float:
    """Return e0 of the game's ball by its force law, √(work of expansion / work of compression)."""
    ball = paper_ball()
    e0 = float(ball.restitution.at(160 * MPH))
    a, b = ball.exponent, (ball.exponent + 1) / e0**2 - 1
    u = np.linspace(0, 1, 200_001)
    return float(np.sqrt(np.trapezoid(u**b, u) / np.trapezoid(u**a, u)))


def wall_time() -> float:
    """Return the contact time of the game's ball on a rigid wall at 160 mph [ms]."""
    ball = paper_ball()
    arguments = (ball.mass, 160 * MPH, ball.stiffness, ball.exponent, 0.5)
    return float(wall_contact(*(np.array(number) for number in arguments)).time) * 1e3


def modes_left_out(count: int) -> float:
    """Return the peak e_A of free R161 with `count` bending modes minus that with all modes.

    "All modes" are those that this program uses by default. The relative speed is 160 mph.
    """
    few = collide_at(model(WOOD, "free", count), Z).collision_efficiency.max()
    return float(few - collide_at(model(WOOD, "free", BENDING_MODES), Z).collision_efficiency.max())


def bending_frequency(count: int) -> float:
    """Return the frequency [kHz] of bending mode `count` of the free bat R161.

    Mode 1 is the lowest. Raises `IndexError` for a mode beyond those of the model.
    """
    return float(model(WOOD).modes.bending_frequencies[count - 1]) / 1e3


def less_lost() -> float:
    """Return the smallest lost share of energy on EA70 minus the smallest lost share on R161.

    The share is a fraction of the ball's initial energy. For each free bat, the smallest share over
    impacts 3 to 8 in from the tip at 160 mph is used. The result is negative if EA70 loses less.
    """
    aluminium, wood = (float(energy_loss(collide_at(bat, Z)).min()) for bat in (ALUMINIUM, WOOD))
    return aluminium - wood


def shell_frequency() -> float:
    """Return the frequency of the hoop mode of EA70 [kHz]."""
    hoop = body(ALUMINIUM).hoop
    assert hoop is not None
    return hoop.frequency / 1e3


def shell_turns() -> float:
    """Return the number of periods of the hoop mode of EA70 during the contact with a ball.

    The bat is free and is hit 6 in from the tip, at 160 mph.
    """
    return 1e3 * shell_frequency() * float(collide_at(ALUMINIUM, [6.0]).contact_time[0])


def same_speed() -> float:
    """Return the relative spread of the angular speeds of the measured swings, by the swing law.

    It is the largest minus the smallest speed, divided by the mean, for moments of inertia of 15000
    to 20000 oz in^2. The exponent of the law is 0, so the result is 0.
    """
    speeds = np.asarray(game().swing(0.0).angular_speed(INERTIAS)) * np.ones_like(INERTIAS)
    return float(np.ptp(speeds) / speeds.mean())


def variation_of_power(power: float, exponent: float) -> float:
    """Return the relative variation of I omega^power over the bats of the measured swings.

    It is the largest minus the smallest value, divided by the mean. The moment of inertia I is
    15000 to 20000 oz in^2. Eq. (13) gives the angular speed omega for the swing exponent
    `exponent`.
    """
    quantity = INERTIAS * np.asarray(game().swing(exponent).angular_speed(INERTIAS)) ** power
    return float(np.ptp(quantity) / quantity.mean())


def best_mass(exponent: float) -> float:
    """Return the mass of the bat with the largest v_f [oz], from 8 to 124 oz in steps of 0.5 oz.

    The bats have the shape of R161 and e = 0.5, and are hit 6 in from the tip. The pitch speed is
    90 mph. `exponent` is the n of the swing law.
    """
    mass = np.arange(8.0, 124.1, 0.5)
    r = float(recoil(WOOD, 6.0)) * 31.0 / mass
    inertia = beam(WOOD).inertia(33 * INCH) * mass / 31.0
    omega = np.asarray(game().swing(exponent).angular_speed(inertia))
    e_A = efficiency_from_restitution(0.5, r)
    v_f = np.asarray(batted_speed(e_A, 90.0, omega * 27 * INCH / MPH))
    return float(mass[int(v_f.argmax())])


def energy_speeds() -> np.ndarray:
    """Return the angular speed for a swing of constant energy [rad/s], shape (11,).

    The bats are copies of R161 with scaled moments of inertia: 11 values from 15000 to 20000 oz
    in^2, about an axis 33 in from the tip.
    """
    law, bat_beam = game().swing(None), beam(WOOD)
    about_body = bat_beam.inertia(bat_beam.length + law.axis_beyond_knob)
    return np.asarray(law.angular_speed(INERTIAS / bat_beam.inertia(33 * INCH) * about_body))


def energy_exponent() -> float:
    """Return the exponent n of the power law that is closest to a swing of constant energy.

    It is fitted to the angular speeds at moments of inertia of 15000 to 20000 oz in^2.
    """
    return -float(np.polyfit(np.log(INERTIAS), np.log(energy_speeds()), 1)[0])


def laws_apart() -> float:
    """Return the largest absolute difference of angular speed between the two swing laws [%].

    The laws are that of constant energy and the power law with n = 0.3, scaled to the same mean.
    Moments of inertia are 15000 to 20000 oz in^2.
    """
    power = np.asarray(game().swing(0.3).angular_speed(INERTIAS))
    ratio = energy_speeds() / power
    return 100 * float(np.abs(ratio / ratio.mean() - 1).max())


def without_inertia() -> float:
    """Return the angular speed of a bat without inertia, divided by the angular speed of the game.

    Both swings have the same energy. The angular speed of the game is that of a bat with the
    reference inertia.
    """
    law = game().swing(None)
    return float(law.angular_speed(0.0)) / game().angular_speed


def follows() -> float:
    """Return the correlation coefficient of the curves e_A and e of R161 near their peaks.

    The curves are shifted so that their peaks coincide. They are compared within 3 in of the peak,
    in the standard game with swing exponent 0.
    """
    table, distances = profiles_by_swing(WOOD)[0.0].table, np.arange(-3, 3.01, 0.25)
    curves = [
        np.interp(top(WOOD, curve).place + distances, table["impact_position_in"], table[curve])
        for curve in ("restitution", "collision_efficiency")
    ]
    return float(np.corrcoef(*curves)[0, 1])


def flat_swing() -> float:
    """Return the peak position of v_f minus that of e_A on R161 [in], for a swing without rotation.

    The pitch speed is 90 mph, and every point of the bat moves at 70 mph. A positive result is
    toward the handle.
    """
    table = profiles_by_swing(WOOD)[0.0].table
    highest = top_of(table["impact_position_in"], table["collision_efficiency"], 90.0, 70.0)
    return highest.place - top(WOOD, "collision_efficiency").place


def least_recoil() -> float:
    """Return the position of the smallest r of free R161 [in from the tip].

    It is searched from 6 to 17.75 in from the tip.
    """
    z = np.arange(6, 18, 0.25)
    return peak(z, -recoil(WOOD, z)).place


def contact_time(bat: str) -> float:
    """Return the contact time of a ball and a free bat, 6 in from the tip at 160 mph [ms].

    Raises `InputError` for an unknown bat.
    """
    return float(collide_at(bat, [6.0]).contact_time[0]) * 1e3


def gain_with_bat_speed() -> float:
    """Return the change of v_f per unit of bat speed, for e_A = 0.2; it is 1 + e_A."""
    return float(batted_speed(0.2, 90.0, 71.0)) - float(batted_speed(0.2, 90.0, 70.0))


def swing_axis() -> float:
    """Return the distance from the knob end to the axis of the swing, which is on the bat [in]."""
    return KNOB_OFFSET / INCH


def constant_power_exponent() -> float:
    """Return the swing exponent n for constant power, 1/3, minus that of measured swings, 0.3."""
    return 1 / 3 - 0.3


def swing_speed() -> float:
    """Return the bat speed 27 in from the axis at 45 rad/s [mph]."""
    return 45 * 27 * INCH / MPH


def peaks_apart(farther: str, nearer: str) -> float:
    """Return the peak position of the curve `farther` on R161 minus that of `nearer` [in].

    A positive result is toward the handle. Both curves are ``restitution``,
    ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``, in the standard
    game with swing exponent 0. Raises `KeyError` for another curve.
    """
    return top(WOOD, farther).place - top(WOOD, nearer).place


def speed_lost_inward() -> float:
    """Return the bat speed of R161 at 3 in from the tip minus that at 9 in [mph].

    The bat is swung in the standard game with swing exponent 0.
    """
    return float(game_bat_speed(WOOD, 3) - game_bat_speed(WOOD, 9))


def pitch_speed() -> float:
    """Return the pitch speed of the game [mph]."""
    return game().pitch_speed / MPH


def angular_speed() -> float:
    """Return the angular speed of the game's swing for the reference inertia [rad/s]."""
    return game().angular_speed


def reference_inertia() -> float:
    """Return the moment of inertia at which a bat swings at the game's angular speed [oz in^2]."""
    return game().reference_inertia / OZ_IN2
