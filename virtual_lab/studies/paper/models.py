"""Claims of Sec. III: the collision model, the swing, the wooden bat of Fig. 2, the game."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
    restitution_from_efficiency,
)
from virtual_lab.relations.peaks import peak
from virtual_lab.relations.swing import KNOB_OFFSET
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.studies.paper.claim import Claim, about, at_least, at_most, between
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    WOOD,
    Z,
    beam,
    body,
    game,
    lead,
    model,
    nominal,
    paper_ball,
    peak_of,
    profiled,
    recoil,
    top,
    top_of,
)
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2

__all__ = ["CLAIMS"]

ALGEBRA = "algebra: rounding alone"
STATED = "as stated in our data"
INERTIAS = np.linspace(1.5e4, 2.0e4, 11) * OZ_IN2  # those of measured swings
MASSES = np.arange(8.0, 124.1, 0.5)  # oz, of bats of one shape
BAT_OZ = 31.0


def _compression_free_restitution() -> float:
    """Return e0 of the ball's own curve of force: square root of work out over work in."""
    own = paper_ball()
    e0 = float(own.restitution.at(160 * MPH))
    a, b = own.exponent, (own.exponent + 1) / e0**2 - 1
    u = np.linspace(0, 1, 200_001)
    return float(np.sqrt(np.trapezoid(u**b, u) / np.trapezoid(u**a, u)))


def _wall_time() -> float:
    own = paper_ball()
    given = (own.mass, 160 * MPH, own.stiffness, own.exponent, 0.5)
    return float(wall_contact(*(np.array(number) for number in given)).time) * 1e3


def _modes_left_out(count: int) -> float:
    """Return how far the peak e_A of R161 with a few modes is from that with all kept here."""
    few = peak_of(model(WOOD, "free", count), Z).collision_efficiency.max()
    return float(few - peak_of(model(WOOD, "free", BENDING_MODES), Z).collision_efficiency.max())


def _highest_of(count: int) -> float:
    return float(model(WOOD).modes.bending_frequencies[count - 1]) / 1e3


def _lost(bat: str) -> float:
    """Return the least share of energy that is lost along a bat."""
    energy = peak_of(bat, Z).energy
    return float((energy.bending + energy.hoop + energy.hysteresis).min())


def _shell_frequency() -> float:
    hoop = body(ALUMINIUM).hoop
    assert hoop is not None
    return hoop.frequency / 1e3


def _shell_turns() -> float:
    """Return how many periods of the shell of EA70 a collision lasts."""
    return 1e3 * _shell_frequency() * float(peak_of(ALUMINIUM, [6.0]).contact_time[0])


def _dead_shell_factor() -> float:
    stiff = ModalModel.of(replace(body(ALUMINIUM), hoop=None), Free())
    e_A = peak_of(stiff, Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(ALUMINIUM, Z)))
    return float(e.max()) / 0.5


def _same_speed() -> float:
    speeds = np.asarray(game().swing(0.0).angular_speed(INERTIAS)) * np.ones_like(INERTIAS)
    return float(np.ptp(speeds) / speeds.mean())


def _kept(power: float, exponent: float) -> float:
    """Return how much I omega^power varies over the inertias, relative, by Eq. (13)."""
    kept = INERTIAS * np.asarray(game().swing(exponent).angular_speed(INERTIAS)) ** power
    return float(np.ptp(kept) / kept.mean())


def _best_mass(exponent: float) -> float:
    """Return the mass [oz] that maximises v_f among bats of R161's shape, e = 0.5, 6 in."""
    r = float(recoil(WOOD, 6.0)) * BAT_OZ / MASSES
    inertia = beam(WOOD).inertia(33 * INCH) * MASSES / BAT_OZ
    omega = np.asarray(game().swing(exponent).angular_speed(inertia))
    e_A = efficiency_from_restitution(0.5, r)
    v_f = np.asarray(batted_speed(e_A, 90.0, omega * 27 * INCH / MPH))
    return float(MASSES[int(v_f.argmax())])


def _energy_speeds() -> np.ndarray:
    """Return the law of constant energy over the inertias, for bats of R161's shape [rad/s]."""
    law, own = game().swing(None), beam(WOOD)
    about_body = own.inertia(own.length + law.axis_beyond_knob)
    return np.asarray(law.angular_speed(INERTIAS / own.inertia(33 * INCH) * about_body))


def _energy_exponent() -> float:
    return -float(np.polyfit(np.log(INERTIAS), np.log(_energy_speeds()), 1)[0])


def _laws_apart() -> float:
    """Return how far the laws are apart over the inertias with n = 0.3, per cent."""
    power = np.asarray(game().swing(0.3).angular_speed(INERTIAS))
    ratio = _energy_speeds() / power
    return 100 * float(np.abs(ratio / ratio.mean() - 1).max())


