"""Results for Secs. IV and VI: Table I, Figs. 3 and 4, the conclusions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from virtual_lab import catalog
from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
    recoil_factor_free,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.studies.paper.claim import Claim
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
    lead,
    model,
    nominal,
    paper_ball,
    peak_of,
    profiled,
    recoil,
    restitution,
    top,
)
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2


def table_one() -> Iterator[Claim]:
    """Yield the claims of Table I, from the data sheets of the bats."""
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
            yield Claim(
                section="IV",
                where="Table I",
                says=f"{bat}: {name}",
                paper=value,
                low=value - 5e-3 * value,
                high=value + 5e-3 * value,
                unit=unit,
                why="fit of the drawing, 0.5 %",
                find=partial(of_drawing, bat, name),
            )


def of_drawing(bat: str, name: str) -> float:
    """Return an entry of Table I, computed from the drawing."""
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


def added(bat: str) -> float:
    return body(bat).lumps[-1].mass / OUNCE


def percent(what: str, first: str, second: str) -> float:
    """Return the relative excess of the peak of one bat's curve over another's [%]."""
    return 100 * (top(first, what).value / top(second, what).value - 1)


def farther(what: str) -> float:
    return top(ALUMINIUM, what).place - top(WOOD, what).place


def slower_there(what: str) -> float:
    speeds = [float(nominal(bat, top(bat, what).place)) for bat in (WOOD, ALUMINIUM)]
    return speeds[0] - speeds[1]


def mass_share(light: str, heavy: str) -> float:
    """Return the ratio of the effective masses of two bats, 6 in from the tip."""
    return float(recoil(heavy, 6.0) / recoil(light, 6.0))


def thinner_is_livelier() -> float:
    """Return the gain of peak BPF if EA70 has the thin shell of the loaded bats, without weight."""
    struck_body = body(ALUMINIUM).with_wall(_thickness())
    own, mass = beam_of(struck_body), paper_ball().mass
    r = recoil_factor_free(mass, own.mass, own.inertia_cm, Z * INCH - own.z_cm)
    e_A = peak_of(ModalModel.of(struck_body, Free()), Z).collision_efficiency
    e = np.asarray(restitution_from_efficiency(e_A, r))
    return float(e.max()) / 0.5 - top(ALUMINIUM, "BPF").value


def thinner() -> float:
    return 100 * (1 - _thickness())


def _thickness() -> float:
    """Return the ratio of the wall thickness of the loaded bats to that of EA70."""
    thin, whole = body(BARREL).profile.wall, body(ALUMINIUM).profile.wall
    assert thin is not None
    assert whole is not None
    return thin[0] / whole[0]


def node_shift(i: int) -> float:
    return (profiled(ALUMINIUM)[0.0].nodes[i] - profiled(WOOD)[0.0].nodes[i]) / INCH


def loads_apart() -> float:
    """Return the mass of the barrel-loaded bat less that of the knob-loaded one [oz]."""
    return (beam(BARREL).mass - beam(KNOB).mass) / OUNCE


def centre_farther() -> float:
    """Return the distance from tip to centre of mass of EA70 minus that of R161 [in]."""
    return (beam(ALUMINIUM).z_cm - beam(WOOD).z_cm) / INCH


def least_lead(first: str, second: str, *swings: float) -> float:
    return min(lead(first, second, n) for n in swings)


def lead_lost(first: str, second: str, n: float, other: float) -> float:
    return lead(first, second, n) - lead(first, second, other)


def by_restitution_alone() -> float:
    """Return the error of R161's v_f at 6 in from its e and the r of the aluminium bat [mph]."""
    e = restitution(WOOD, [6.0])
    speeds = [
        float(np.asarray(batted_speed(efficiency_from_restitution(e, recoil(bat, 6.0)), 90, 70))[0])
        for bat in (WOOD, ALUMINIUM)
    ]
    return abs(speeds[1] - speeds[0])


def contradictions(what: str) -> float:
    """Return the number of pairs of the four bats that a metric and v_f rank differently."""
    return sum(
        (top(first, what).value - top(second, what).value) * lead(first, second) < 0
        for first, second in combinations(BATS, 2)
    )


def with_speed() -> float:
    """Return the fall of the peak e of R161 from 60 to 160 mph."""
    slow, fast = (restitution(WOOD, Z, speed=v, with_ball=BALL).max() for v in (60.0, 160.0))
    return float(slow - fast)


def with_ball() -> float:
    """Return the change of the peak e of R161 over the NCAA's window of e0, at 60 mph."""

    def peak_e(e0: float) -> float:
        scenes = Scenes.with_ball(
            paper_ball(BALL), impact_position=Z * INCH, relative_speed=60 * MPH
        )
        struck = replace(scenes, ball_restitution=np.full(Z.shape, e0))
        e_A = model(WOOD).collide(struck).collision_efficiency
        return float(np.asarray(restitution_from_efficiency(e_A, recoil(WOOD, Z))).max())

    return peak_e(0.555) - peak_e(0.525)
