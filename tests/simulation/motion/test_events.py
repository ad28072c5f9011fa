"""Weak rebounds at the rigs: event stepping agrees with pymunk and with scipy's integrator."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from tests.laboratories import opened
from tests.simulation.motion.reference import reference
from virtual_lab import catalog
from virtual_lab.relations.flight import drag_rate
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.motion import pymunk_scene
from virtual_lab.simulation.motion.events import play_events
from virtual_lab.simulation.motion.played import Pieces, Target
from virtual_lab.simulation.motion.pymunk_scene import play_pymunk
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.simulation.physics.beam import beam_of, outer_diameter
from virtual_lab.simulation.stations.cannon_station import RestingBatStation
from virtual_lab.simulation.stations.flights import (
    AHEAD,
    RECORD,
    RestingBat,
    Surroundings,
    TrueFlights,
    scene_of,
    simulate_flights,
)
from virtual_lab.simulation.stations.impact import rebound_velocity
from virtual_lab.simulation.stations.rig import ShotPlan, Stage
from virtual_lab.units import INCH

COUNTS = pytest.mark.parametrize("count", [2, pytest.param(17, marks=pytest.mark.long)])
STOPS: tuple[dict[str, float], ...] = (
    {},
    {"angle": 0.8, "restitution": 0.9},  # lively stop: throws the bat after the ball
    {"angle": 0.3, "reach": 0.6},  # stop with its post behind the impact position
)


class WeakShots(NamedTuple):
    """Shots whose balls barely rebound."""

    passage: Passage
    bat: RestingBat
    around: Surroundings

    def part(self, chosen: slice) -> WeakShots:
        names = ("speed_in", "speed_out", "drag", "height", "slope_out")
        selected = {name: getattr(self.passage, name)[chosen] for name in names}
        bat = RestingBat(self.bat.profile, *(each[chosen] for each in self.bat[1:]))
        return WeakShots(replace(self.passage, **selected), bat, self.around)

    def scene(self) -> ShotScene:
        return scene_of(self.passage, self.bat, self.around, RECORD)

    def flown(self) -> TrueFlights:
        every = np.arange(len(self.bat.place))
        plan = ShotPlan(slot=every, ball=every, speed=self.passage.speed_in, place=self.bat.place)
        return simulate_flights(self.passage, plan, self.bat, self.around)


def weak_shots(count: int, stops: Sequence[dict[str, float]] = STOPS) -> Iterator[WeakShots]:
    """Yield `count` random shots for each rig with a bat at rest, and for each stop."""
    for procedure in catalog.names("procedures"):
        bat = "softball-34" if procedure == "asa" else "r161"
        laboratory = opened(bat, procedure=procedure, seed=3)
        station, ball = laboratory.stations[Stage.IMPACT], laboratory.specimen.balls.spec
        if not isinstance(station, RestingBatStation):
            continue
        body, around = laboratory.specimen.bat.body, station.surroundings(ball.radius)
        for number, stop in enumerate(stops):
            rng = np.random.default_rng([number, *procedure.encode()])
            speed = laboratory.rules.spec.ball_speed * rng.uniform(0.97, 1.03, count)
            mass, across = ball.mass * rng.uniform(0.98, 1.02, count), rng.normal(0, 3e-3, count)
            place, efficiency = rng.uniform(2, 6, count) * INCH, rng.uniform(-0.03, 0.04, count)
            tilt = np.arcsin(across / (ball.radius + outer_diameter(body.profile, place) / 2))
            back, up = rebound_velocity(efficiency, tilt, speed, 0.0)
            passage = Passage(
                speed_in=speed,
                speed_out=back,
                drag=drag_rate(1.2, 0.35, ball.radius, mass),
                radius=ball.radius,
                gravity=9.81,
                height=across + rng.normal(0, 0.06, count),
                slope_out=up,
            )
            axis = np.full(count, body.length - 6 * INCH)
            inertia = beam_of(body).inertia(axis)
            held = RestingBat(body.profile, axis, inertia, place, across, efficiency, mass)
            surroundings = around._replace(stop=replace(around.stop, **stop))
            yield WeakShots(passage, held, surroundings)


@COUNTS
def test_events_agree_with_pymunk(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same contacts, to 1e-9 of each number, with pymunk's overlap tolerance made small.

    Without a frame the two differ by about 1e-14, for any step of pymunk.
    """
    monkeypatch.setattr(pymunk_scene, "OVERLAP", 1e-13)
    struck: list[str] = []
    for shots in weak_shots(count):
        scene = shots.scene()
        played, other = play_events(scene), play_pymunk(scene)
        assert played.refused.tolist() == other.refused.tolist()
        struck += played.pieces.struck.tolist()
        assert played.pieces.struck.tolist() == other.pieces.struck.tolist()
        for name in ("shot", "time", "place", "speed"):
            value, true = getattr(played.pieces, name), getattr(other.pieces, name)
            assert value == pytest.approx(true, rel=1e-9, nan_ok=True), name
        for name in ("x", "y", "z", "vx", "vy", "vz", "angle", "rate"):
            value, true = getattr(played.pieces.state, name), getattr(other.pieces.state, name)
            assert value == pytest.approx(true, rel=1e-9, abs=1e-9), name
    assert struck.count(Target.START) > 11 * count
    assert {*struck} == {*Target}
    assert struck.count(Target.BAT_AGAIN) >= count


