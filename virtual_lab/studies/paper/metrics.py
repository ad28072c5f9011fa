"""Claims of Sec. II: the metrics, their algebra, and the paper's worked numbers."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    batted_speed_gain,
    besr,
    collision_efficiency,
    efficiency_from_restitution,
    energy_fractions,
    parallel_axis,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.studies.paper.claim import Claim, about, at_least, at_most, between
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BARREL,
    BATS,
    KNOB,
    WOOD,
    Z,
    beam,
    body,
    centre_of_percussion_in,
    paper_ball,
    peak_of,
    profiled,
    recoil,
    restitution,
    support,
    top,
)
from virtual_lab.units import INCH, MPH

__all__ = ["CLAIMS"]

Array = NDArray[np.float64]
ALGEBRA = "algebra: rounding alone"
MODES = "modes left out of the model"
ROUNDING = 1e-12
MODEL = 3e-4  # of e_A, by the number of modes (see the command convergence)
SLOW, FAST = 60.0, 160.0  # mph
RESTITUTIONS, RECOILS = np.meshgrid(np.linspace(0, 1, 11), np.linspace(0, 0.5, 11))


def _worst(values: Array) -> float:
    return float(np.abs(values).max())


def _frames() -> float:
    """Return how far e_A read in the field by Eq. (2) is from that in the bat's frame."""
    e_A = peak_of(WOOD, Z).collision_efficiency
    v_bat = np.linspace(-50, 160, 8)[:, None]
    v_f = e_A * FAST + v_bat  # the bat's frame moves at v_bat
    return _worst(np.asarray(collision_efficiency(FAST - v_bat, v_bat, v_f)) - e_A)


def _round_trip() -> float:
    e_A = np.linspace(-0.2, 0.6, 9)
    v_f = batted_speed(e_A, 90.0, 70.0)
    return _worst(np.asarray(collision_efficiency(90.0, 70.0, v_f)) - e_A)


def _symmetrical() -> float:
    e_A = np.linspace(-0.2, 0.6, 9)
    factor = np.asarray(besr(e_A))
    direct = np.asarray(batted_speed(e_A, 90.0, 70.0))
    return _worst((factor - 0.5) * 90 + (factor + 0.5) * 70 - direct)


def _slope(bat: str) -> float:
    """Return the change of peak e_A per mph of relative speed about 150 mph."""
    slow, fast = (
        peak_of(bat, Z, speed=v, with_ball=BALL).collision_efficiency.max() for v in (140, 160)
    )
    return float(fast - slow) / 20


def _explicit_share(v: str) -> float:
    """Return the share of the explicit factor of Eq. (3) in the change of v_f with a speed."""
    e_A = top(WOOD, "e_A").value
    factor = e_A if v == "ball" else 1 + e_A
    return factor / (factor + abs(160 * _slope(WOOD)))


def _drop(bat: str, what: str, side: float) -> float:
    """Return how far a curve falls within 3 in of its peak."""
    summit, table = top(bat, what), profiled(bat)[0.0].table
    return summit.value - float(np.interp(summit.place + side, table["z_in"], table[what]))


def _node_gap(bat: str) -> float:
    place = top(bat, "e_A").place
    return min(abs(place - node / INCH) for node in profiled(bat)[0.0].nodes)


def _held(bat: str, held: str) -> float:
    gap = peak_of(bat, Z, held=held).collision_efficiency - peak_of(bat, Z).collision_efficiency
    return _worst(gap)


def _firmness() -> float:
    """Return how far v_f of a bat held by a spring of 1e6 N/m is from a clamped one's [mph]."""
    held = peak_of(WOOD, Z, held="held").collision_efficiency
    return FAST * _worst(held - peak_of(WOOD, Z, held="clamped").collision_efficiency)


def _lost_in_cm_frame() -> float:
    """Return the model's loss over the energy in the frame of the centre of mass, less 1 - e²."""
    z = np.linspace(2, 10, 9)
    found, r = peak_of(WOOD, z), recoil(WOOD, z)
    lost = found.energy.bending + found.energy.hoop + found.energy.hysteresis
    e = np.asarray(restitution_from_efficiency(found.collision_efficiency, r))
    return _worst(lost * (1 + r) - (1 - e**2))


