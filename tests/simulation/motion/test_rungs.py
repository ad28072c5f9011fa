"""Both rungs against scipy's integrator, each other, and what mechanics keeps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.motion.scenes import (
    AXIS,
    BODY,
    INERTIA,
    RADIUS,
    Array,
    rigid,
    scattered,
    scene,
)
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.fidelity.motion_reference import reference
from virtual_lab.relations.flight import speed_after, time_before
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.outcome import Outcome
from virtual_lab.simulation.motion.scene import Obstacle, Scene, State, Stops, efficiency_of
from virtual_lab.simulation.physics.supports import Pinned
from virtual_lab.units import INCH

POST = Obstacle(kind="frame", x=(-0.6, -0.6), z=(0.36, 0.36), radius=0.02, restitution=0.6)
WALL = Obstacle(kind="wall", x=(-1.2, -1.2), z=(-2.0, 2.0), radius=0.05, restitution=0.5)


def assert_as_reference(played: Scene, outcome: Outcome, shot: int, within: float) -> None:
    true = reference(played, shot)
    own = outcome.events
    assert own.kind[own.shot == shot].tolist() == [c[1] for c in true.contacts]
    for column, name in ((0, "time"), (2, "place"), (3, "speed")):
        found = getattr(own, name)[own.shot == shot]
        assert found == pytest.approx([c[column] for c in true.contacts], abs=within)
    if not np.isnan(true.efficiency):
        assert outcome.collision_efficiency[shot] == pytest.approx(true.efficiency, abs=within)
        assert outcome.ball_velocity[shot] == pytest.approx(true.ball_velocity, abs=within)
        assert outcome.bat_rate[shot] == pytest.approx(true.bat_rate, abs=within)
    end = outcome.end.part(shot)
    assert [end.x, end.y, end.z] == pytest.approx(true.place, abs=within)
    assert [end.vx, end.vy, end.vz] == pytest.approx(true.velocity, abs=within)
    assert end.angle == pytest.approx(true.angle, abs=within)
    assert end.rate == pytest.approx(true.rate, abs=within)


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_as_scipy_integrates_it(rung: str) -> None:
    """A bat at rest or swung, a ball aslant and off the axis, drag, friction and gravity."""
    played = scattered(25, seed=1)
    outcome = play(played, rung)
    assert set(outcome.refused) == {""}
    assert np.isfinite(outcome.time).sum() > 15
    for shot in range(len(played)):
        assert_as_reference(played, outcome, shot, 1e-10)


def test_the_rungs_agree_whatever_the_step() -> None:
    from virtual_lab.simulation.motion.settings import Settings

    played = scattered(6, seed=2)
    closed = play(played, "closed-form")
    for step in (7e-4, 1.1e-4):
        carried = play(played, "pymunk", settings=Settings(step=step))
        for name in ("time", "place", "relative_speed", "collision_efficiency", "bat_rate"):
            found, true = getattr(carried, name), getattr(closed, name)
            assert found == pytest.approx(true, abs=1e-11, nan_ok=True), name
        for name in State.__slots__:
            assert getattr(carried.end, name) == pytest.approx(getattr(closed.end, name), abs=1e-9)
        assert carried.pivot_drift.max() < 1e-12


def test_at_rest_and_square_it_is_the_textbook() -> None:
    """By hand: the time over the distance, e_A, angular momentum, the speed drag leaves."""
    played = scene(z=[5 * INCH, 8 * INCH], gravity=0.0)
    outcome = play(played)
    z = np.array([5 * INCH, 8 * INCH])
    way = 0.9 - RADIUS - played.bat.barrel.radius(z)
    speed = 26.8 * np.exp(-0.006 * way)
    time = time_before(way, speed, 0.006)
    e_A = rigid(z, speed, np.full(2, 0.145), np.full(2, 0.5))
    assert outcome.time == pytest.approx(time, rel=1e-12)
    assert outcome.place == pytest.approx(z, rel=1e-15)
    assert outcome.relative_speed == pytest.approx(speed, rel=1e-12)
    assert outcome.ball_velocity[:, 0] == pytest.approx(-e_A * speed, rel=1e-12)
    recoil = 0.145 * (AXIS - z) * (1 + e_A) * speed / INERTIA
    assert outcome.bat_rate == pytest.approx(recoil, rel=1e-12)
    left = speed_after(0.2 - time, e_A * speed, 0.006)
    assert -outcome.end.vx == pytest.approx(left, rel=1e-12)


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_off_the_axis_the_ball_is_smooth(rung: str) -> None:
    """Back along the line of fire: e_A cos² - sin², as the machines reckon."""
    y = np.array([-0.02, 0.01, 0.03])
    outcome = play(scene(False, y=y, gravity=0.0), rung)
    angle = np.arcsin(y / (RADIUS + float(scene().bat.barrel.radius(np.array(6 * INCH)))))
    speed = 26.8 * np.cos(angle)
    e_A = rigid(np.full(3, 6 * INCH), speed, np.full(3, 0.145), np.full(3, 0.5))
    assert outcome.relative_speed == pytest.approx(speed, rel=1e-9)
    seen = -outcome.ball_velocity[:, 0] / 26.8
    assert seen == pytest.approx(e_A * np.cos(angle) ** 2 - np.sin(angle) ** 2, rel=1e-9)
    up = (1 + e_A) * speed * np.sin(angle)
    assert outcome.ball_velocity[:, 1] == pytest.approx(up, rel=1e-9)


def test_a_lossless_collision_keeps_energy_and_angular_momentum() -> None:
    """e0 = 1, no air, any angle and swing: both are kept, and by both rungs."""
    played = scattered(12, seed=3, restitution=1.0, drag=0.0, gravity=0.0, y=0.0, vy=0.0)
    played = scene(
        False,
        **{name: getattr(played.start, name) for name in State.__slots__},
        restitution=1.0,
        gravity=0.0,
        duration=0.12,
    )
    start, mass = played.start, 0.145
    for rung in ("closed-form", "pymunk"):
        outcome = play(played, rung)
        end = outcome.end
        assert np.isfinite(outcome.time).all()

        def energy(state: State) -> np.ndarray:
            return np.asarray(
                mass / 2 * (state.vx**2 + state.vy**2 + state.vz**2) + INERTIA / 2 * state.rate**2
            )

        def momentum(state: State) -> np.ndarray:
            """About the axis: recoil counts positive, as a blow on the barrel from -x gives."""
            arm = (AXIS - state.z) * state.vx + state.x * state.vz
            return np.asarray(mass * arm + INERTIA * state.rate)

        assert energy(end) == pytest.approx(energy(start), rel=1e-11)
        assert momentum(end) == pytest.approx(momentum(start), rel=1e-11)


def test_a_ladder_of_collisions_may_give_e_a() -> None:
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    model = ModalModel.of(BODY, Pinned(AXIS))
    played = scene(efficiency=efficiency_of(model, ball), z=np.array([4, 6, 8]) * INCH)
    outcome = play(played)
    expected = played.efficiency(
        outcome.place, outcome.relative_speed, played.balls.mass, played.balls.restitution
    )
    assert outcome.collision_efficiency == pytest.approx(expected)
    assert (np.diff(expected) != 0).all()


def test_what_the_closed_form_refuses_goes_to_pymunk() -> None:
    """A stop, a post beside one of the lines, and a wall the ball comes back to."""
    stops = Stops(low=-1.0, high=0.4, restitution=0.5)
    played = scene(z=[6 * INCH, 0.36, 6 * INCH], stops=stops, obstacles=(POST, WALL), duration=0.3)
    cheap = play(played, "closed-form")
    assert cheap.refused.tolist() == [
        "the bat reaches a stop within the record",
        "a frame stands in the ball's way",
        "the bat reaches a stop within the record",
    ]
    assert np.isnan(cheap.bat_rate).all()
    assert not len(cheap.events.shot)
    outcome = play(played)
    assert outcome.refused.tolist() == ["", "", ""]
    assert outcome.rung.tolist() == ["pymunk"] * 3
    assert outcome.reason[1] == "no closed form: a frame stands in the ball's way"
    for shot in range(3):
        assert_as_reference(played, outcome, shot, 2e-7)  # a nanometre at a time, six strikes
    assert "stop" in outcome.events.kind[outcome.events.shot == 0].tolist()
    assert outcome.events.kind[outcome.events.shot == 1].tolist()[0] == "frame"


def test_each_shot_has_its_own_rung() -> None:
    """A post in the way of the second shot alone; the others keep the closed form to the bit."""
    z = np.array([5 * INCH, 0.36, 7 * INCH])
    played, bare = scene(z=z, obstacles=(POST,), duration=0.1), scene(z=z, duration=0.1)
    outcome, plain = play(played), play(bare)
    assert outcome.rung.tolist() == ["closed-form", "pymunk", "closed-form"]
    assert outcome.time[[0, 2]].tolist() == plain.time[[0, 2]].tolist()
    assert np.isnan(outcome.time[1])
    assert outcome.events.shot.tolist() == sorted(outcome.events.shot.tolist())
    assert set(outcome.events.shot.tolist()) == {0, 1, 2}


def test_a_bat_that_comes_back_strikes_again() -> None:
    """A lively stop throws the bat after a slow ball."""
    stops = Stops(low=-0.5, high=0.02, restitution=1.0)
    played = scene(z=3 * INCH, stops=stops, duration=0.5, vx=10.0, gravity=0.0)
    outcome = play(played)
    kinds = outcome.events.kind.tolist()
    assert kinds[:3] == ["bat", "stop", "bat again"]
    assert_as_reference(played, outcome, 0, 1e-9)


def test_a_full_turn_of_the_bat_is_a_second_contact() -> None:
    """No stop: a bat turns on and meets the ball it left almost dead."""

    def dead(place: Array, *_: Array) -> Array:
        return np.full(len(place), -0.02)

    played = scene(False, z=4 * INCH, efficiency=dead, duration=1.0, gravity=0.0)
    cheap = play(played, "closed-form")
    reached = play(played)
    assert cheap.refused.tolist() == ["ball and bat meet again"]
    assert reached.events.kind.tolist()[:2] == ["bat", "bat again"]
    assert_as_reference(played, reached, 0, 1e-8)


def test_a_bar_is_flown_over() -> None:
    """The same plan: over it, under it, and onto it."""
    bar = Obstacle(
        kind="frame", x=(-0.5, -0.5), z=(-0.1, 0.6), radius=0.01, restitution=0.5,
        low=-0.02, high=0.02,
    )  # fmt: skip
    played = scene(y=[0.07, -0.06, 0.03], obstacles=(bar,), gravity=0.0, duration=0.04)
    for rung in (None, "pymunk"):
        outcome = play(played, rung)
        assert outcome.events.kind[outcome.events.shot == 2].tolist() == ["frame"]
        assert "frame" not in outcome.events.kind[outcome.events.shot < 2].tolist()
    assert outcome.end.vx[2] == pytest.approx(-0.5 * 26.8, rel=2e-2)


@pytest.mark.parametrize("aside", [-1.0, 0.0, 1.0])
def test_a_ball_on_the_end_of_a_bar_strikes_it(aside: float) -> None:
    """Along the bar, from within its breadth: pymunk's own segment overlooks its end from there."""
    bar = Obstacle(kind="frame", x=(-0.5, -0.5), z=(0.1, 0.4), radius=0.02, restitution=0.5)
    played = scene(
        x=-0.53, z=-0.05, vx=aside, vz=10.0, obstacles=(bar,), gravity=0.0, duration=0.04
    )
    outcome = play(played, "pymunk")
    assert outcome.events.kind.tolist()[0] == "frame"
    assert_as_reference(played, outcome, 0, 1e-6)  # the nanometre that pymunk needs, on a curve
