"""The laboratory: one certification from drawn individuals to a certificate's numbers.

The only place where rigs, reduction and procedure meet. It draws the bat and the balls, has
the bench and the wall rig measure them, sets the place the measurement gives, fires until
enough hits are valid, and seals what really happened beside the raw records.
"""

from __future__ import annotations

import datetime
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab.filming import film_of
from virtual_lab.lab.fitting import (
    nominal_places,
    require_ball,
    require_motion,
    require_places,
    require_rig,
)
from virtual_lab.lab.measurand import measurand
from virtual_lab.lab.naming import constant_name, lot_constants, with_records
from virtual_lab.measurement.certification import Certification, evaluate
from virtual_lab.measurement.procedure import Procedure, aimed_place, next_places, to_set
from virtual_lab.measurement.reduction.observations import along_of
from virtual_lab.measurement.session_reduction import (
    CONTROL,
    Reduced,
    measure_bat,
    measure_lot,
    reduce_session,
)
from virtual_lab.records.session import Session
from virtual_lab.simulation.collision.ladder import Ladder, probing_scenes
from virtual_lab.simulation.collision.modal import kernel_is_compiled
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.rig import (
    ImpactStation,
    MotionRung,
    Reality,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
    find_rig,
)
from virtual_lab.simulation.truth import Sealed, draw_balls, made_bat
from virtual_lab.streams import Draws, Quiet, commitment
from virtual_lab.units import INCH

__all__ = ["BALL_RIG", "BENCH_RIG", "Laboratory", "Say", "Tested"]

