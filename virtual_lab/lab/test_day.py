"""A test as a sequence of steps; each returns the day with added records and truth.

An operator chooses the steps and their order; `by_the_book` follows the procedure. The random
numbers of a step depend on the number of its reading or shot, so a step gives the same records
whatever was done before it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from virtual_lab.lab.filming import film_of
from virtual_lab.lab.laboratory import Laboratory, constant_name
from virtual_lab.lab.measurand import measurands
from virtual_lab.lab.plans import BeforeShots, bench_plan, impact_plan, stage_records, wall_plan
from virtual_lab.measurement.certification import Certification, evaluate
from virtual_lab.measurement.model import CONTROL
from virtual_lab.measurement.procedure import Acceptance, NextShots, judge, next_places
from virtual_lab.measurement.reduction.observations import along_of
from virtual_lab.measurement.session_reduction import (
    BlockReduction,
    Preparation,
    SessionReduction,
    prepare,
    reduce_hits,
)
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.records.origin import RungTaken
from virtual_lab.records.session import Session
from virtual_lab.simulation.collision.modal import kernel_is_compiled
from virtual_lab.simulation.rig import (
    FilmingStation,
    MotionRung,
    RigOutput,
    ShotPlan,
    Stage,
)
from virtual_lab.simulation.truth import SealedTruth
from virtual_lab.units import INCH, Array

SWUNG = frozenset({"pendulum"})  # the bench's channels that swing the bat; the others measure it


@dataclass(frozen=True, slots=True, kw_only=True)
class BatTest:
    """A certification with its sealed truth, which only a study may read."""

    certification: Certification
    sealed: SealedTruth
    control: BatTest | None = None  # of the control bat, where the rules ask for one
    film: Callable[[Path], None] | None = None  # films the first shot into a folder


@dataclass(frozen=True, slots=True, kw_only=True)
class TestDay:
    """A test in progress."""

    laboratory: Laboratory
    session: Session  # everything recorded so far
    bench: RigOutput | None = None
    wall: RigOutput | None = None
    preparation: Preparation | None = None
    plans: tuple[ShotPlan, ...] = ()  # what was fired at the bat, round by round
    rounds: tuple[RigOutput, ...] = ()
    reduced: SessionReduction | None = None  # of the rounds so far

    @classmethod
    def begin(cls, laboratory: Laboratory) -> TestDay:
        """Return the morning of the test."""
        return cls(laboratory=laboratory, session=laboratory.session)

    def weigh(self) -> TestDay:
        """Weigh, measure and balance the bat, weigh the balls."""
        return self._on_bench(lambda channel: channel not in SWUNG)

    def swing(self) -> TestDay:
        """Swing the bat on the pendulum."""
        return self._on_bench(lambda channel: channel in SWUNG)

    def hit_wall(self) -> TestDay:
        """Fire every ball at the wall at each of the procedure's speeds; the balls age.

        The true e0 of the lot is its mean over these hits, and the measurand refers to it; changes
        of a ball between wall and bat are not modelled.
        """
        laboratory = self.laboratory
        plan = wall_plan(laboratory.rules.spec, laboratory.setup.detail)
        wall = laboratory.play(Stage.BALLS, plan)
        specimen = laboratory.specimen
        balls = specimen.balls.as_found(plan.ball, wall.truth["restitution_loss"])
        return replace(
            self,
            laboratory=replace(laboratory, specimen=replace(specimen, balls=balls)),
            session=with_records(self.session, Stage.BALLS, [wall]),
            wall=wall,
        )

    def prepare(self) -> TestDay:
        """Reduce the records of bench and wall: where to hit, and which balls to use."""
        preparation = prepare(self.session)
        specimen = self.laboratory.specimen
        balls = replace(specimen.balls, used=preparation.lot.used)
        laboratory = replace(self.laboratory, specimen=replace(specimen, balls=balls))
        return replace(self, laboratory=laboratory, preparation=preparation)

    def next_places(self) -> Array:
        """Return the places of the next hits [m from the tip]; empty: the test is complete."""
        assert self.preparation is not None, "prepare() comes first"
        rules, place = self.laboratory.rules.spec, self.preparation.percussion
        if self.reduced is None:
            nothing = np.zeros(0)
            return next_places(rules, place, nothing, nothing.astype(bool), nothing)
        reduced = self.reduced
        fired, valid = reduced.readings.place, reduced.judgement.valid
        return next_places(rules, place, fired, valid, reduced.sought.value)

    def fire(self, places: Array) -> TestDay:
        """Fire one ball at each place [m], corrected by the calibration of the cannon."""
        assert self.preparation is not None, "prepare() comes first"
        laboratory = self.laboratory
        before = BeforeShots(
            fired=np.array([sum(plan.slot.size for plan in self.plans)]),
            used=np.asarray(self.preparation.lot.used)[None],
            turn_rate=np.array([self.preparation.turn_rate]),
            along=np.array([along_of(self.session)]),
        )
        asked = NextShots(np.zeros(places.size, dtype=np.intp), places)
        plan = replace(impact_plan(laboratory.setup, asked, before), owner=...)
        rounds = (*self.rounds, laboratory.play(Stage.IMPACT, plan))
        return replace(
            self,
            session=with_records(self.session, Stage.IMPACT, rounds),
            plans=(*self.plans, plan),
            rounds=rounds,
        )

    def judge(self, acceptance: Acceptance = judge) -> TestDay:
        """Reduce the hits so far and decide which count, by default by the procedure."""
        assert self.preparation is not None, "prepare() comes first"
        return replace(self, reduced=reduce_hits(self.session, self.preparation, acceptance))

    def finish(self) -> BatTest:
        """Return result, uncertainty and verdict, with the sealed truth."""
        assert self.reduced is not None, "fire() and judge() come first"
        laboratory = self.laboratory
        rungs = {
            "collision": laboratory.collision.report(),
            "motion": _motion_report(laboratory.setup.motion),
        }
        session = replace(self.session, origin=replace(laboratory.origin, rungs=rungs))
        return BatTest(
            certification=evaluate(session, self.reduced),
            sealed=self._seal(self.reduced),
            film=self._film(session) if laboratory.setup.film else None,
        )

    def _film(self, session: Session) -> Callable[[Path], None]:
        laboratory = self.laboratory
        done = laboratory.setup.faults.done(Stage.IMPACT, self.plans[0], laboratory.specimen)
        station = laboratory.impact
        assert isinstance(station, FilmingStation), "require_camera() has seen to it"
        return film_of(station, *done, laboratory.draws, session)

    def _on_bench(self, asked: Callable[[str], bool]) -> TestDay:
        laboratory = self.laboratory
        bench = laboratory.play(Stage.BENCH, bench_plan(laboratory.rules.spec))
        before = self.session.records.get(Stage.BENCH.value, {})
        records = {name: record for name, record in bench.records.items() if asked(name)}
        session = replace(
            self.session,
            records={**self.session.records, Stage.BENCH.value: {**before, **records}},
        )
        return replace(self, session=session, bench=bench)

    def _seal(self, reduced: SessionReduction) -> SealedTruth:
        assert self.bench is not None
        assert self.wall is not None
        laboratory, rounds = self.laboratory, self.rounds
        alone = BlockReduction.alone(reduced)
        true = measurands(
            laboratory.impact,
            laboratory.specimen,
            alone,
            alone.outcome.weights,
            laboratory.control,
        )
        return SealedTruth(
            seed=laboratory.seed,
            number=laboratory.setup.number,
            salt=laboratory.salt,
            reality=laboratory.setup.reality.value,
            bat=laboratory.specimen.bat,
            bat_properties=self.bench.truth,
            balls=laboratory.specimen.balls,
            constants={
                constant_name(stage, name): value
                for stage, station in laboratory.stations.items()
                for name, value in station.true_constants.items()
            }
            | ({CONTROL: laboratory.control} if laboratory.rules.spec.controlled else {}),
            measurand={
                name: float(value[0]) for name, value in true.items() if np.isfinite(value[0])
            },
            place=reduced.readings.place,
            shots={
                name: np.concatenate([output.truth[name] for output in rounds])
                for name in rounds[0].truth
            },
            wall_hits=self.wall.truth,
            faults=laboratory.setup.faults.names,
        )


def by_the_book(laboratory: Laboratory, progress: Progress = quiet) -> BatTest:
    """Measure bat and balls, then fire and judge until the procedure asks for no more shots."""
    day = prepared(laboratory, progress)
    if not kernel_is_compiled():
        progress("compiling the collision kernel, which happens once and takes about five seconds")
    while (places := day.next_places()).size:
        progress(f"impact rig: round {len(day.rounds) + 1}, {_round_in_words(places)}")
        day = day.fire(places).judge()
    return day.finish()


def prepared(laboratory: Laboratory, progress: Progress = quiet) -> TestDay:
    """Return the day of a laboratory after bat and balls were measured, before the first shot."""
    rules = laboratory.rules.spec
    progress("bench: weighing, balancing and swinging the bat, weighing the balls")
    day = TestDay.begin(laboratory).weigh().swing()
    progress(f"ball-wall rig: {rules.wall_hits} hits of each of {rules.balls} balls")
    return day.hit_wall().prepare()


def with_records(session: Session, stage: Stage, rounds: Sequence[RigOutput]) -> Session:
    """Return the session with the records of a stage: those of its rounds, one after another."""
    return replace(session, records={**session.records, stage.value: stage_records(rounds)})


def _motion_report(motion: MotionRung) -> RungTaken:
    pinned = "" if motion is MotionRung.CLOSED_FORM else ", as asked for"
    return RungTaken(rung=motion.value, reason=f"{motion.value}{pinned}")


def _round_in_words(places: Array) -> str:
    """Return the number of shots of a round, and their places if several."""
    where = sorted({round(float(place) / INCH, 2) for place in places})
    along = f" at {', '.join(f'{place:g}' for place in where)} in" if len(where) > 1 else ""
    return f"{places.size} shots{along}"
