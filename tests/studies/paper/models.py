"""Results for Sec. III: collision model, swing, the wooden bat of Fig. 2, the game."""

from __future__ import annotations

import numpy as np

from tests.studies.paper.computed import (
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
    peak_speed,
    profiles_by_swing,
    recoil,
    top,
)
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
)
from virtual_lab.relations.peaks import peak
from virtual_lab.relations.swing import KNOB_OFFSET
from virtual_lab.simulation.collision.modal import BENDING_MODES
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.units import INCH, MPH, OZ_IN2

INERTIAS = np.linspace(1.5e4, 2.0e4, 11) * OZ_IN2  # range of bats in the measured swings


def compression_free_restitution() -> float:
    """Return the ball-wall restitution e0 of the paper's ball, computed from its force law.

    It is √(work of expansion / work of compression), with the exponents of the force law at 160
    mph.
    """
    ball = paper_ball()
    e0 = float(ball.restitution.at(160 * MPH))
    a, b = ball.exponent, (ball.exponent + 1) / e0**2 - 1
    u = np.linspace(0, 1, 200_001)
    return float(np.sqrt(np.trapezoid(u**b, u) / np.trapezoid(u**a, u)))


def wall_time() -> float:
    """Return the contact time [ms] of the paper's ball on a rigid wall at 160 mph."""
    ball = paper_ball()
    arguments = (ball.mass, 160 * MPH, ball.stiffness, ball.exponent, 0.5)
    return float(wall_contact(*(np.array(number) for number in arguments)).time) * 1e3


def truncation_error(count: int) -> float:
    """Return the peak e_A of R161 for `count` bending modes minus the peak for the default number.

    e_A is the collision efficiency. The bat is free and is hit 3 to 8 in from the tip, at 160 mph.
    The default number is `BENDING_MODES`.
    """
    few = collide_at(model(WOOD, "free", count), Z).collision_efficiency.max()
    return float(few - collide_at(model(WOOD, "free", BENDING_MODES), Z).collision_efficiency.max())


def bending_frequency(count: int) -> float:
    """Return the frequency [kHz] of a bending mode of the free bat R161, the wood bat of the paper.

    `count` is the number of the mode, 1 for the lowest.
    """
    return model(WOOD).modes.bending_frequencies[count - 1] / 1e3


def smallest_loss_difference() -> float:
    """Return the smallest energy loss on EA70 minus the smallest energy loss on R161.

    A loss is the energy of vibration and the loss in the ball, divided by the ball's initial
    energy. For each free bat, it is the smallest over impacts 3 to 8 in from the tip, at 160 mph. A
    negative result means that EA70 loses less.
    """
    aluminium, wood = (float(energy_loss(collide_at(bat, Z)).min()) for bat in (ALUMINIUM, WOOD))
    return aluminium - wood


def shell_frequency() -> float:
    """Return the frequency of the hoop mode of EA70, the aluminum bat of the paper [kHz]."""
    hoop = body(ALUMINIUM).hoop
    assert hoop is not None
    return hoop.frequency / 1e3


def contact_in_periods() -> float:
    """Return the contact time of a ball on EA70, in periods of the bat's hoop mode.

    The bat is free and is hit 6 in from the tip, at 160 mph.
    """
    return 1e3 * shell_frequency() * float(collide_at(ALUMINIUM, [6.0]).contact_time[0])


def angular_speed_range() -> float:
    """Return the relative range of angular speed for the swing exponent 0.

    The range is the largest minus the smallest angular speed, divided by the mean, for bats with
    moments of inertia of 15000 to 20000 oz in^2. The result is 0, because all bats have the same
    angular speed for this exponent.
    """
    speeds = np.asarray(game().swing(0.0).angular_speed(INERTIAS)) * np.ones_like(INERTIAS)
    return float(np.ptp(speeds) / speeds.mean())


def variation_of_power(power: float, exponent: float) -> float:
    """Return the relative range of the quantity I omega^power over bats of different inertia.

    The range is the largest minus the smallest value, divided by the mean. I is the bat's moment of
    inertia, 15000 to 20000 oz in^2. omega is the angular speed of the swing by Eq. (13), with the
    swing exponent `exponent`.
    """
    quantity = INERTIAS * np.asarray(game().swing(exponent).angular_speed(INERTIAS)) ** power
    return float(np.ptp(quantity) / quantity.mean())


def best_mass(exponent: float) -> float:
    """Return the mass [oz] of the bat with the largest batted-ball speed.

    Masses of 8 to 124 oz are compared in steps of 0.5 oz. The bats have the shape of R161, and e is
    0.5 for all. They are hit 6 in from the tip, and the pitch speed is 90 mph. `exponent` is the n
    of the swing law.
    """
    mass = np.arange(8.0, 124.1, 0.5)
    r = float(recoil(WOOD, 6.0)) * 31.0 / mass
    inertia = beam(WOOD).inertia(33 * INCH) * mass / 31.0
    omega = np.asarray(game().swing(exponent).angular_speed(inertia))
    e_A = efficiency_from_restitution(0.5, r)
    v_f = np.asarray(batted_speed(e_A, 90.0, omega * 27 * INCH / MPH))
    return float(mass[int(v_f.argmax())])


def energy_speeds() -> np.ndarray:
    """Return the angular speeds of 11 bats that are swung with the same energy [rad/s], (11,).

    The bats are copies of the wood bat R161 with scaled mass. Their moments of inertia about an
    axis 33 in from the tip are 15000 to 20000 oz in^2, in equal steps. The energy is the kinetic
    energy of bat and batter together.
    """
    law, bat_beam = game().swing(None), beam(WOOD)
    about_body = bat_beam.inertia(bat_beam.length + law.axis_beyond_knob)
    return np.asarray(law.angular_speed(INERTIAS / bat_beam.inertia(33 * INCH) * about_body))


