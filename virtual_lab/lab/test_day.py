"""A test as a sequence of steps. Each step returns the day with new records and truth.

An operator chooses the steps and their order; `run_test` follows the procedure. The random
numbers of a step depend on the number of its reading or shot, so its records do not depend on the
steps before it. The laboratories of a block take each step together, and each fires the shots that
it still needs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from virtual_lab.lab.bat_test import BlockTest
from virtual_lab.lab.filming import film_of
from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.lab.measurand import measurands
from virtual_lab.lab.plans import BeforeShots, bench_plan, impact_plan, stage_records, wall_plan
from virtual_lab.measurement.certification import certify_reduction
from virtual_lab.measurement.procedure import Acceptance, NextShots
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.session_reduction import (
    AIM_ALONG,
    Preparation,
    Reduction,
    observe_hits,
    prepare,
    reduce_shots,
)
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.simulation.stations.rig import FilmingStation, RigOutput, ShotPlan, Stage
from virtual_lab.units import INCH


@dataclass(frozen=True, slots=True, kw_only=True)
class TestDay:
    """A test in progress, in one laboratory or in a block of them."""

    laboratory: Laboratory
    sessions: SessionBlock  # records of bench and wall so far
    bench: RigOutput | None = None
    wall: RigOutput | None = None
    preparation: Preparation | None = None
    plans: tuple[ShotPlan, ...] = ()  # plan of each round fired at the bat
    rounds: tuple[RigOutput, ...] = ()
    reduced: Reduction | None = None  # reduction of the shots judged so far
    # readings of all these shots; None if only those of the last round were read
    readings: ImpactReadings | None = None

    @classmethod
    def begin(cls, laboratory: Laboratory) -> TestDay:
        """Return the day before its first step."""
        return cls(laboratory=laboratory, sessions=laboratory.sessions)

    def measure_bat(self) -> TestDay:
        """Weigh, measure, balance and swing the bat, and weigh the balls."""
        setup = self.laboratory.setup
        plan = bench_plan(setup.rules.spec, setup.shape, self.laboratory.box)
        bench = self.laboratory.play(Stage.BENCH, plan)
        return replace(self, sessions=self._add_records(Stage.BENCH, bench), bench=bench)

    def hit_wall(self) -> TestDay:
        """Fire every ball at the wall at each of the procedure's speeds, which ages the balls.

        The true e0 of the lot, to which the measurand refers, is its mean over these hits. A change
        of a ball between wall and bat is not modeled.
        """
        laboratory, setup = self.laboratory, self.laboratory.setup
        plan = wall_plan(setup.rules.spec, setup.detail, setup.shape, laboratory.box)
        wall = laboratory.play(Stage.BALLS, plan)
        specimen = laboratory.specimen
        balls = specimen.balls.after_hits(plan.ball, wall.truth["restitution_loss"], plan.owner)
        return replace(
            self,
            laboratory=replace(laboratory, specimen=replace(specimen, balls=balls)),
            sessions=self._add_records(Stage.BALLS, wall),
            wall=wall,
        )

    def prepare(self) -> TestDay:
        """Reduce the records of bench and wall, which give impact position and usable balls."""
        preparation, laboratory = prepare(self.sessions), self.laboratory
        specimen = laboratory.specimen
        mask = preparation.used.reshape(specimen.balls.mass.shape)
        specimen = replace(specimen, balls=replace(specimen.balls, used=mask))
        laboratory = replace(laboratory, specimen=specimen)
        return replace(self, laboratory=laboratory, preparation=preparation)

    def next_shots(self) -> NextShots:
        """Return the shots that the procedure requires next, none if every test is complete."""
        assert self.preparation is not None, "prepare() comes first"
        return self.reduced.next_shots() if self.reduced else self.preparation.first_shots()

    def fire(self, shots: NextShots) -> TestDay:
        """Fire one ball at each position, corrected by the calibration of the cannon."""
        preparation, laboratory = self.preparation, self.laboratory
        assert preparation is not None, "prepare() comes first"
        along = laboratory.calibration.get(AIM_ALONG)
        before = BeforeShots(
            fired=np.bincount(self._owner(self.plans), minlength=preparation.laboratories),
            used=preparation.used[:, 0],
            turn_rate=preparation.turn_rate,
            along=along.value if along else np.zeros(preparation.laboratories),
        )
        plan = impact_plan(laboratory.setup, shots, before)
        rounds = (*self.rounds, laboratory.play(Stage.IMPACT, plan))
        return replace(self, plans=(*self.plans, plan), rounds=rounds)

    def judge(self, acceptance: Acceptance | None = None) -> TestDay:
        """Reduce the new hits and decide which are valid, by default by the procedure.

        All hits are reduced again if they share the fit of an encoder's counts, or if a person
        judges.
        """
        assert self.preparation is not None, "prepare() comes first"
        done = 0 if self.reduced is None else self.reduced.owner.size
        ends = np.cumsum([plan.slot.size for plan in self.plans])
        first = int(np.searchsorted(ends, done, side="right"))  # round that is not yet judged
        sessions = self.collect_records(first)
        reduce_all = self.reduced is None or acceptance is not None or sessions.counted
        if reduce_all and first:
            sessions = self.collect_records()
        readings = observe_hits(sessions, self.preparation)
        reduced = reduce_shots(sessions, self.preparation, readings)
        if acceptance is not None:
            reduced = reduced.judge_hits(acceptance, readings)
        if not reduce_all:
            assert self.reduced is not None
            reduction = Reduction.concatenate([self.reduced, reduced])
            reduced = replace(reduction, latest=reduced.owner)
        return replace(self, reduced=reduced, readings=readings if reduce_all else None)

    def collect_records(self, first: int = 0) -> SessionBlock:
        """Return all records so far, with the rounds at the bat from number `first` on."""
        if not self.rounds[first:]:
            return self.sessions
        records = {**self.sessions.records, Stage.IMPACT.value: stage_records(self.rounds[first:])}
        return replace(self.sessions, records=records, owner=self._owner(self.plans[first:]))

    @property
    def session(self) -> Session:
        """All records of a single laboratory so far."""
        return self.laboratory.session_of(self.collect_records(), {})

    def finish(self) -> BlockTest:
        """Return results, uncertainties and verdicts, with the sealed truth."""
        return self.finish_with(self.collect_records())

    def finish_with(self, sessions: SessionBlock) -> BlockTest:
        """Return the result of `finish` for other `sessions`, such as an operator's selection."""
        laboratory, reduced = self.laboratory, self.reduced
        assert self.bench is not None
        assert self.wall is not None
        assert reduced is not None, "fire() and judge() come first"
        readings = self.readings or observe_hits(sessions, reduced.preparation)
        certified = certify_reduction(sessions, reduced, readings)
        true = measurands(
            laboratory.impact,
            laboratory.specimen,
            reduced,
            certified.hit_weights.weights,
            laboratory.control_ratio,
        )
        return BlockTest(
            laboratory=laboratory,
            certified=certified,
            measurands=true,
            bench=self.bench.truth,
            wall=self.wall.truth,
            shots={
                name: np.concatenate([each.truth[name] for each in self.rounds])
                for name in self.rounds[0].truth
            },
            film=self._film(sessions, readings) if laboratory.setup.film else None,
        )

    def _film(self, sessions: SessionBlock, readings: ImpactReadings) -> Callable[[Path], None]:
        laboratory = self.laboratory
        actual = laboratory.setup.faults.apply(Stage.IMPACT, self.plans[0], laboratory.specimen)
        station = laboratory.impact
        assert isinstance(station, FilmingStation), "require_camera() has seen to it"
        session = laboratory.session_of(sessions, {})
        return film_of(station, *actual, laboratory.draws, session, readings.flights)

    def _add_records(self, stage: Stage, play: RigOutput) -> SessionBlock:
        """Return the sessions with the new records of a stage."""
        records = {**self.sessions.records, stage.value: play.records}
        return replace(self.sessions, records=records)

    def _owner(self, plans: tuple[ShotPlan, ...]) -> NDArray[np.intp]:
        """Return the laboratory of each shot of the plans, (shot,)."""
        owners = [np.broadcast_to(0 if p.owner is ... else p.owner, p.slot.shape) for p in plans]
        return np.concatenate([np.zeros(0, dtype=np.intp), *owners])


