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
    game,
    lost,
    model,
    nominal,
    paper_ball,
    peak_of,
    profiled,
    recoil,
    top,
    top_of,
)
from virtual_lab.units import INCH, MPH, OZ_IN2

INERTIAS = np.linspace(1.5e4, 2.0e4, 11) * OZ_IN2  # range of measured swings


def compression_free_restitution() -> float:
    """Return e0 of the ball's own curve of force: square root of work out over work in."""
    own = paper_ball()
    e0 = float(own.restitution.at(160 * MPH))
    a, b = own.exponent, (own.exponent + 1) / e0**2 - 1
    u = np.linspace(0, 1, 200_001)
    return float(np.sqrt(np.trapezoid(u**b, u) / np.trapezoid(u**a, u)))


def wall_time() -> float:
    own = paper_ball()
    given = (own.mass, 160 * MPH, own.stiffness, own.exponent, 0.5)
    return float(wall_contact(*(np.array(number) for number in given)).time) * 1e3


def modes_left_out(count: int) -> float:
    """Return the difference in peak e_A of R161 between `count` modes and all modes used here."""
    few = peak_of(model(WOOD, "free", count), Z).collision_efficiency.max()
    return float(few - peak_of(model(WOOD, "free", BENDING_MODES), Z).collision_efficiency.max())


def highest_of(count: int) -> float:
    return float(model(WOOD).modes.bending_frequencies[count - 1]) / 1e3


def less_lost() -> float:
    """Return the least share of energy that is lost along EA70 less that along R161."""
    aluminium, wood = (float(lost(peak_of(bat, Z)).min()) for bat in (ALUMINIUM, WOOD))
    return aluminium - wood


def shell_frequency() -> float:
    hoop = body(ALUMINIUM).hoop
    assert hoop is not None
    return hoop.frequency / 1e3


def shell_turns() -> float:
    """Return the duration of a collision in periods of the shell of EA70."""
    return 1e3 * shell_frequency() * float(peak_of(ALUMINIUM, [6.0]).contact_time[0])


def same_speed() -> float:
    speeds = np.asarray(game().swing(0.0).angular_speed(INERTIAS)) * np.ones_like(INERTIAS)
    return float(np.ptp(speeds) / speeds.mean())


def kept(power: float, exponent: float) -> float:
    """Return the relative variation of I omega^power over the inertias, by Eq. (13)."""
    kept = INERTIAS * np.asarray(game().swing(exponent).angular_speed(INERTIAS)) ** power
    return float(np.ptp(kept) / kept.mean())


def best_mass(exponent: float) -> float:
    """Return the mass [oz] that maximises v_f among bats of R161's shape, e = 0.5, 6 in."""
    mass = np.arange(8.0, 124.1, 0.5)
    r = float(recoil(WOOD, 6.0)) * 31.0 / mass
    inertia = beam(WOOD).inertia(33 * INCH) * mass / 31.0
    omega = np.asarray(game().swing(exponent).angular_speed(inertia))
    e_A = efficiency_from_restitution(0.5, r)
    v_f = np.asarray(batted_speed(e_A, 90.0, omega * 27 * INCH / MPH))
    return float(mass[int(v_f.argmax())])


def energy_speeds() -> np.ndarray:
    """Return the law of constant energy over the inertias, for bats of R161's shape [rad/s]."""
    law, own = game().swing(None), beam(WOOD)
    about_body = own.inertia(own.length + law.axis_beyond_knob)
    return np.asarray(law.angular_speed(INERTIAS / own.inertia(33 * INCH) * about_body))


def energy_exponent() -> float:
    return -float(np.polyfit(np.log(INERTIAS), np.log(energy_speeds()), 1)[0])


def laws_apart() -> float:
    """Return the largest difference of the laws over the inertias, for n = 0.3 [%]."""
    power = np.asarray(game().swing(0.3).angular_speed(INERTIAS))
    ratio = energy_speeds() / power
    return 100 * float(np.abs(ratio / ratio.mean() - 1).max())


def without_inertia() -> float:
    law = game().swing(None)
    return float(law.angular_speed(0.0)) / game().angular_speed


def follows() -> float:
    """Return the correlation of e_A with e of R161 within 3 in of the peak of each."""
    table, off = profiled(WOOD)[0.0].table, np.arange(-3, 3.01, 0.25)
    curves = [
        np.interp(top(WOOD, what).place + off, table["z_in"], table[what]) for what in ("e", "e_A")
    ]
    return float(np.corrcoef(*curves)[0, 1])


def flat_swing() -> float:
    """Return the place of the peak of v_f less that of e_A if the bat moved alike everywhere."""
    table = profiled(WOOD)[0.0].table
    found = top_of(table["z_in"], table["e_A"], 90.0, 70.0)
    return found.place - top(WOOD, "e_A").place


def least_recoil() -> float:
    z = np.arange(6, 18, 0.25)
    return peak(z, -recoil(WOOD, z)).place


def contact_time(bat: str) -> float:
    """Return the contact time of a ball and a free bat, 6 in from the tip at 160 mph [ms]."""
    return float(peak_of(bat, [6.0]).contact_time[0]) * 1e3


def gain_with_bat_speed() -> float:
    return float(batted_speed(0.2, 90.0, 71.0)) - float(batted_speed(0.2, 90.0, 70.0))


def swing_axis() -> float:
    return KNOB_OFFSET / INCH


def constant_power_exponent() -> float:
    """Return the difference between n of constant power and the 0.3 of measured swings."""
    return 1 / 3 - 0.3


def speed_of_swing() -> float:
    """Return v_bat 27 in from the axis at 45 rad/s [mph]."""
    return 45 * 27 * INCH / MPH


def peaks_apart(farther: str, nearer: str) -> float:
    return top(WOOD, farther).place - top(WOOD, nearer).place


def speed_lost_inward() -> float:
    """Return v_bat of R161 3 in from the tip less that 9 in from it [mph]."""
    return float(nominal(WOOD, 3) - nominal(WOOD, 9))


def pitch_speed() -> float:
    return game().pitch_speed / MPH


def angular_speed() -> float:
    return game().angular_speed


def reference_inertia() -> float:
    return game().reference_inertia / OZ_IN2