def _without_inertia() -> float:
    law = game().swing(None)
    return float(law.angular_speed(0.0)) / game().angular_speed


def _follows() -> float:
    """Return the correlation of e_A with e of R161 within 3 in of the peak of each."""
    table, off = profiled(WOOD)[0.0].table, np.arange(-3, 3.01, 0.25)
    curves = [
        np.interp(top(WOOD, what).place + off, table["z_in"], table[what]) for what in ("e", "e_A")
    ]
    return float(np.corrcoef(*curves)[0, 1])


def _flat_swing() -> float:
    """Return the place of the peak of v_f less that of e_A if the bat moved alike everywhere."""
    own = profiled(WOOD)[0.0]
    found = top_of(own.z / INCH, own.collision_efficiency, 90.0, 70.0)
    return found.place - top(WOOD, "e_A").place


def _least_recoil() -> float:
    z = np.arange(6, 18, 0.25)
    return peak(z, -recoil(WOOD, z)).place


CLAIMS: tuple[Claim, ...] = (
    about(
        "III A",
        "text",
        "the ball's curve of force gives back e0 = 0.50",
        0.5,
        1e-4,
        _compression_free_restitution,
        why="quadrature",
    ),
    at_least(
        "III A",
        "text",
        "a collision lasts at least 0.5 ms: R161 at 6 in",
        0.5,
        lambda: float(peak_of(WOOD, [6.0]).contact_time[0]) * 1e3,
        unit="ms",
        why="the bound in print",
    ),
    at_least(
        "III A",
        "text",
        "a collision lasts at least 0.5 ms: ball at the wall, 160 mph",
        0.5,
        _wall_time,
        unit="ms",
        why="the bound in print",
    ),
    between(
        "III A",
        "text",
        "the lowest four to six modes lie below a few kHz: sixth of R161",
        1.0,
        5.0,
        lambda: _highest_of(6),
        unit="kHz",
        why="a few: up to five",
    ),
    about(
        "III A",
        "text",
        "only those need be included: peak e_A of R161 by six modes less that by all",
        0.0,
        0.02,
        lambda: _modes_left_out(6),
        why="a tenth of e_A; see the command convergence",
    ),
    between(
        "III A",
        "text",
        "the lowest n = 2 mode of a hollow bat is at 2 to 3 kHz: EA70",
        2.0,
        3.0,
        _shell_frequency,
        unit="kHz",
        why="the range in print",
    ),
    at_least(
        "III A",
        "text",
        "that frequency exceeds the inverse of the collision time: product",
        1.0,
        _shell_turns,
        why="the bound in print",
    ),
    at_most(
        "III A",
        "text",
        "trampoline: EA70 dissipates less than R161, shares at their best",
        0.0,
        lambda: _lost(ALUMINIUM) - _lost(WOOD),
        why="a sign",
    ),
    at_least(
        "III A",
        "text",
        "trampoline: peak BPF of EA70 exceeds 1",
        1.0,
        lambda: top(ALUMINIUM, "BPF").value,
        why="the bound in print",
    ),
    at_most(
        "III A",
        "text",
        "and it is the shell's doing: peak BPF of EA70 with a dead shell",
        1.0,
        _dead_shell_factor,
        why="the bound in print",
    ),
    about(
        "III B",
        "text",
        "gain of v_f a mph of v_bat at e_A = 0.2",
        1.2,
        1e-12,
        lambda: float(batted_speed(0.2, 90.0, 71.0)) - float(batted_speed(0.2, 90.0, 70.0)),
        unit="mph",
        why=ALGEBRA,
    ),
    about(
        "III B",
        "text",
        "the bat turns about a point 1 in from the knob",
        1.0,
        1e-12,
        lambda: KNOB_OFFSET / INCH,
        unit="in",
        why=STATED,
    ),
    at_most(
        "III B",
        "Eq. (13)",
        "n = 0: the same bat speed at every I_knob, relative spread",
        1e-12,
        _same_speed,
        why=ALGEBRA,
    ),
    at_most(
        "III B",
        "Eq. (13)",
        "n = 0.5: the same kinetic energy, I omega^2, relative spread",
        1e-12,
        lambda: _kept(2, 0.5),
        why=ALGEBRA,
    ),
    at_most(
        "III B",
        "Eq. (13)",
        "n = 1/3: the same power, I omega^3, relative spread",
        1e-12,
        lambda: _kept(3, 1 / 3),
        why=ALGEBRA,
    ),
    at_least(
        "III B",
        "text",
        "n = 0: the best bat weight is unrealistically large",
        100.0,
        lambda: _best_mass(0.0),
        unit="oz",
        why="three times a bat's weight",
    ),
    at_most(
        "III B",
        "text",
        "n = 0.5: the best bat weight is unrealistically small",
        31.0,
        lambda: _best_mass(0.5),
        unit="oz",
        why="below the lightest 34 in bat that rules allow",
    ),
    about(
        "III B",
        "text",
        "measured n lies about half-way between 0 and 0.5: constant power, 1/3, less 0.3",
        0.0,
        0.05,
        lambda: 1 / 3 - 0.3,
    ),
    between(
        "III B",
        "text",
        "constant energy has a limit as the bat's inertia vanishes: omega over 45 rad/s",
        1.0,
        5.0,
        _without_inertia,
        why="finite, where Eq. (13) has none",
    ),
    about(
        "III B",
        "text",
        "it describes the data equally well: its n for I_knob of 1.5 to 2.0e4 oz in^2",
        0.3,
        0.05,
        _energy_exponent,
        why="≈ in print; our inertia of the batter is assumed",
    ),
    at_most(
        "III B",
        "text",
        "over that range it is Eq. (13): greatest difference of omega",
        1.0,
        _laws_apart,
        unit="%",
        why="no swing is measured to 1 %",
    ),
    between(
        "III B",
        "text",
        "no conclusion depends on the law: EA70 over R161 by constant energy",
        0.0,
        6.5,
        lambda: lead(ALUMINIUM, WOOD, None),
        unit="mph",
        why="the paper's limits",
    ),
    at_least(
        "III B",
        "text",
        "no conclusion depends on the law: barrel- over knob-loaded by constant energy",
        0.5,
        lambda: lead("barrel-loaded", "knob-loaded", None),
        unit="mph",
        why="plain beside the model's error",
    ),
    about(
        "III C", "text", "length of R161", 34.0, 0.005, lambda: beam(WOOD).length / INCH, unit="in"
    ),
    about(
        "III C", "text", "weight of R161", 31.0, 0.05, lambda: beam(WOOD).mass / OUNCE, unit="oz"
    ),
    about(
        "III C",
        "text",
        "45 rad/s about 1 in from the knob: v_bat 6 in from the tip",
        70.0,
        1.0,
        lambda: 45 * 27 * INCH / MPH,
        unit="mph",
        why="69.0 rounded to ten",
    ),
    between(
        "III C",
        "Fig. 2",
        "e peaks roughly between the first and second nodes: R161",
        5.1,
        6.9,
        lambda: top(WOOD, "e").place,
        unit="in",
        why="roughly: Table I's 5.2 to 6.8 in and 0.1",
    ),
    about(
        "III C",
        "Fig. 2",
        "the greatest e is close to e0 = 0.50",
        0.5,
        0.01,
        lambda: top(WOOD, "e").value,
        why="close: 2 %",
    ),
    about(
        "III C",
        "Fig. 2",
        "r is least at the c.m., about 12 in from the tip",
        12.0,
        1.0,
        _least_recoil,
        unit="in",
        why="about: Table I says 11.3",
    ),
    between(
        "III C",
        "Fig. 2",
        "e_A peaks a little farther from the tip than e",
        0.05,
        1.5,
        lambda: top(WOOD, "e_A").place - top(WOOD, "e").place,
        unit="in",
        why="a little: up to 1.5 in",
    ),
    at_least(
        "III C",
        "Fig. 2",
        "otherwise e_A mainly follows e: correlation, 3 in either side of the peaks",
        0.9,
        _follows,
        why="mainly",
    ),
    about(
        "III C",
        "Fig. 2",
        "were v_bat the same at every place, v_f would peak where e_A does",
        0.0,
        1e-9,
        _flat_swing,
        unit="in",
        why=ALGEBRA,
    ),
    at_least(
        "III C",
        "Fig. 2",
        "v_f peaks closer to the tip than e_A: by",
        0.05,
        lambda: top(WOOD, "e_A").place - top(WOOD, "v_f_mph").place,
        unit="in",
        why="a sign, plain beside the step",
    ),
    at_least(
        "III C",
        "Fig. 2",
        "v_bat is larger closer to the tip: 3 in less 9 in",
        1.0,
        lambda: float(nominal(WOOD, 3) - nominal(WOOD, 9)),
        unit="mph",
        why="a sign",
    ),
    about(
        "III D",
        "text",
        "standard game: e0",
        0.5,
        1e-12,
        lambda: float(paper_ball().restitution.at(160 * MPH)),
        why=STATED,
    ),
    about(
        "III D",
        "text",
        "standard game: v_ball",
        90.0,
        1e-9,
        lambda: game().pitch_speed / MPH,
        unit="mph",
        why=STATED,
    ),
    about(
        "III D",
        "Eq. (14)",
        "standard game: omega_0",
        45.0,
        1e-9,
        lambda: game().angular_speed,
        unit="rad/s",
        why=STATED,
    ),
    about(
        "III D",
        "Eq. (14)",
        "standard game: I_0",
        1.7e4,
        1e-6,
        lambda: game().reference_inertia / OZ_IN2,
        unit="oz in^2",
        why=STATED,
    ),
)
