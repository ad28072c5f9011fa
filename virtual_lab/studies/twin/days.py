"""Days of a stated laboratory: tests of the stated bat with its own sheets."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab import BlockTest, Laboratory, TestSetup, run_test
from virtual_lab.lab.setup import NO_FAULTS
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Stage
from virtual_lab.streams import Slots
from virtual_lab.studies.own_laboratory.ball import hit_scatters, with_scatter
from virtual_lab.studies.plan.sample import SampledTests, sample_of
from virtual_lab.studies.twin.statement import Statement
from virtual_lab.uncertainty.estimate import Estimates

SIDE_BY_SIDE = 512  # number of days side by side


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedLaboratory(Laboratory):
    """A laboratory whose bench takes only the readings that the records hold."""

    channels: Set[str] = frozenset()  # channels of the bench

    def play(self, stage: Stage, plan: ShotPlan) -> RigOutput:
        """Return the records and the truth of a plan, without readings that were not taken."""
        played = Laboratory.play(self, stage, plan)
        if stage is not Stage.BENCH:
            return played
        records = {key: each for key, each in played.records.items() if key in self.channels}
        return replace(played, records=records)


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinDays:
    """Test days of a stated laboratory, played like the tests of every other study.

    Each day has its own errors of all stated constants and its own balls of the stated lot. A test
    of the control bat is not played, because the records hold its ratio and not its e_A. Each day
    has this ratio with another error within its u.
    """

    statement: Statement
    seed: int
    scatters: Mapping[str, float]  # scatter of e0 between hits, by place of the hits
    faults: FaultSet = NO_FAULTS

    @classmethod
    def fit(cls, statement: Statement, seed: int, days: int = SIDE_BY_SIDE) -> TwinDays:
        """Return days whose hits scatter as those of the records.

        Some of the scatter comes from the instruments and the aim. The rest is a scatter of e0,
        found from `days` days with and without one. It is 0 if instruments and aim alone scatter at
        least as much as the records. Raises `InputError` if no day gives a valid result.
        """

        def simulate(scatters: Mapping[str, float]) -> SampledTests:
            playing = cls(statement=statement, seed=seed, scatters=scatters)
            played = playing.play(np.arange(days))
            if not played.certified.sound.any():
                allowed = f"none of {days} days of its twin gives a valid result; needs half of"
                raise InputError("", "folder", None, f"{allowed} them")
            return sample_of(played).select(played.certified.sound)

        found = hit_scatters(statement.hit_scatters, simulate)
        scatters = {place: each.value for place, each in found.items()}
        return cls(statement=statement, seed=seed, scatters=scatters)

    def play(self, days: int | Slots, detail: RecordDetail = RecordDetail.SUMMED) -> BlockTest:
        """Return the tests of the days with the numbers `days`, (n,), or of a single number.

        Records of every edge and count need a single number.
        """
        statement, session = self.statement, self.statement.session
        rules, count = statement.rules, max(np.size(days), 1)
        ball = toml_text(with_scatter(statement.ball, self.scatters))
        sheets = {**statement.sheets, ("balls", rules.spec.ball): ball}
        with catalog.sheets_in_place(sheets):
            setup = TestSetup.of(
                statement.bat, procedure=rules, rig=session.rigs[Stage.IMPACT.value], detail=detail
            )
            laboratory = StatedLaboratory.open(
                replace(
                    setup,
                    seed=self.seed,
                    number=days,
                    faults=self.faults,
                    random_bat=False,
                    collision=statement.law,
                    history={
                        key: Estimates.stack([each] * count)
                        for key, each in session.history.items()
                    },
                )
            )
            channels = session.records[Stage.BENCH.value].keys()
            laboratory = replace(laboratory, channels=channels)
            if control := session.calibration.get(CONTROL):
                stated = Estimates.stack([control] * count)
                error = np.reshape(laboratory.draws.normal(f"twin.{CONTROL}"), count)
                stated = replace(stated, value=stated.value + stated.u * error)
                laboratory = replace(
                    laboratory,
                    calibration={**laboratory.calibration, CONTROL: stated},
                    control_ratio=control.value,
                )
            return run_test(laboratory)
