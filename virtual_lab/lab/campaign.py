"""The same bat in many laboratories, each with its own errors, on the summed rung.

What is the same for all (the bat as drawn, its collision as a surrogate, the rules) is made
once; a laboratory then costs some milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab.laboratory import EFFICIENCY_U, Laboratory, Tested
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.collision.ladder import Ladder, probing_scenes
from virtual_lab.simulation.faults import Day
from virtual_lab.simulation.instruments import Rung
from virtual_lab.simulation.rig import Reality

__all__ = ["Campaign"]

SCENES = 1_000_000  # more than any small batch: a surrogate is worth building


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """What is the same in every laboratory."""

    rules: Entry[Procedure]
    bat: BatSpec
    ball: BallSpec
    collision: Ladder

    @classmethod
    def of(cls, bat: str, procedure: str) -> Self:
        """Return the campaign of a bat by a procedure; `InputError` as `certify_bat`."""
        rules = catalog.load("procedures", procedure, Procedure)
        ball = catalog.load("balls", rules.spec.ball, BallSpec).spec
        speed = rules.spec.ball_speed + (rules.spec.bat_speed or 0.0)
        return cls(
            rules=rules,
            bat=catalog.load_bat(bat).spec,
            ball=ball,
            collision=Ladder(
                probe=probing_scenes(ball, speed),
                standard_uncertainty=EFFICIENCY_U,
                expected=SCENES,
            ),
        )

    def laboratory(self, seed: int) -> Laboratory:
        """Return the laboratory of a seed."""
        return Laboratory.open(
            bat=self.bat,
            ball=self.ball,
            rules=self.rules,
            seed=seed,
            rig=self.rules.spec.rig,
            reality=Reality.REAL,
            rung=None,
            day=Day(),
            unverified={},
            instruments=Rung.SUMMED,
            collision=self.collision,
            made=False,
        )

    def run(self, laboratories: int, first_seed: int) -> Iterator[Tested]:
        """Yield the certifications of laboratories of successive seeds."""
        for seed in range(first_seed, first_seed + laboratories):
            yield self.laboratory(seed).run(lambda _: None)
