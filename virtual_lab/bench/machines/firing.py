"""Firing of balls at the wall and at the bat under the conditions of the day."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import tau
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.table import action_table
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory
from virtual_lab.records import EncoderRecord, GateRecord
from virtual_lab.simulation.faults.fault import (
    instrument_of,
    with_instrument,
    with_sheet,
)
from virtual_lab.simulation.physics.truth import TrueBalls
from virtual_lab.simulation.stations.rig import (
    FilmingStation,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
)

AGAIN = 2_000_000  # number of the first repeated hit, above the numbers of lot and check ball


class ShotConditions(NamedTuple):
    """Conditions on which a shot depends, besides the laboratory."""

    shot: int
    ball: int
    place: float  # [m]
    turn_rate: float  # angular rate of a swung bat [rad/s]; 0 for a bat at rest
    ready: frozenset[str]  # steps of preparation that were done
    scrap: int  # number of shots since the scrap was cleared
    shift: tuple[tuple[float, float], ...]  # requested moves of the aim, along and across [m]
    warm: int  # number of hits of the ball within its rest time
    wall: int  # number of wall tests of the lot


@dataclass(frozen=True)
class Firing:
    """The machines that fire balls at the wall and at the bat."""

    laboratory: Laboratory
    shots: dict[ShotConditions, RigOutput] = field(default_factory=dict)  # cache of shots
    # cache of sketches
    sketches: dict[ShotConditions, dict[str, Any]] = field(default_factory=dict)
    # cache: laboratory with worn balls, by number of wall tests
    after_walls: dict[int, Laboratory] = field(default_factory=dict)

    def wall(self, earlier: int) -> RigOutput:
        """Fire the lot at the wall, as worn by `earlier` wall tests. Return records and truth."""
        laboratory = self._age_balls(earlier)
        rules = laboratory.rules.spec
        hits = rules.balls * rules.wall_hits * len(rules.wall_speeds)
        return _fire_at_wall(laboratory, rules.balls, hits * earlier)

    def wall_again(self, day: Day, balls: int, earlier: int) -> RigOutput:
        """Fire the first `balls` balls of the lot at the wall again. Return records and truth.

        `earlier` is the number of such repeats before this one.
        """
        laboratory = self._age_balls(day.times("hit-wall"))
        specimen = replace(laboratory.specimen, balls=specimen_at(Stage.IMPACT, laboratory).balls)
        laboratory = replace(laboratory, specimen=specimen)
        return _fire_at_wall(laboratory, balls, AGAIN * (earlier + 1))

    def _age_balls(self, walls: int) -> Laboratory:
        """Return the laboratory with its balls worn by `walls` wall tests."""
        if walls < 1:
            return self.laboratory
        if walls not in self.after_walls:
            before, play = self._age_balls(walls - 1), self.wall(walls - 1)
            log: Any = play.records["log"]
            loss = play.truth["restitution_loss"]
            balls = before.specimen.balls.after_hits(log.ball.astype(int), loss)
            specimen = replace(before.specimen, balls=balls)
            self.after_walls[walls] = replace(before, specimen=specimen)
        return self.after_walls[walls]

    def balls(self, day: Day) -> TrueBalls:
        """Return the true balls of the lot, worn by the wall tests of the day."""
        return self._age_balls(day.times("hit-wall")).specimen.balls

    def station_aimed_at(self, shift: tuple[tuple[float, float], ...]) -> Station:
        """Return the rig with its cannon moved by the requested amounts plus setting errors."""
        station = self.laboratory.stations[Stage.IMPACT]
        if not shift:
            return station
        slots = np.arange(len(shift))
        errors = action_table().consequences.aim_setting * self.laboratory.draws.normal(
            "rehearsal.aim", 2, slots
        )
        displacement = (np.array(shift) + errors).sum(axis=0)
        cannon: Any = station
        true = cannon.cannon.true
        return alter_instrument(
            station,
            "cannon",
            along=true["along"] + displacement[0],
            across=true["across"] + displacement[1],
        )

    def conditions(self, day: Day) -> ShotConditions:
        """Return the conditions of the next shot. Raises `InputError` without ball or position."""
        if day.ball is None or day.place is None:
            raise InputError("fire", "cannon", None, "no ball, or no place: decide() comes first")
        rest_time = action_table().consequences.ball_rest
        swung = self.laboratory.rules.spec.bat_speed is not None
        return ShotConditions(
            shot=len(day.fired),
            ball=day.ball,
            place=day.place,
            turn_rate=float(Desk(day).preparation.turn_rate[0]) if swung else 0.0,
            ready=day.ready - {"clear-scrap"},
            scrap=day.scrap,
            shift=day.shift,
            warm=sum(ball == day.ball and day.seconds - at < rest_time for ball, at in day.fired),
            wall=day.times("hit-wall"),
        )

    def shot(self, shot: ShotConditions) -> tuple[ShotPlan, RigOutput]:
        """Fire one shot at the bat. Return its plan as requested, and records with truth."""
        plan = self._plan(shot, self.laboratory.rules.spec.ball_speed)
        if shot not in self.shots:
            self.shots[shot] = self._play(plan, shot)
        return plan, self.shots[shot]

    def actual_conditions(self, shot: ShotConditions) -> tuple[Laboratory, ShotPlan]:
        """Return the laboratory and the plan with which a shot really takes place.

        The ball may be warm, scrap may trip a gate, the aim may have moved, and a low pressure
        lowers the speed.
        """
        table, speed = action_table().consequences, self.laboratory.rules.spec.ball_speed
        laboratory = self._age_balls(shot.wall)
        balls = laboratory.specimen.balls
        restitution = balls.restitution.copy()
        restitution[shot.ball] -= table.warm_loss * shot.warm
        station: Any = self.station_aimed_at(shot.shift)
        if shot.scrap and hasattr(station.gates.spec, "sabot_rate"):
            station = with_sheet(station, "gates", sabot_rate=_trip_probability(shot))
        laboratory = replace(
            laboratory,
            stations={**laboratory.stations, Stage.IMPACT: station},
            specimen=replace(laboratory.specimen, balls=replace(balls, restitution=restitution)),
        )
        slow = 0.0 if "wait-pressure" in shot.ready else table.slow_by
        return laboratory, self._plan(shot, speed - slow)

    def _plan(self, shot: ShotConditions, speed: float) -> ShotPlan:
        return ShotPlan(
            slot=np.array([shot.shot]),
            ball=np.array([shot.ball]),
            speed=np.array([speed]),
            place=np.array([shot.place]),
            turn_rate=shot.turn_rate,
            detail=self.laboratory.setup.detail,
            motion=self.laboratory.setup.motion,
        )

    def _play(self, requested: ShotPlan, shot: ShotConditions) -> RigOutput:
        table, draws = action_table().consequences, self.laboratory.draws
        tripping = float(draws.uniform("rehearsal.scrap", slots=requested.slot)[0]) + 0.5
        laboratory, plan = self.actual_conditions(shot)
        station: Any = laboratory.stations[Stage.IMPACT]
        if isinstance(station, FilmingStation):  # frames are made when they are viewed
            station = station.without_camera()
            stations = {**laboratory.stations, Stage.IMPACT: station}
            laboratory = replace(laboratory, stations=stations)
        play = laboratory.play(Stage.IMPACT, plan)
        records = {**play.records, "log": requested.log()}
        gates, encoder = records["gates"], records.get("encoder")
        if tripping < _trip_probability(shot) and isinstance(gates, GateRecord):
            times = gates.times.copy()
            times[:, 0, 0, 0] -= table.scrap_ahead / play.truth["speed"]
            records["gates"] = replace(gates, times=times)
        if isinstance(encoder, EncoderRecord):
            records["encoder"] = self._add_rotation(encoder, station.encoder, shot, requested)
        return replace(play, records=records)

    def _add_rotation(
        self, record: EncoderRecord, encoder: Any, shot: ShotConditions, plan: ShotPlan
    ) -> EncoderRecord:
        """Return the encoder record with the effects of omitted steps.

        It begins at a random count if the encoder was not set to zero, and the bat rotates before
        the hit if the trainee did not wait until it was at rest.
        """
        draws, turn = self.laboratory.draws, encoder.spec.counts_per_turn
        counts = record.counts
        if "wait-rest" not in shot.ready:
            sign = draws.normal("rehearsal.rest", slots=plan.slot)
            rate = action_table().consequences.swing_left * np.where(sign < 0, -1.0, 1.0)
            counts = counts + np.round(rate[:, None] * turn / tau * record.times)
        if "zero-encoder" not in shot.ready:
            zero = draws.uniform("rehearsal.zero", slots=plan.slot) + 0.5
            counts = counts + np.round(zero * turn)[:, None]
        return record if counts is record.counts else replace(record, counts=counts)


def _fire_at_wall(laboratory: Laboratory, balls: int, first: int) -> RigOutput:
    """Fire the first `balls` of a lot at the wall, with hits numbered from `first`."""
    rules = laboratory.rules.spec
    speeds = np.tile(rules.wall_speeds, rules.wall_hits)
    ball = np.arange(balls).repeat(speeds.size)
    plan = ShotPlan(
        slot=first + np.arange(ball.size),
        ball=ball,
        speed=np.tile(speeds, balls),
        place=np.zeros(ball.shape),
        detail=laboratory.setup.detail,
    )
    return laboratory.play(Stage.BALLS, plan)


def _trip_probability(shot: ShotConditions) -> float:
    """Return the probability that scrap trips the first gate before the ball does."""
    return 1 - (1 - action_table().consequences.scrap) ** shot.scrap


def specimen_at(stage: Stage, laboratory: Laboratory) -> Specimen:
    """Return the true bat and balls at a stage of the test, including the effects of the faults.

    A stage is the bench, the balls or the impact.
    """
    nothing, first = np.zeros(1), np.zeros(1, dtype=int)
    plan = ShotPlan(slot=first, ball=first, speed=nothing, place=nothing)
    return laboratory.setup.faults.apply(stage, plan, laboratory.specimen)[1]


def alter_instrument(station: Station, part: str, **true: float) -> Station:
    """Return a copy of a station in which one instrument has changed true constants.

    `part` is the station's name for this instrument. The keyword arguments `true` are the new
    values [SI], keyed by the name of the constant. Raises `AttributeError` if the station has no
    such instrument, and `KeyError` for an unknown constant.
    """
    return with_instrument(station, part, instrument_of(station, part).with_true(**true))
