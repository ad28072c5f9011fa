"""Frames and stops at the rigs: the gate and encoder records of shots that strike them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rigs.conformance import _Modal
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    MotionModel,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    find_rig,
)
from virtual_lab.streams import Streams
from virtual_lab.units import INCH

IN, OUT, FAR, NEAR = 0, 1, 0, -1
RIGS = ("astm-pivot", "ball-cannon")


def fired(
    rig: str, place: float = 6 * INCH, speed: float = 26.8224, **changes: Any
) -> tuple[Any, Specimen, ShotPlan, Streams]:
    """Return a station with changed surroundings, and the arguments of its play."""
    draws = Streams(5)
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    station: Any = find_rig(rig, Stage.IMPACT).commission(draws)
    for part, values in changes.items():
        station = replace(station, **{part: replace(getattr(station, part), **values)})
    specimen = Specimen(
        bat=make_bat(catalog.load_bat("r161").spec, draws),
        balls=draw_balls(ball, 6, draws),
        collision=_Modal(),
    )
    shots = np.arange(6)
    request = {"speed": np.full(6, speed), "place": np.full(6, place)}
    return station, specimen, ShotPlan(slot=shots, ball=shots, **request), draws


def play(rig: str, changes: dict[str, Any], **order: Any) -> RigOutput:
    station, specimen, plan, draws = fired(rig, **changes)
    return station.play(replace(plan, **order), specimen, draws)


def times(output: RigOutput) -> np.ndarray:
    record: Any = output.records["gates"]
    return np.asarray(record.times)


def unseen(output: RigOutput) -> np.ndarray:
    """Return a mask of the gates without a time of passage, (shot, direction, gate)."""
    gone = np.isnan(times(output))
    return gone.reshape(*gone.shape[:3], -1).all(axis=-1)


def test_a_ball_that_bounces_off_a_gate_frame_leaves_one_missing_and_one_wrong_time() -> None:
    """The ball strikes the upper bar of the near frame, and never reaches the bat.

    By hand: it returns from the face of the bar at the bar's restitution times its speed.
    """
    changes: Any = {"speed": 5.0, "frame": {"top": 0.015, "bottom": -0.3, "restitution": 0.25}}
    station, specimen, plan, draws = fired("astm-pivot", **changes)
    tall = replace(station.gates.spec, half_height=0.5)
    station = replace(station, gates=replace(station.gates, spec=tall))
    output = station.play(plan, specimen, draws)
    gates, gone = station.gates.distances, unseen(output)
    hit = gone[:, IN, NEAR]
    assert hit.any()
    assert gone[hit, OUT, NEAR].all()
    hit &= ~gone[:, OUT, FAR]  # shots without a second frame contact
    assert hit.any()
    far = times(output)[hit, :, FAR].mean(axis=-1)
    face = gates[NEAR] + station.frame.radius + specimen.balls.spec.radius
    path = gates[FAR] - face
    speed = output.truth["speed"][hit]
    wild = path / speed + path / (station.frame.restitution * speed)
    assert np.diff(far, axis=1)[:, 0] == pytest.approx(wild, rel=0.03)
    assert np.isnan(output.truth["collision_efficiency"][hit]).all()


@pytest.mark.parametrize("rig", RIGS)
def test_a_ball_that_the_far_frame_throws_back_leaves_no_time_at_all(rig: str) -> None:
    output = play(rig, {"frame": {"bottom": -0.03, "top": 0.03}})
    assert unseen(output).all()
    assert np.isnan(output.truth["collision_efficiency"]).all()


@pytest.mark.parametrize("rig", RIGS)
def test_a_frame_struck_after_the_bat_hides_the_gates_beyond_it(rig: str) -> None:
    """A low rebound strikes the lower bars: edges, sums and pymunk miss the same gates."""
    changes: dict[str, Any] = {"frame": {"bottom": -0.06, "top": 0.2}}
    usual = play(rig, {})
    orders: Any = ({}, {"motion": MotionModel.PYMUNK}, {"detail": RecordDetail.SUMMED})
    closed, carried, summed = (unseen(play(rig, changes, **order))[:, OUT] for order in orders)
    assert closed.any()
    assert not closed.all()
    np.testing.assert_array_equal(carried, closed)
    np.testing.assert_array_equal(summed, closed)
    assert (closed & ~unseen(usual)[:, OUT]).any()
    # missed gates: also those beyond a missed one
    assert (closed[:, FAR] >= closed[:, NEAR]).all()
    edge_times = times(play(rig, changes))
    present = ~np.isnan(edge_times)
    np.testing.assert_array_equal(edge_times[present], times(usual)[present])


def test_a_ball_beside_the_opening_never_moves_the_bat() -> None:
    """The posts of the frames stop the ball, so the encoder counts nothing."""
    output = play("astm-pivot", {"frame": {"tip_side": 0.17}})
    record: Any = output.records["encoder"]
    assert np.ptp(record.counts, axis=1).max() == 0
    assert np.isnan(output.truth["collision_efficiency"]).all()


def test_the_recoil_reverses_at_the_stop() -> None:
    """The recoil reverses at the angle of the stop, with its restitution, ringing included."""
    stop = {"stop": {"angle": 0.5, "restitution": 0.5}}
    station = fired("astm-pivot")[0]
    free: Any = play("astm-pivot", {}).records["encoder"]
    held: Any = play("astm-pivot", stop).records["encoder"]
    turn = station.encoder.scale * station.encoder.spec.counts_per_turn / (2 * np.pi)
    free_angle, angle = (each.counts - each.counts[:, :1] for each in (free, held))
    assert angle.max() / turn == pytest.approx(0.5, abs=0.02)
    after = 0.5 - 0.5 * (free_angle / turn - 0.5)
    late = free_angle / turn > 0.6
    assert angle[late] / turn == pytest.approx(after[late], abs=0.03)
    np.testing.assert_array_equal(
        angle[free_angle / turn < 0.45], free_angle[free_angle / turn < 0.45]
    )


def test_a_second_contact_throws_the_ball_back_faster() -> None:
    """With a stop close behind the bat and a weak rebound, the boards see the second rebound."""
    changes = {"place": 3.5 * INCH, "speed": 60.0}
    lively = {"stop": {"angle": 0.01, "restitution": 1.0}}
    slow, fast = (
        play("ball-cannon", changes | more).truth["rebound_speed"] for more in ({}, lively)
    )
    assert (fast > slow + 1.0).all()
    again, once = (play("ball-cannon", changes | more) for more in (lively, {}))
    assert not unseen(again)[:, OUT].any()
    late = np.nanmin(times(once)[:, OUT, NEAR], axis=(1, 2))
    assert (np.nanmin(times(again)[:, OUT, NEAR], axis=(1, 2)) < late).all()