def energy_exponent() -> float:
    """Return the exponent n of the power law that approximates a swing of constant energy.

    The power law is fitted to `energy_speeds`, for moments of inertia of 15000 to 20000 oz in^2.
    """
    return -float(np.polyfit(np.log(INERTIAS), np.log(energy_speeds()), 1)[0])


def swing_law_difference() -> float:
    """Return the largest difference of angular speed between two swing laws [%].

    One law keeps the energy constant. The other is the power law with n = 0.3. The angular speed is
    computed by both laws for moments of inertia from 15000 to 20000 oz in^2. The ratio of the two
    speeds is divided by its mean. The result is the largest absolute deviation of this ratio from
    1, in percent.
    """
    power = np.asarray(game().swing(0.3).angular_speed(INERTIAS))
    ratio = energy_speeds() / power
    return 100 * float(np.abs(ratio / ratio.mean() - 1).max())


def bare_swing_ratio() -> float:
    """Return the angular speed of a swing without a bat, divided by the angular speed with a bat.

    Both swings have the same energy. The bat has the reference inertia of the paper's standard
    game.
    """
    law = game().swing(None)
    return float(law.angular_speed(0.0)) / game().angular_speed


def curve_correlation() -> float:
    """Return the correlation coefficient of the curves of e_A and e of R161 near their peaks.

    e_A is the collision efficiency, and e the bat-ball restitution. The curves are shifted along
    the bat until their peaks coincide. They are compared within 3 in of the peak. They are computed
    under standard game conditions with swing exponent 0.
    """
    table, distances = profiles_by_swing(WOOD)[0.0].table, np.arange(-3, 3.01, 0.25)
    curves = [
        np.interp(top(WOOD, curve).place + distances, table["impact_position_in"], table[curve])
        for curve in ("restitution", "collision_efficiency")
    ]
    return float(np.corrcoef(*curves)[0, 1])


def peak_separation() -> float:
    """Return the distance [in] from the peak of e_A to the peak of v_f, without rotation.

    v_f is the batted-ball speed, and e_A the collision efficiency. The bat is R161. Every point of
    it moves at 70 mph, and the pitch speed is 90 mph. A positive distance is toward the handle.
    """
    table = profiles_by_swing(WOOD)[0.0].table
    highest = peak_speed(table["impact_position_in"], table["collision_efficiency"], 90.0, 70.0)
    return highest.place - top(WOOD, "collision_efficiency").place


def least_recoil_position() -> float:
    """Return the position [in from the tip] of the smallest recoil factor r of free R161.

    The search covers 6 to 17.75 in from the tip.
    """
    z = np.arange(6, 18, 0.25)
    return peak(z, -recoil(WOOD, z)).place


def contact_time(bat: str) -> float:
    """Return the contact time [ms] of a ball and a free bat, 6 in from the tip at 160 mph.

    Raises `InputError` for an unknown bat.
    """
    return float(collide_at(bat, [6.0]).contact_time[0]) * 1e3


def gain_with_bat_speed() -> float:
    """Return the increase of batted-ball speed per unit of bat speed, 1 + e_A, for e_A = 0.2."""
    return float(batted_speed(0.2, 90.0, 71.0)) - float(batted_speed(0.2, 90.0, 70.0))


def swing_axis() -> float:
    """Return the distance of the swing axis from the knob end [in]; the axis is on the handle."""
    return KNOB_OFFSET / INCH


def constant_power_exponent() -> float:
    """Return the swing exponent for constant power minus the measured exponent, 1/3 - 0.3.

    The angular speed of a swing is proportional to I^-n. I is the moment of inertia of the bat, and
    n is the swing exponent. If the power of the batter is constant, n is 1/3. The measured value is
    0.3.
    """
    return 1 / 3 - 0.3


def swing_speed() -> float:
    """Return the bat speed [mph] at 27 in from the axis of rotation, at 45 rad/s."""
    return 45 * 27 * INCH / MPH


def peak_distance(farther: str, nearer: str) -> float:
    """Return the distance [in] from the peak of curve `nearer` of R161 to the peak of `farther`.

    A positive distance is toward the handle. Each curve is ``restitution``,
    ``bat_performance_factor``, ``collision_efficiency`` or ``batted_speed_mph``, under standard
    game conditions with swing exponent 0. Raises `KeyError` for another curve.
    """
    return top(WOOD, farther).place - top(WOOD, nearer).place


def bat_speed_drop() -> float:
    """Return the bat speed at 3 in from the tip of R161 minus the bat speed at 9 in [mph].

    The bat is swung under standard game conditions with swing exponent 0.
    """
    return float(game_bat_speed(WOOD, 3) - game_bat_speed(WOOD, 9))


def pitch_speed() -> float:
    """Return the pitch speed of the standard game conditions [mph]."""
    return game().pitch_speed / MPH


def angular_speed() -> float:
    """Return the angular speed of a bat with the reference inertia [rad/s].

    The bat is swung under standard game conditions.
    """
    return game().angular_speed


def reference_inertia() -> float:
    """Return the reference inertia of the swing law under standard game conditions [oz in^2].

    A bat with this moment of inertia is swung at the angular speed that `angular_speed` returns.
    """
    return game().reference_inertia / OZ_IN2
