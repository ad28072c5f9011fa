"""Claims of Sec. VI: what the paper concludes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from virtual_lab.measurement.reduction.kinematics import (
    batted_speed,
    efficiency_from_restitution,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.studies.paper.claim import Claim, at_least
from virtual_lab.studies.paper.computed import (
    ALUMINIUM,
    BALL,
    BARREL,
    BATS,
    KNOB,
    WOOD,
    Z,
    lead,
    model,
    paper_ball,
    profiled,
    recoil,
    restitution,
    top,
)
from virtual_lab.units import INCH, MPH

__all__ = ["CLAIMS"]

PLAIN = "plain beside the model's error"


def _by_restitution_alone() -> float:
    """Return the error of R161's v_f at 6 in from its e and the r of the aluminium bat [mph]."""
    e = restitution(WOOD, [6.0])
    speeds = [
        float(np.asarray(batted_speed(efficiency_from_restitution(e, recoil(bat, 6.0)), 90, 70))[0])
        for bat in (WOOD, ALUMINIUM)
    ]
    return abs(speeds[1] - speeds[0])


def _contradictions(what: str) -> float:
    """Return how many pairs of the four bats a metric ranks otherwise than v_f, swung alike."""
    return sum(
        (top(first, what).value - top(second, what).value) * lead(first, second) < 0
        for first, second in combinations(BATS, 2)
    )


def _with_speed() -> float:
    """Return the fall of the peak e of R161 from 60 to 160 mph."""
    slow, fast = (restitution(WOOD, Z, speed=v, with_ball=BALL).max() for v in (60.0, 160.0))
    return float(slow - fast)


def _with_ball() -> float:
    """Return the change of the peak e of R161 over the NCAA's window of e0, at 60 mph."""

    def peak_e(e0: float) -> float:
        scenes = Scenes.with_ball(
            paper_ball(BALL), impact_position=Z * INCH, relative_speed=60 * MPH
        )
        struck = replace(scenes, ball_restitution=np.full(Z.shape, e0))
        e_A = model(WOOD).collide(struck).collision_efficiency
        return float(np.asarray(restitution_from_efficiency(e_A, recoil(WOOD, Z))).max())

    return peak_e(0.555) - peak_e(0.525)


def _lighter_is_faster() -> float:
    """Return by how much the knob-loaded bat is swung faster than the barrel-loaded, per cent."""
    speeds = [float(profiled(bat)[None].bat_speed[0]) for bat in (KNOB, BARREL)]
    return 100 * (speeds[0] / speeds[1] - 1)


def _claim(
    number: int, says: str, low: float, find: Callable[[], float], unit: str = "", why: str = PLAIN
) -> Claim:
    return at_least("VI", f"conclusion ({number})", says, low, find, unit=unit, why=why)


CLAIMS: tuple[Claim, ...] = (
    _claim(
        1,
        "e alone does not predict v_f: R161's e with EA70's r errs by",
        1.0,
        _by_restitution_alone,
        "mph",
    ),
    _claim(
        2,
        "BPF contradicts v_f of bats swung alike: pairs of the four",
        1,
        partial(_contradictions, "BPF"),
        why="one suffices",
    ),
    _claim(
        2,
        "e_A contradicts v_f of bats swung alike: pairs of the four",
        1,
        partial(_contradictions, "e_A"),
        why="one suffices",
    ),
    _claim(
        2,
        "a bat lighter to swing is swung faster, constant energy: knob- over barrel-loaded",
        0.5,
        _lighter_is_faster,
        "%",
        why="a sign",
    ),
    _claim(
        3, "elasticity depends on v_rel: e of R161 falls from 60 to 160 mph by", 0.05, _with_speed
    ),
    _claim(3, "elasticity depends on e0: e of R161 over e0 of 0.525 to 0.555 by", 0.01, _with_ball),
)
