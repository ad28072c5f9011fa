"""The same bat in many laboratories, each with its own errors, on the summed rung.

What is the same for all (the bat as drawn, its collision as a surrogate, the rules) is made
once; a laboratory then costs some milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator

from virtual_lab import catalog
from virtual_lab.collision.ladder import Ladder, probing_scenes
from virtual_lab.faults import Day
from virtual_lab.instruments import Rung
from virtual_lab.lab.laboratory import EFFICIENCY_U, Laboratory, Tested
from virtual_lab.procedure import Procedure
from virtual_lab.rig import Reality
from virtual_lab.specs import BallSpec

__all__ = ["campaign"]

SCENES = 1_000_000  # more than any small batch: a surrogate is worth building


def campaign(bat: str, *, procedure: str, laboratories: int, first_seed: int) -> Iterator[Tested]:
    """Yield the certifications of a bat as drawn in laboratories of successive seeds.

    Instruments write what their recorders sum up (`Rung.SUMMED`). `InputError` as `certify_bat`.
    """
    rules = catalog.load("procedures", procedure, Procedure)
    spec, ball = catalog.load_bat(bat).spec, catalog.load("balls", rules.spec.ball, BallSpec).spec
    speed = rules.spec.ball_speed + (rules.spec.bat_speed or 0.0)
    collision = Ladder(
        probe=probing_scenes(ball, speed), standard_uncertainty=EFFICIENCY_U, expected=SCENES
    )
    for seed in range(first_seed, first_seed + laboratories):
        laboratory = Laboratory.open(
            bat=spec,
            ball=ball,
            rules=rules,
            seed=seed,
            rig=rules.spec.rig,
            reality=Reality.REAL,
            rung=None,
            day=Day(),
            unverified={},
            instruments=Rung.SUMMED,
            collision=collision,
            made=False,
        )
        yield laboratory.run(lambda _: None)
