"""The ball-wall rig: effect of earlier hits on a ball."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallAgeing, BallSpec
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    Reality,
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    WallStation,
    find_rig,
)

SPEED = 26.8224  # m/s, 60 mph
AGEING = BallAgeing(speed=SPEED, loss=0.01, recovering=0.0, recovery_time=1.0)
TURNS = np.array([2, 0, 2, 2, 1, 0])


def play(
    reality: Reality, ageing: BallAgeing | None = AGEING, wall: float | None = None
) -> RigOutput:
    draws = reality.draws(5)
    ball = replace(catalog.load("balls", "baseball-2003", BallSpec).spec, ageing=ageing)
    specimen = Specimen(
        bat=make_bat(catalog.load_bat("r161").spec, draws),
        balls=draw_balls(ball, 3, draws),
        collision=ModalModel.of,
    )
    station = find_rig("ball-wall", Stage.BALLS).commission(draws, ideal=reality is Reality.IDEAL)
    assert isinstance(station, WallStation)
    if wall is not None:
        station = station.with_wall(wall)
        assert station.true_constants["wall.restitution"] == wall
    plan = ShotPlan(slot=np.arange(6), ball=TURNS, speed=np.full(6, SPEED), place=np.zeros(6))
    return station.play(plan, specimen, draws)


def test_each_earlier_hit_of_a_ball_reduces_its_restitution() -> None:
    """Ball 2 is hit three times, ball 0 twice, ball 1 once; each hit costs 1 % for good."""
    truth = play(Reality.NOISE_FREE).truth
    assert truth["restitution_loss"] == pytest.approx([0, 0, 0.01, 0.02, 0, 0.01], abs=1e-12)
    assert truth["ball_restitution"] == pytest.approx(0.55 - truth["restitution_loss"], abs=1e-12)


def test_a_real_balls_hits_scatter_about_the_loss() -> None:
    """With the same seed without aging, the difference is the loss alone."""
    aged, fresh = play(Reality.REAL).truth, play(Reality.REAL, ageing=None).truth
    difference = fresh["ball_restitution"] - aged["ball_restitution"]
    assert difference == pytest.approx(aged["restitution_loss"], abs=1e-15)
    assert np.array_equal(fresh["restitution_loss"], np.zeros(6))


def test_ideal_balls_do_not_age() -> None:
    assert not play(Reality.IDEAL).truth["restitution_loss"].any()


def test_the_lot_as_found_has_each_balls_mean_loss() -> None:
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    lot = draw_balls(ball, 4, Reality.IDEAL.draws(0))
    found = lot.after_hits(TURNS, np.array([0, 0, 0.01, 0.02, 0, 0.01]))
    assert found.restitution == pytest.approx([0.545, 0.55, 0.54, 0.55], abs=1e-12)


def test_a_wall_that_gives_slows_the_rebound() -> None:
    """Without air and noise, time back over time in is 1 over e0 times the wall's restitution."""
    for wall, ratio in ((None, 0.55), (1.0, 0.55), (0.9, 0.495)):
        played = play(Reality.IDEAL, wall=wall)
        times = played.records["gates"].times.mean(axis=-1)
        back = (times[:, 0, 1] - times[:, 0, 0]) / (times[:, 1, 0] - times[:, 1, 1])
        assert back == pytest.approx(ratio, rel=1e-9)
        assert played.truth["ball_restitution"] == pytest.approx(0.55, abs=1e-12)