def run_test(laboratory: Laboratory, progress: Progress = quiet) -> BlockTest:
    """Return the finished tests of a block of laboratories, carried out as the procedure requires.

    The block may be a single laboratory. Bats and balls are measured first. Then balls are fired
    and judged in rounds until the procedure requires no more shots. `laboratory` is not changed.
    `progress` is called with a sentence before each stage and round.
    """
    day = prepare_day(laboratory, progress)
    while (shots := day.next_shots()).owner.size:
        if progress is not quiet:
            progress(f"impact rig: round {len(day.rounds) + 1}, {_round_in_words(shots)}")
        day = day.fire(shots).judge()
    return day.finish()


def prepare_day(laboratory: Laboratory, progress: Progress = quiet) -> TestDay:
    """Return the test day before the first shot at the bat.

    Bat and balls are already measured, and these records are reduced. `laboratory` is not changed.
    Where too few balls of a box are within the windows, the balls of another box are measured.
    `progress` is called with a sentence before each stage.
    """
    rules = laboratory.rules.spec
    progress("bench: weighing, balancing and swinging the bat, weighing the balls")
    while True:
        day = TestDay.begin(laboratory).measure_bat()
        progress(f"ball-wall rig: {rules.wall_hits} hits of each of {rules.balls} balls")
        day = day.hit_wall().prepare()
        assert day.preparation is not None
        opening = day.preparation.short & (day.sessions.boxes < laboratory.most_boxes)
        if not opening.any():
            return day
        laboratory = laboratory.open_boxes(opening)


def _round_in_words(shots: NextShots) -> str:
    """Return a phrase that states the number of shots of a round, and of positions if several."""
    where = np.unique(np.round(shots.position / INCH, 2))
    along = f" at {', '.join(f'{place:g}' for place in where)} in" if len(where) > 1 else ""
    return f"{shots.position.size} shots{along}"