def _fractions(name: str) -> float:
    """Return how far the model's own energies are from Eqs. (10)."""
    z = np.linspace(2, 10, 9)
    gaps = []
    for bat in (WOOD, ALUMINIUM):
        found, r = peak_of(bat, z), recoil(bat, z)
        e = np.asarray(restitution_from_efficiency(found.collision_efficiency, r))
        shares = energy_fractions(e, r)
        energy = found.energy
        lost = energy.bending + energy.hoop + energy.hysteresis
        own = {"ball": energy.ball, "bat": energy.rigid, "dissipated": lost}[name]
        gaps.append(_worst(own - np.asarray(getattr(shares, name))))
    return max(gaps)


def _sum_of_shares() -> float:
    """Return the sum of Eqs. (10) that is farthest from 1, at any e and r."""
    shares = energy_fractions(RESTITUTIONS, RECOILS)
    total = np.ravel(np.asarray(shares.ball) + shares.bat + shares.dissipated)
    return float(total[np.abs(total - 1).argmax()])


def _inverse_mass(held: str) -> float:
    """Return how far Eq. (8) or (9) is from the rigid modes of the finite elements, relative."""
    z, gaps = np.linspace(0.5, 20, 40), []
    for bat in BATS:
        modes = modes_of(body(bat), support(held), 0)
        shapes = modes.shape(z * INCH)[:, : modes.rigid]
        found = paper_ball().mass * np.sum(shapes**2, axis=1)
        gaps.append(_worst(found / recoil(bat, z, held) - 1))
    return max(gaps)


def _parallel_axis() -> float:
    own = beam(WOOD)
    pivot = own.length - 6 * INCH
    moved = parallel_axis(own.inertia_cm, own.mass, pivot - own.z_cm)
    return float(moved) / own.inertia(pivot) - 1


def _nearer_is_heavier() -> float:
    """Return the least rise of the effective mass a step nearer the centre of mass, relative."""
    least = np.inf
    for bat in BATS:
        z = np.linspace(0, beam(bat).z_cm / INCH, 30)
        least = min(least, float((-np.diff(recoil(bat, z)) / recoil(bat, z)[1:]).min()))
    return least


def _rise_with_lighter_recoil() -> float:
    """Return the least fall of e_A a step of r, at any e."""
    e_A = np.asarray(efficiency_from_restitution(RESTITUTIONS, RECOILS))
    return float(-np.diff(e_A, axis=0).max())


def _below_restitution() -> float:
    curves = [profiled(bat)[0.0] for bat in BATS]
    return max(float((own.collision_efficiency - own.restitution).max()) for own in curves)


def _efficiencies() -> tuple[float, float]:
    slow, fast = (float(efficiency_from_restitution(e, 0.25)) for e in (0.55, 0.45))
    return slow, fast


def _overestimate(speed: float) -> float:
    """Return v_f by e_A of a test at a speed less that by e_A at 160 mph [mph], r = 0.25."""
    e = 0.55 - 0.001 * (speed - SLOW)
    return FAST * (float(efficiency_from_restitution(e, 0.25)) - _efficiencies()[1])


def _overestimate_of_model(speed: float) -> float:
    slow, fast = (
        peak_of(WOOD, Z, speed=v, with_ball=BALL).collision_efficiency.max() for v in (speed, FAST)
    )
    return FAST * float(slow - fast)


def _gain(v_rel: float) -> float:
    """Return the gain of v_f by Eqs. (3) and (6), as e goes from 0.50 to 0.55 [mph]."""
    before, after = (float(efficiency_from_restitution(e, 0.25)) for e in (0.50, 0.55))
    v_ball = 90 / 160 * v_rel
    v_bat = v_rel - v_ball
    return float(batted_speed(after, v_ball, v_bat)) - float(batted_speed(before, v_ball, v_bat))


def _total(held: str) -> float:
    """Return how far the energy in the bat and its vibration is from the free bat's."""

    def total(name: str) -> Array:
        energy = peak_of(WOOD, Z, held=name).energy
        return np.asarray(energy.rigid + energy.bending + energy.hoop + energy.hysteresis)

    return _worst(total(held) - total("free"))