@COUNTS
def test_events_agree_with_scipy(count: int) -> None:
    """All equations stepped and contacts as events: contact times and speeds agree to 1e-11."""
    for shots in weak_shots(count):
        scene = shots.scene()
        played = play_events(scene)
        last = np.array(played.at(scene, scene.duration))
        for shot in np.flatnonzero(played.refused == ""):  # one shot strikes the tip's edge
            pieces = played.pieces.part(played.pieces.shot == shot)
            true = reference(scene.alone(shot), 0)
            assert pieces.struck.tolist()[1:] == [each[1] for each in true.contacts]
            for name, column in (("time", 0), ("place", 2), ("speed", 3)):
                expected = [each[column] for each in true.contacts]
                values = getattr(pieces, name)[1:]
                assert values == pytest.approx(expected, rel=1e-11, nan_ok=True), name
            end = [*true.place, *true.velocity, true.angle, true.rate]
            assert last[:, shot, shot] == pytest.approx(end, abs=1e-11)


def test_no_shot_depends_on_its_neighbours() -> None:
    """Flights have the same bits alone, in groups of seven and all together."""
    for shots in weak_shots(21):
        whole = shots.flown()
        for size in (1, 7):
            parts = [shots.part(slice(at, at + size)).flown() for at in range(0, 21, size)]
            for out in (False, True):
                ways = np.hstack([each.passage.trajectory_rows(out=out) for each in parts])
                assert ways.tobytes() == whole.passage.trajectory_rows(out=out).tobytes()
            late = [np.broadcast_to(each.separation_time, (size,)) for each in parts]
            assert (
                np.hstack(late).tobytes() == np.broadcast_to(whole.separation_time, (21,)).tobytes()
            )
            kicks = [
                (number * size + shot, *more)
                for number, each in enumerate(parts)
                for shot, *more in each.kicks
            ]
            assert tuple(kicks) == whole.kicks


def test_each_shot_may_have_an_axis_of_its_own() -> None:
    """Axis, inertia, ball radius and gravity per shot give the same bits as scenes of one shot."""
    for shots in weak_shots(5):
        scene, part = shots.scene(), 1 + np.arange(5) * 1e-3
        bat = replace(scene.bat, axis=scene.bat.axis * part, inertia=scene.bat.inertia / part)
        scene = replace(
            scene,
            bat=bat,
            gravity=scene.gravity * part,
            ball_radius=scene.ball_radius * part,
        )
        whole = play_events(scene).pieces
        for shot in range(5):
            pieces, alone = whole.part(whole.shot == shot), play_events(scene.alone(shot)).pieces
            assert pieces.time.tobytes() == alone.time.tobytes()
            assert np.array(pieces.state).tobytes() == np.array(alone.state).tobytes()


def way_back(pieces: Pieces) -> tuple[int, int, int]:
    """Return the rows of one shot for the arrival, the rebound, and the frame struck after it.

    The ball arrives at the bat, or at the obstacle it strikes instead. The rebound begins after the
    last contact with the bat, before any frame, once the ball moves backward.
    """
    hits, rows = pieces.struck.tolist(), len(pieces.time)
    first = hits.index(Target.BAT) if Target.BAT in hits else 1
    end = next((k for k in range(first + 1, rows) if hits[k] == Target.FRAME), rows)
    blows = [k for k in range(first, end) if hits[k] in (Target.BAT, Target.BAT_AGAIN)]
    last = max(blows, default=first)
    back = next((k for k in range(last, end) if pieces.state.vx[k] < 0), last)
    return first, back, next((k for k in range(back + 1, rows) if hits[k] == Target.FRAME), rows)


def test_flights_are_read_from_the_contacts() -> None:
    """A frame ends a flight out, and a later contact turns the bat; each shot is compared."""
    counts = {"again": 0, "missed": 0, "stopped": 0}
    for shots in weak_shots(40, STOPS[:2]):  # no post behind the bat
        scene, flown = shots.scene(), shots.flown()
        flights, pieces = flown.passage, play_events(scene).pieces
        late, met = (
            np.broadcast_to(each, (40,)) for each in (flown.separation_time, flown.reached_bat)
        )
        kicks: list[tuple[float, ...]] = []
        for shot in np.unique(pieces.shot):
            shot_pieces = pieces.part(pieces.shot == shot)
            (first, back, frame), state = way_back(shot_pieces), shot_pieces.state
            contact, up = scene.start.x[shot] + AHEAD, np.asarray(scene.frames[0].up)[shot]
            expected = {
                "speed_out": -state.vx[back],
                "slope_out": -state.vy[back] / state.vx[back],
                "release_plane": contact - state.x[back],
                "release_height": state.y[back] - up,
                "plane": contact - state.x[first],
            }
            if first == 1:
                expected["height"] = state.y[1] - up
            for name, true in expected.items():
                value = np.broadcast_to(getattr(flights, name), (40,))[shot]
                assert value == pytest.approx(true, rel=1e-9, abs=1e-12), name
            assert met[shot] == (shot_pieces.struck[first] == Target.BAT)
            assert late[shot] == pytest.approx(
                shot_pieces.time[back] - shot_pieces.time[first], rel=1e-12
            )
            if flights.frame_distance is not None and np.isfinite(flights.frame_distance[shot]):
                assert flights.frame_distance[shot] == pytest.approx(
                    contact - state.x[frame], rel=1e-9
                )
                counts["stopped"] += 1
            for k in np.flatnonzero(shot_pieces.struck == Target.BAT_AGAIN):
                after, change = (
                    shot_pieces.time[k] - shot_pieces.time[first],
                    state.rate[k] - state.rate[k - 1],
                )
                kicks.append((shot, after, change))
            counts["missed"] += not met[shot]
        assert np.array(flown.kicks) == pytest.approx(np.array(kicks))
        counts["again"] += len(kicks)
    assert min(counts.values()) > 4, counts