Array = NDArray[np.float64]
Say = Callable[[str], None]
BENCH_RIG, BALL_RIG = "bench", "ball-wall"
SEED_BITS = 128  # of a seed that is drawn: too many to try
EFFICIENCY_U = 2e-3  # standard uncertainty of e_A that six valid hits reach (README, coverage)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tested:
    """A certification, and the truth beside it that only a study may open."""

    certification: Certification
    sealed: Sealed
    control: Tested | None = None  # of the control bat, where the rules ask for one
    film: Callable[[Path], None] | None = None  # films the first shot into a folder, if one can


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory:
    """One laboratory on the day of one test."""

    rules: Entry[Procedure]
    seed: int
    salt: bytes
    reality: Reality
    draws: Draws
    collision: Ladder
    day: FaultSet
    stations: Mapping[Stage, Station]
    specimen: Specimen
    session: Session
    instruments: RecordDetail = RecordDetail.FULL
    motion: MotionRung = MotionRung.CLOSED_FORM
    control: float = 1.0  # true e of the control bat with these balls over the e it is known by

    @classmethod
    def open(
        cls,
        *,
        bat: BatSpec,
        ball: BallSpec,
        rules: Entry[Procedure],
        seed: int | None,
        rig: str,
        reality: Reality,
        rung: str | None,
        day: FaultSet,
        unverified: Mapping[str, str],
        instruments: RecordDetail = RecordDetail.FULL,
        motion: MotionRung = MotionRung.CLOSED_FORM,
        collision: Ladder | None = None,
        made: bool = True,
        test: int | None = None,
    ) -> Laboratory:
        """Commission the rigs and draw the individuals.

        A ladder handed in serves many laboratories; a bat that is not `made` is its drawing.
        Without a seed one is drawn.
        """
        sealing = _sealing(seed, reality)
        seed = secrets.randbits(SEED_BITS) if seed is None else seed
        draws = reality.draws(seed)
        own = draws if test is None else reality.draws(seed, test)
        rigs = {Stage.BENCH: BENCH_RIG, Stage.BALLS: BALL_RIG, Stage.IMPACT: rig}
        require_rig(find_rig(rig, Stage.IMPACT), rules.spec)
        require_motion(find_rig(rig, Stage.IMPACT), motion)
        require_places(rules.spec, bat)
        require_ball(rules.spec, ball)
        ideal = reality is Reality.IDEAL
        stations = {
            stage: day.station(stage, find_rig(name, stage).commission(draws, ideal=ideal))
            for stage, name in rigs.items()
        }
        salt = secrets.token_bytes(16)
        collision = collision or Ladder(
            probe=probing_scenes(
                ball,
                rules.spec.ball_speed + (rules.spec.bat_speed or 0.0),
                nominal_places(rules.spec, bat),
            ),
            standard_uncertainty=EFFICIENCY_U,
            rung=rung,
        )
        known = {
            constant_name(stage, name): estimate
            for stage, station in stations.items()
            for name, estimate in station.calibration.items()
        }
        return cls(
            rules=rules,
            seed=seed,
            salt=salt,
            reality=reality,
            draws=own,
            collision=collision,
            day=day,
            stations=stations,
            instruments=instruments,
            motion=motion,
            specimen=Specimen(
                bat=made_bat(bat, own if made else Quiet()),
                balls=draw_balls(ball, rules.spec.balls, own),
                collision=collision,
            ),
            session=Session(
                bat=bat.name,
                ball=ball.name,
                bat_sport=bat.sport or "",
                ball_sport=ball.sport or "",
                date=datetime.date.today().isoformat(),
                rigs={stage.value: name for stage, name in rigs.items()},
                procedure_text=rules.text,
                calibration=day.calibration(known | lot_constants(ball)),
                records={},
                simulation={
                    "reality": reality.value,
                    "sealing": sealing,
                    "seed_commitment": commitment(salt, seed),
                    "unverified_numbers": dict(unverified),
                },
            ),
        )

    def run(self, say: Say) -> Tested:
        """Measure bat and balls, fire, judge, and fire again until the rules are content."""
        procedure, ideal = self.rules.spec, self.reality is Reality.IDEAL
        aged, bench, wall = self.measured(say)
        session = aged.session
        bat = {name: budget.value for name, budget in measure_bat(session).items()}
        percussion = aimed_place(bat, procedure.pivot_from_knob)
        turn_rate = float(procedure.turn_rate(bat["length"]))
        if not kernel_is_compiled():
            say("compiling the collision kernel, which happens once and takes about five seconds")
        rounds: list[RigOutput] = []
        orders: list[ShotPlan] = []
        fired, valid, sought = np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0)
        while (asked := next_places(procedure, percussion, fired, valid, sought)).size:
            # set so that balls strike where the rules ask, by what is known of the cannon
            places = to_set(asked - along_of(session), exact=ideal)
            say(f"impact rig: round {len(rounds) + 1}, {_said(asked)}")
            order = replace(
                aged._order(np.arange(fired.size, fired.size + places.size), places),
                turn_rate=turn_rate,
                motion=self.motion,
            )
            orders.append(order)
            rounds.append(aged._play(Stage.IMPACT, order))
            session = with_records(session, Stage.IMPACT, rounds)
            reduced = reduce_session(session)
            fired, valid = reduced.readings.place, reduced.judgement.valid
            sought = reduced.sought.value
        rungs = {"collision": self.collision.report(), "motion": _motion_report(self.motion)}
        session = replace(session, simulation={**session.simulation, "rungs": rungs})
        return Tested(
            certification=evaluate(session, reduced),
            sealed=aged._seal(reduced, bench, wall, rounds),
            film=film_of(
                aged.stations[Stage.IMPACT],
                *aged.day.done(Stage.IMPACT, orders[0], aged.specimen),
                aged.draws,
                session,
            ),
        )

    def measured(self, say: Say) -> tuple[Laboratory, RigOutput, RigOutput]:
        """Measure bat and balls: return the laboratory ready to fire, and what was done."""
        balls = np.arange(self.rules.spec.balls)
        say("bench: weighing, balancing and swinging the bat, weighing the balls")
        bench = self._play(Stage.BENCH, self._order(balls, np.nan))
        say(f"ball-wall rig: {self.rules.spec.wall_hits} hits of each of {balls.size} balls")
        order = self._wall_order(balls)
        wall = self._play(Stage.BALLS, order)
        session = with_records(self.session, Stage.BENCH, [bench])
        session = with_records(session, Stage.BALLS, [wall])
        found = self._with_balls_as_found(order, wall)
        lot = replace(found.specimen.balls, used=measure_lot(session).used)
        specimen = replace(found.specimen, balls=lot)
        return replace(found, session=session, specimen=specimen), bench, wall

    def _order(self, shot: NDArray[np.int_], place: Array | float) -> ShotPlan:
        """Return an order of shots that take the balls in turn, but for those set aside."""
        used = np.arange(self.rules.spec.balls)[self.specimen.balls.used]
        return ShotPlan(
            slot=shot,
            ball=used[shot % used.size],
            speed=np.full(shot.shape, self.rules.spec.ball_speed),
            place=np.broadcast_to(np.asarray(place, dtype=float), shot.shape),
            rung=self.instruments,
        )

    def _wall_order(self, balls: NDArray[np.int_]) -> ShotPlan:
        """Return an order that fires every ball at the wall at the speeds in turn: it ages."""
        procedure = self.rules.spec
        speeds = np.tile(procedure.wall_speeds, procedure.wall_hits)
        ball = balls.repeat(speeds.size)
        return ShotPlan(
            slot=np.arange(ball.size),
            ball=ball,
            speed=np.tile(speeds, balls.size),
            place=np.zeros(ball.shape),
            rung=self.instruments,
        )

    def _with_balls_as_found(self, order: ShotPlan, wall: RigOutput) -> Laboratory:
        """Return the laboratory whose lot has the e0 that its wall hits found on average.

        That lot is the measurand's, and the bat meets it: what a ball gains or loses between
        the wall and the bat is left out.
        """
        balls = self.specimen.balls.as_found(order.ball, wall.truth["restitution_loss"])
        return replace(self, specimen=replace(self.specimen, balls=balls))

    def _play(self, stage: Stage, order: ShotPlan) -> RigOutput:
        return self.day.play(stage, self.stations[stage], order, self.specimen, self.draws)

    def _seal(
        self, reduced: Reduced, bench: RigOutput, wall: RigOutput, rounds: list[RigOutput]
    ) -> Sealed:
        impact = cast("ImpactStation", self.stations[Stage.IMPACT])
        return Sealed(
            seed=self.seed,
            salt=self.salt,
            reality=self.reality.value,
            bat=self.specimen.bat,
            bat_properties=bench.truth,
            balls=self.specimen.balls,
            constants={
                constant_name(stage, name): value
                for stage, station in self.stations.items()
                for name, value in station.true_constants.items()
            }
            | ({CONTROL: self.control} if self.rules.spec.controlled else {}),
            measurand=measurand(impact, self.specimen, reduced, self.control),
            place=reduced.readings.place,
            shots={
                name: np.concatenate([play.truth[name] for play in rounds])
                for name in rounds[0].truth
            },
            wall_hits=wall.truth,
            faults=self.day.names,
        )


def _sealing(seed: int | None, reality: Reality) -> str:
    """Return whether who has the records could find the truth again, by trying seeds."""
    if reality is not Reality.REAL:
        return "reproducible: nothing is random, not sealed"
    if seed is not None:
        return "reproducible: seed chosen by the operator, not sealed"
    return f"sealed: seed of {SEED_BITS} random bits, with the truth alone"


def _motion_report(motion: MotionRung) -> dict[str, str]:
    pinned = "" if motion is MotionRung.CLOSED_FORM else ", as asked for"
    return {"rung": motion.value, "reason": f"{motion.value}{pinned}"}


def _said(places: Array) -> str:
    """Return a round in words: how many shots, and where they go if not to one place."""
    where = sorted({round(float(place) / INCH, 2) for place in places})
    along = f" at {', '.join(f'{place:g}' for place in where)} in" if len(where) > 1 else ""
    return f"{places.size} shots{along}"