def _apart(held: str) -> float:
    """Return the least gap between the rigid-body energy of a free and of a held bat."""
    gap = peak_of(WOOD, Z, held=held).energy.rigid - peak_of(WOOD, Z).energy.rigid
    return float(np.abs(gap[Z < 5]).min())


def _at_percussion(bat: str) -> float:
    z = centre_of_percussion_in(bat)
    gap = restitution(bat, [z], "pivoted", SLOW, BALL) - restitution(bat, [z], "free", SLOW, BALL)
    return _worst(gap)


def _recoils_at_percussion() -> float:
    return max(
        _worst(
            recoil(bat, centre_of_percussion_in(bat), "pivoted")
            / recoil(bat, centre_of_percussion_in(bat))
            - 1
        )
        for bat in BATS
    )


def _pivot_speed() -> float:
    """Return the speed of the pivot of a rigid free bat struck at its centre of percussion.

    Over the speed of the point struck.
    """
    own = beam(WOOD)
    modes = modes_of(body(WOOD), Free(), 0)
    hit, pivot = modes.shape(
        np.array([centre_of_percussion_in(WOOD) * INCH, own.length - 6 * INCH])
    )
    rigid = slice(modes.rigid)
    return float(hit[rigid] @ pivot[rigid] / (hit[rigid] @ hit[rigid]))


def _without_hoop() -> float:
    """Return the peak BPF of the aluminium bat less that of one whose shell cannot ring."""
    stiff = ModalModel.of(replace(body(ALUMINIUM), hoop=None), Free())
    e_A = peak_of(stiff, Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, recoil(ALUMINIUM, Z)))
    return top(ALUMINIUM, "BPF").value - float(e.max()) / 0.5


def _softball_factor() -> float:
    """Return the peak BPF of a slow-pitch bat at 60 mph, free, with the ball of its game."""
    z, slow = np.arange(4, 9, 0.25), "softball-slowpitch"
    own, struck_ball = beam("softball-34"), paper_ball(slow)
    e_A = peak_of("softball-34", z, speed=SLOW, with_ball=slow).collision_efficiency
    off = z * INCH - own.z_cm
    r = struck_ball.mass * (1 / own.mass + off**2 / own.inertia_cm)
    e0 = float(struck_ball.restitution.at(SLOW * MPH))
    return float(np.asarray(restitution_from_efficiency(e_A, r)).max()) / e0


