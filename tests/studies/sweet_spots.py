"""Coverage of the metric for bats whose sweet spots are flatter or sharper than the catalog's.

    python -m tests.studies.sweet_spots LABORATORIES SEED OUT.CSV [PROCEDURE ...]

The bat is r161 as a rigid body; its e at a ball's e0 of 0.5 is `PEAK` at `PLACE` and falls by the
curvature times the square of the distance. Instruments record only summary values. The fit of the
curve was chosen with the seeds 70, 71 and 7001; the stored table has seed 7002.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binomtest

from virtual_lab.catalog.specs import BatBody
from virtual_lab.lab import RoundRobin
from virtual_lab.records.origin import ModelUsed
from virtual_lab.simulation.collision.ladder import StruckBat
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.physics.beam import Support, beam_of
from virtual_lab.studies.coverage import sample
from virtual_lab.units import INCH

PEAK, PLACE = 0.5, 6 * INCH
CURVATURES = (0.0009, 0.0018, 0.004, 0.012)  # [1/in²]
PROCEDURES = ("ncaa-besr", "bbcor", "proposed", "ncaa-modified")


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapedSweetSpot:
    """The collision law of a rigid bat with a parabola of e along its barrel."""

    curvature: float  # [1/m²]
    free: bool  # whether the procedure computes e with a free bat
    axis: float  # distance of the pivot from the tip [m]

    def efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes, (n,)."""
        place, e_A = scenes.impact_position, np.empty(len(scenes))
        e = (PEAK - self.curvature * (place - PLACE) ** 2) * scenes.ball_restitution / 0.5
        for body, shots in struck:
            bat = beam_of(body)
            at = place[shots]
            arm = self.axis - bat.z_cm
            yields = (self.axis - at) ** 2 / (bat.inertia_cm + bat.mass * arm**2)
            if self.free:
                yields = 1 / bat.mass + (at - bat.z_cm) ** 2 / bat.inertia_cm
            r = scenes.ball_mass[shots] * yields
            e_A[shots] = (e[shots] - r) / (1 + r)
        return e_A

    true_efficiencies = efficiencies

    def __call__(self, body: BatBody, support: Support) -> CollisionModel:
        raise NotImplementedError("only summary values are recorded")

    def report(self) -> ModelUsed:
        """Return the name of this law."""
        return ModelUsed(rung="shaped", reason="a parabola of e")


def row(procedure: str, curvature: float, laboratories: int, seed: int) -> dict[str, Any]:
    """Return coverage and errors of the metric [SI] for a curvature [1/in²]."""
    tests = RoundRobin.of("r161", procedure)
    rules, bat = tests.setup.rules.spec, tests.setup.bat.spec.body
    law = ShapedSweetSpot(
        curvature=curvature / INCH**2,
        free=rules.recoil == "free",
        axis=beam_of(bat).length - rules.pivot_from_knob,
    )
    tests = replace(tests, setup=replace(tests.setup, collision=law, random_bat=False))
    parts = [sample(block) for block in tests.blocks(laboratories, seed)]
    sound = np.concatenate([part.sound for part in parts])
    rows = np.concatenate([part.results["metric"].rows(0.0) for part in parts])[sound]
    missed, error, u, *_ = rows.T
    held = int((missed == 0).sum())
    low, high = binomtest(held, missed.size).proportion_ci(0.95, "exact")
    return {
        **{"procedure": procedure, "curvature": curvature, "seed": seed},
        **{"laboratories": laboratories, "invalid": 1 - sound.mean()},
        **{"held": held / missed.size, "held_low": low, "held_high": high},
        **{"sd_error": error.std(), "bias": error.mean(), "median_u": np.median(u)},
        "largest_z": np.abs(error / u).max(),
    }


def main(laboratories: str, seed: str, path: str, *names: str) -> None:
    cells = [(name, curvature) for name in names or PROCEDURES for curvature in CURVATURES]
    table = pd.DataFrame([row(*cell, int(laboratories), int(seed)) for cell in cells])
    table.to_csv(path, index=False, float_format="%.4g")


if __name__ == "__main__":
    main(*sys.argv[1:])
