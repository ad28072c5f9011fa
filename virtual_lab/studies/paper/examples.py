"""Claims of Sec. IV: Table I, wood against aluminium (Fig. 3), the loaded bats (Fig. 4)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from virtual_lab import catalog
from virtual_lab.measurement.reduction.kinematics import (
    recoil_factor_free,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.studies.paper.claim import Claim, about, at_least, at_most
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    BARREL,
    BATS,
    KNOB,
    SWINGS,
    WOOD,
    Z,
    beam,
    body,
    lead,
    nominal,
    paper_ball,
    peak_of,
    profiled,
    recoil,
    thinned,
    top,
)
from virtual_lab.units import INCH, OUNCE, OZ_IN2

__all__ = ["CLAIMS"]

TABLE = 5e-3  # relative, of Table I: the fit of a drawing to it
FIT = "fit of the drawing, 0.5 %"
FASTER = tuple(n for n in SWINGS if n)  # the exponents above 0


def _table_one() -> Iterator[Claim]:
    for bat in BATS:
        said = catalog.load_bat(bat).spec.published
        assert said is not None
        printed = {
            "length": (said.length / INCH, "in"),
            "mass": (said.mass / OUNCE, "oz"),
            "z_cm": (said.z_cm / INCH, "in"),
            "I_cm": (said.inertia_cm / OZ_IN2, "oz in^2"),
            "I_knob": (said.inertia_knob / OZ_IN2, "oz in^2"),
            "f_1": (said.bending_frequencies[0], "Hz"),
            "f_2": (said.bending_frequencies[1], "Hz"),
            "node 1": (said.barrel_nodes[0] / INCH, "in"),
            "node 2": (said.barrel_nodes[1] / INCH, "in"),
        }
        for name, (value, unit) in printed.items():
            yield about(
                "IV",
                "Table I",
                f"{bat}: {name}",
                value,
                TABLE * value,
                partial(_drawn, bat, name),
                unit=unit,
                why=FIT,
            )


def _drawn(bat: str, name: str) -> float:
    """Return an entry of Table I as the drawing has it."""
    own, free = beam(bat), profiled(bat)[0.0]
    return {
        "length": own.length / INCH,
        "mass": own.mass / OUNCE,
        "z_cm": own.z_cm / INCH,
        "I_cm": own.inertia_cm / OZ_IN2,
        "I_knob": own.inertia(33 * INCH) / OZ_IN2,
        "f_1": float(free.frequencies[0]),
        "f_2": float(free.frequencies[1]),
        "node 1": free.nodes[0] / INCH,
        "node 2": free.nodes[1] / INCH,
    }[name]


def _added(bat: str) -> float:
    return body(bat).lumps[-1].mass / OUNCE


def _percent(what: str, first: str, second: str) -> float:
    return 100 * (top(first, what).value / top(second, what).value - 1)


def _farther(what: str) -> float:
    return top(ALUMINIUM, what).place - top(WOOD, what).place


def _slower_there(what: str) -> float:
    speeds = [float(nominal(bat, top(bat, what).place)) for bat in (WOOD, ALUMINIUM)]
    return speeds[0] - speeds[1]


def _mass_share(light: str, heavy: str) -> float:
    """Return M_eff of one bat over that of another, 6 in from the tip."""
    return float(recoil(heavy, 6.0) / recoil(light, 6.0))


def _thinner_is_livelier() -> float:
    """Return the gain of peak BPF as EA70's shell gets as thin as the loaded bats', no weight."""
    thin, whole = body(BARREL).profile.wall, body(ALUMINIUM).profile.wall
    assert thin is not None
    assert whole is not None
    struck_body = thinned(ALUMINIUM, thin[0] / whole[0])
    own, mass = beam_of(struck_body), paper_ball().mass
    r = recoil_factor_free(mass, own.mass, own.inertia_cm, Z * INCH - own.z_cm)
    e_A = peak_of(ModalModel.of(struck_body, Free()), Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, r))
    return float(e.max()) / 0.5 - top(ALUMINIUM, "BPF").value


def _thinner() -> float:
    thin, whole = body(BARREL).profile.wall, body(ALUMINIUM).profile.wall
    assert thin is not None
    assert whole is not None
    return 100 * (1 - thin[0] / whole[0])


def _node_shift(i: int) -> float:
    return (profiled(ALUMINIUM)[0.0].nodes[i] - profiled(WOOD)[0.0].nodes[i]) / INCH


CLAIMS: tuple[Claim, ...] = (
    *_table_one(),
    about(
        "IV",
        "text",
        "peak BPF of EA70 above R161's, as its shell was adjusted",
        8.5,
        0.3,
        lambda: _percent("BPF", ALUMINIUM, WOOD),
        unit="%",
        why="our shell was adjusted to it too",
    ),
    about(
        "IV",
        "text",
        "the loaded bats' shell is about 10 % thinner",
        10.0,
        2.0,
        _thinner,
        unit="%",
        why="about, in print: fitted to Table I",
    ),
    at_least(
        "IV",
        "text",
        "a thinner shell gives a somewhat larger BPF: gain before the weight is added",
        1e-3,
        _thinner_is_livelier,
        why="a sign",
    ),
    *(
        about(
            "IV",
            "text",
            f"weight added to the {bat} bat",
            2.3,
            1e-9,
            partial(_added, bat),
            unit="oz",
            why="as stated in our data",
        )
        for bat in (BARREL, KNOB)
    ),
    about(
        "IV",
        "text",
        "the loaded bats weigh the same: difference",
        0.0,
        0.05,
        lambda: (beam(BARREL).mass - beam(KNOB).mass) / OUNCE,
        unit="oz",
    ),
    about(
        "IV",
        "Fig. 3",
        "peak BPF of EA70 above R161's",
        9.0,
        0.6,
        lambda: _percent("BPF", ALUMINIUM, WOOD),
        unit="%",
    ),
    about(
        "IV",
        "Fig. 3",
        "peak e_A of EA70 above R161's",
        12.0,
        1.0,
        lambda: _percent("e_A", ALUMINIUM, WOOD),
        unit="%",
        why="the model: modes, ball, shell",
    ),
    about(
        "IV",
        "Fig. 3",
        "peak v_f of EA70 less R161's, swung alike (n = 0)",
        0.0,
        0.5,
        lambda: lead(ALUMINIUM, WOOD),
        unit="mph",
        why="identical in print: half a unit",
    ),
    at_least(
        "IV",
        "Table I",
        "EA70's c.m. lies farther from the tip: by",
        0.5,
        lambda: (beam(ALUMINIUM).z_cm - beam(WOOD).z_cm) / INCH,
        unit="in",
        why="a sign, plain beside the fit",
    ),
    *(
        at_least(
            "IV",
            "Table I",
            f"so does the node of its vibration {i + 1}: by",
            0.1,
            partial(_node_shift, i),
            unit="in",
            why="a sign, plain beside the fit",
        )
        for i in range(2)
    ),
    *(
        at_least(
            "IV",
            "Fig. 3",
            f"so does the peak of its {what}: by",
            0.3,
            partial(_farther, what),
            unit="in",
            why="a sign, plain beside the step",
        )
        for what in ("BPF", "e_A")
    ),
    *(
        at_least(
            "IV",
            "Fig. 3",
            f"where the bat speed is lower: at the peaks of {what}, by",
            1.0,
            partial(_slower_there, what),
            unit="mph",
            why="a sign",
        )
        for what in ("BPF", "e_A")
    ),
    at_most(
        "IV",
        "text",
        "EA70 has less mass at the place of impact: M_eff over R161's, 6 in",
        0.95,
        lambda: _mass_share(ALUMINIUM, WOOD),
        why="plain beside the fit",
    ),
    at_least(
        "IV",
        "Fig. 3",
        "EA70 outperforms R161 for any n > 0: least lead, n = 0.1 to 0.5",
        0.5,
        lambda: min(lead(ALUMINIUM, WOOD, n) for n in FASTER),
        unit="mph",
        why="plain beside the model's error",
    ),
    about(
        "IV",
        "Fig. 3",
        "by up to about 6 mph at n = 0.5",
        6.0,
        0.5,
        lambda: lead(ALUMINIUM, WOOD, 0.5),
        unit="mph",
        why="about, in print: half a unit",
    ),
    about(
        "IV",
        "Fig. 3",
        "likely closer to 3 mph: n = 0.3",
        3.0,
        1.0,
        lambda: lead(ALUMINIUM, WOOD, 0.3),
        unit="mph",
        why="closer to, in print: one unit",
    ),
    about(
        "IV",
        "Fig. 4",
        "the loaded bats have nearly identical peak BPF: barrel over knob",
        0.0,
        2.0,
        lambda: _percent("BPF", BARREL, KNOB),
        unit="%",
        why="nearly: 2 %",
    ),
    at_least(
        "IV",
        "Fig. 4",
        "the barrel-loaded bat clearly outperforms, swung alike: by",
        3.0,
        lambda: lead(BARREL, KNOB),
        unit="mph",
        why="clearly",
    ),
    at_least(
        "IV",
        "text",
        "it has more mass where it is struck: M_eff over the knob-loaded bat's, 6 in",
        1.05,
        lambda: _mass_share(BARREL, KNOB),
        why="plain beside the fit",
    ),
    at_least(
        "IV",
        "Fig. 4",
        "it performs better for any n < 0.5: least lead, n = 0 to 0.4",
        0.1,
        lambda: min(lead(BARREL, KNOB, n) for n in (0.0, 0.1, 0.2, 0.3, 0.4)),
        unit="mph",
        why="plain beside the model's error",
    ),
    at_most(
        "IV",
        "text",
        "neither BPF is reliable: knob-loaded has 5 % more than R161, but its v_f at n = 0 is",
        -1.0,
        lambda: lead(KNOB, WOOD),
        unit="mph",
        why="plain beside the model's error",
    ),
    at_least(
        "IV",
        "text",
        "for all that BPF of the knob-loaded bat is above R161's by",
        5.0,
        lambda: _percent("BPF", KNOB, WOOD),
        unit="%",
        why="plain beside the model's error",
    ),
    at_least(
        "IV",
        "text",
        "nor e_A: knob-loaded has more of it than R161, by",
        0.5,
        lambda: _percent("e_A", KNOB, WOOD),
        unit="%",
        why="plain beside the model's error",
    ),
    at_least(
        "IV",
        "text",
        "n = 0 overestimates the barrel-loaded bat's advantage: over n = 0.3 by",
        1.0,
        lambda: lead(BARREL, KNOB, 0.0) - lead(BARREL, KNOB, 0.3),
        unit="mph",
        why="plain beside the model's error",
    ),
)