CLAIMS: tuple[Claim, ...] = (
    at_most(
        "II A",
        "Eqs. (1), (2)",
        "e_A of the field frame is that of the bat rest frame",
        ROUNDING,
        _frames,
        why=ALGEBRA,
    ),
    at_most(
        "II A",
        "Eqs. (2), (3)",
        "Eq. (3) is the inverse of Eq. (2)",
        ROUNDING,
        _round_trip,
        why=ALGEBRA,
    ),
    about(
        "II A", "Eq. (4)", "BESR - e_A", 0.5, ROUNDING, lambda: float(besr(0.2)) - 0.2, why=ALGEBRA
    ),
    at_most(
        "II A",
        "after Eq. (4)",
        "the symmetrical form with BESR gives the same v_f",
        1e-11,
        _symmetrical,
        unit="mph",
        why=ALGEBRA,
    ),
    at_most(
        "II A",
        "text",
        "e_A depends only weakly on v_rel: change of R161's peak per mph",
        1e-3,
        lambda: abs(_slope(WOOD)),
        unit="1/mph",
        why="weak: a tenth in e_A takes 100 mph",
    ),
    at_least(
        "II A",
        "text",
        "v_f depends on v_bat primarily by the explicit factor: its share",
        0.5,
        lambda: _explicit_share("bat"),
        why="primarily: more than half",
    ),
    at_least(
        "II A",
        "text",
        "v_f depends on v_ball primarily by the explicit factor: its share",
        0.5,
        lambda: _explicit_share("ball"),
        why="primarily: more than half",
    ),
    at_least(
        "II A",
        "text",
        "e_A is a strong function of place: R161's falls 3 in nearer the tip",
        0.05,
        lambda: _drop(WOOD, "e_A", -3),
        why="strong: a quarter of e_A",
    ),
    at_least(
        "II A",
        "text",
        "e_A is a strong function of place: R161's falls 3 in farther from the tip",
        0.05,
        lambda: _drop(WOOD, "e_A", 3),
        why="strong: a quarter of e_A",
    ),
    between(
        "II A",
        "text",
        "e_A is largest some 4 to 6 in from the barrel end: R161",
        3.5,
        6.5,
        lambda: top(WOOD, "e_A").place,
        unit="in",
        why="~ in print: half an inch",
    ),
    at_most(
        "II A",
        "text",
        "e_A is largest close to a node of the lowest vibrations: farthest of the four bats",
        1.0,
        lambda: max(_node_gap(bat) for bat in BATS),
        unit="in",
        why="close: an inch",
    ),
    *(
        at_most(
            "II A",
            "text",
            f"e_A does not depend on the support: {bat} {held} against free",
            MODEL,
            partial(_held, bat, held),
            why=MODES,
        )
        for bat in (WOOD, ALUMINIUM)
        for held in ("pivoted", "clamped")
    ),
    at_most(
        "II A",
        "text",
        "nor does v_f on how firmly the bat is held: on a spring against clamped",
        0.1,
        _firmness,
        unit="mph",
        why=MODES,
    ),
    at_most(
        "II B",
        "text",
        "1 - e^2 is the share of energy lost in the c.m. frame, by the model's own energies",
        1e-4,
        _lost_in_cm_frame,
        why="the model's own energy balance",
    ),
    about(
        "II B",
        "text",
        "dissipation of a perfectly elastic collision, e = 1",
        0.0,
        ROUNDING,
        lambda: float(energy_fractions(1.0, 0.25).dissipated),
        why=ALGEBRA,
    ),
    between(
        "II B",
        "text",
        "e is about 0.45 to 0.50 in the sweet-spot zone: R161, mean of 4 to 6 in",
        0.44,
        0.51,
        lambda: float(restitution(WOOD, np.linspace(4, 6, 9)).mean()),
        why="≈ in print: a unit of the last digit",
    ),
    at_least(
        "II B",
        "text",
        "a hollow bat's e differs from e0 by its shell: BPF of EA70 less that with a dead shell",
        0.02,
        _without_hoop,
        why="plain beside the model's error",
    ),
    about(
        "II B",
        "Eq. (5)",
        "BPF is close to 1 for wooden bats: peak of R161",
        1.0,
        0.05,
        lambda: top(WOOD, "BPF").value,
        why="close: 5 %",
    ),
    between(
        "II B",
        "text",
        "BPF is sometimes 1.10 to 1.20 for aluminium: softball-34 at 60 mph",
        1.095,
        1.205,
        _softball_factor,
        why="rounding of the print",
    ),
    at_most(
        "II B",
        "Eqs. (7), (8)",
        "r of a free bat is that of its rigid modes: worst of the four",
        1e-9,
        lambda: _inverse_mass("free"),
        why="finite elements",
    ),
    at_most(
        "II B",
        "Eqs. (7), (9)",
        "r of a pivoted bat is that of its rigid mode: worst of the four",
        1e-9,
        lambda: _inverse_mass("pivoted"),
        why="finite elements",
    ),
    about(
        "II B",
        "after Eq. (9)",
        "parallel axes: I_p of R161 over that of its elements, less 1",
        0.0,
        1e-9,
        _parallel_axis,
        why="finite elements",
    ),
    *(
        at_most(
            "II B",
            equation,
            f"share of the {words} by the model's own state against Eq. (10)",
            1e-4,
            partial(_fractions, name),
            why="the model's own energy balance",
        )
        for equation, name, words in (
            ("Eq. (10a)", "ball", "ball"),
            ("Eq. (10b)", "bat", "bat's recoil"),
            ("Eq. (10c)", "dissipated", "dissipation"),
        )
    ),
    about(
        "II B",
        "after Eq. (10)",
        "the three shares add to",
        1.0,
        ROUNDING,
        _sum_of_shares,
        why=ALGEBRA,
    ),
    about(
        "II B",
        "after Eq. (10)",
        "infinitely massive bat: f_ball at e = 0.5 (e^2)",
        0.25,
        ROUNDING,
        lambda: float(energy_fractions(0.5, 0.0).ball),
        why=ALGEBRA,
    ),
    about(
        "II B",
        "after Eq. (10)",
        "infinitely massive bat: f_bat",
        0.0,
        ROUNDING,
        lambda: float(energy_fractions(0.5, 0.0).bat),
        why=ALGEBRA,
    ),
    about(
        "II B",
        "after Eq. (10)",
        "infinitely massive bat: f_dis at e = 0.5 (1 - e^2)",
        0.75,
        ROUNDING,
        lambda: float(energy_fractions(0.5, 0.0).dissipated),
        why=ALGEBRA,
    ),
    at_least(
        "II B",
        "Eq. (8)",
        "a free bat's effective mass rises toward the c.m.: least relative step",
        0.0,
        _nearer_is_heavier,
        why="a sign",
    ),
    at_least(
        "II B",
        "Eq. (6)",
        "for a given e, e_A is greatest where r is small: least fall of e_A a step of r",
        0.0,
        _rise_with_lighter_recoil,
        why="a sign",
    ),
    about(
        "II B",
        "Eq. (6)",
        "infinitely massive bat, r = 0: e_A at e = 0.5",
        0.5,
        ROUNDING,
        lambda: float(efficiency_from_restitution(0.5, 0.0)),
        why=ALGEBRA,
    ),
    at_most(
        "II B",
        "text",
        "e_A is at most e: greatest excess along the four bats",
        0.0,
        _below_restitution,
        why="a sign",
    ),
    about(
        "II B",
        "text",
        "e0 of the ball at 60 mph",
        0.55,
        0.005,
        lambda: float(paper_ball(BALL).restitution.at(SLOW * MPH)),
    ),
    about(
        "II B",
        "text",
        "e0 of the ball at 160 mph",
        0.45,
        0.005,
        lambda: float(paper_ball(BALL).restitution.at(FAST * MPH)),
    ),
    at_least(
        "II B",
        "text",
        "e is a strong function of place: R161's falls 3 in nearer the tip",
        0.1,
        lambda: _drop(WOOD, "e", -3),
        why="strong: a fifth of e",
    ),
    at_least(
        "II B",
        "text",
        "e is a strong function of place: R161's falls 3 in farther from the tip",
        0.1,
        lambda: _drop(WOOD, "e", 3),
        why="strong: a fifth of e",
    ),
    at_least(
        "II B",
        "text",
        "e depends on the support: R161 at 4 in, free against pivoted",
        0.01,
        lambda: _worst(restitution(WOOD, [4.0], "pivoted") - restitution(WOOD, [4.0])),
        why="plain beside the model's error",
    ),
    at_least(
        "II B",
        "text",
        "clamped: r = 0 and e is smaller than the free bat's: R161, least gap",
        0.1,
        lambda: float((restitution(WOOD, Z) - restitution(WOOD, Z, "clamped")).min()),
        why="plain beside the model's error",
    ),
    *(
        at_most(
            "II B",
            "text",
            f"recoil and loss together do not depend on the support: {held} against free",
            5e-4,
            partial(_total, held),
            why=MODES,
        )
        for held in ("pivoted", "clamped")
    ),
    at_least(
        "II B",
        "text",
        "but each of them does: recoil energy of a clamped against a free R161",
        0.1,
        lambda: _apart("clamped"),
        why="plain beside the model's error",
    ),
    about(
        "II B",
        "Eq. (11)",
        "a blow at one conjugate point leaves the other at rest: speed over that of the blow",
        0.0,
        1e-9,
        _pivot_speed,
        why="finite elements",
    ),
    at_most(
        "II B",
        "after Eq. (11)",
        "at the COP r is the same free and pivoted: worst of the four, relative",
        1e-9,
        _recoils_at_percussion,
        why=ALGEBRA,
    ),
    *(
        at_most(
            "II B",
            "after Eq. (11)",
            f"at the COP e is the same free and pivoted: {bat}",
            1e-3,
            partial(_at_percussion, bat),
            why="almost the same, in print",
        )
        for bat in BATS
    ),
    about(
        "II C",
        "text",
        "e_A at e = 0.5 and r = 0.25",
        0.2,
        ROUNDING,
        lambda: float(efficiency_from_restitution(0.5, 0.25)),
        why=ALGEBRA,
    ),
    about(
        "II C",
        "text",
        "BESR there",
        0.7,
        ROUNDING,
        lambda: float(besr(efficiency_from_restitution(0.5, 0.25))),
        why=ALGEBRA,
    ),
    about(
        "II C",
        "text",
        "factor of v_ball in v_f there",
        0.2,
        ROUNDING,
        lambda: float(batted_speed(0.2, 1.0, 0.0)),
        why=ALGEBRA,
    ),
    about(
        "II C",
        "text",
        "factor of v_bat in v_f there",
        1.2,
        ROUNDING,
        lambda: float(batted_speed(0.2, 0.0, 1.0)),
        why=ALGEBRA,
    ),
    about(
        "II C",
        "text",
        "e is about 0.5 in the sweet-spot zone: peak of R161",
        0.5,
        0.05,
        lambda: top(WOOD, "e").value,
    ),
    about(
        "II C",
        "text",
        "r is about 0.25 there: R161 at its peak of e_A",
        0.25,
        0.05,
        lambda: float(recoil(WOOD, top(WOOD, "e_A").place)),
        why="≈ in print: a fifth",
    ),
    about(
        "II C",
        "text",
        "e_A is about 0.2 there: peak of R161",
        0.2,
        0.05,
        lambda: top(WOOD, "e_A").value,
    ),
    about(
        "II C",
        "Eq. (12)",
        "gain of v_f as e goes from 0.50 to 0.55 at 160 mph",
        6.0,
        0.5,
        lambda: float(batted_speed_gain(FAST, 0.05, 0.25)),
        unit="mph",
        why="about, in print: half a unit",
    ),
    about(
        "II C",
        "Eq. (12)",
        "the same at 80 mph, slow-pitch softball",
        3.0,
        0.5,
        lambda: float(batted_speed_gain(80.0, 0.05, 0.25)),
        unit="mph",
        why="about, in print: half a unit",
    ),
    at_most(
        "II C",
        "Eq. (12)",
        "it is what Eqs. (3) and (6) give, at 80 and 160 mph",
        1e-11,
        lambda: max(abs(_gain(v) - float(batted_speed_gain(v, 0.05, 0.25))) for v in (80.0, FAST)),
        unit="mph",
        why=ALGEBRA,
    ),
    about("II C", "text", "e_A at 60 mph, e = 0.55", 0.24, 0.005, lambda: _efficiencies()[0]),
    about("II C", "text", "e_A at 160 mph, e = 0.45", 0.16, 0.005, lambda: _efficiencies()[1]),
    about(
        "II C",
        "text",
        "v_f at 160 mph by e_A of 60 mph is too high by",
        12.8,
        0.05,
        lambda: _overestimate(60),
        unit="mph",
    ),
    about(
        "II C",
        "text",
        "v_f at 160 mph by e_A of 140 mph is too high by",
        2.6,
        0.05,
        lambda: _overestimate(140),
        unit="mph",
    ),
    about(
        "II C",
        "text",
        "the model's own: R161 by a test at 60 mph",
        12.8,
        2.0,
        lambda: _overestimate_of_model(60),
        unit="mph",
        why="around, in print: the model's r and e are not those of the example",
    ),
    about(
        "II C",
        "text",
        "the model's own: R161 by a test at 140 mph",
        2.6,
        0.4,
        lambda: _overestimate_of_model(140),
        unit="mph",
        why="about, in print: the model's r and e are not those of the example",
    ),
    between(
        "II C",
        "text",
        "the NCAA allows balls of e0 = 0.525 to 0.555 at 60 mph: the nominal ball",
        0.525,
        0.555,
        lambda: float(paper_ball(BALL).restitution.at(SLOW * MPH)),
        why="the window in print",
    ),
    at_least(
        "II D",
        "text",
        "e alone does not give v_f: BPF of the loaded bats 2 % apart, their v_f by",
        1.0,
        lambda: top(BARREL, "v_f_mph").value - top(KNOB, "v_f_mph").value,
        unit="mph",
        why="plain beside the model's error",
    ),
)
