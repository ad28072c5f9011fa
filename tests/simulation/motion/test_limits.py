"""Limits of settings and of models of the motion, and the messages beyond them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pymunk
import pytest

from tests.simulation.motion.scenes import BODY, RADIUS, Array, frame_at, play, scattered, scene
from virtual_lab.catalog.specs import Profile
from virtual_lab.errors import InputError
from virtual_lab.simulation.motion import pymunk_scene
from virtual_lab.simulation.motion.played import Target
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, longest_step, play_pymunk
from virtual_lab.simulation.motion.scene import FrameSpec, PivotedBat, ShotScene
from virtual_lab.simulation.motion.touch import move, nearness
from virtual_lab.units import INCH

EVERY = pytest.mark.parametrize("model", ["closed-form", "events", "pymunk"])


@pytest.mark.parametrize(
    ("key", "settings", "allowed"),
    [
        ("step", {"step": 1e-2}, "allowed: from 1e-07 s, below 0.00235 s"),
        ("step", {"step": 0.0}, "from 1e-07 s"),
        ("step", {"step": float("nan")}, "from 1e-07 s"),
        ("iterations", {"iterations": 9}, "allowed: 10 to 1000"),
        ("iterations", {"iterations": 10**6}, "allowed: 10 to 1000"),
        ("slop", {"slop": 0.1}, "allowed: 0 to 0.0001 m"),
        ("slop", {"slop": -1e-5}, "allowed: 0 to 0.0001 m"),
    ],
)
def test_unsafe_settings_are_refused(key: str, settings: dict[str, Any], allowed: str) -> None:
    """0.1 m is pymunk's default slop; in a step of 1e-2 s a 60 mph ball would jump the barrel."""
    with pytest.raises(InputError) as refused:
        play_pymunk(scene(), PymunkSettings(**settings))
    assert refused.value.key == key
    assert allowed in str(refused.value)


@pytest.mark.parametrize(
    ("speed", "step", "missed"), [(26.8, 1e-2, 0.74), (62.6, 2e-3, 0.45), (62.6, 1e-3, 0.0)]
)
def test_plain_pymunk_misses_the_stated_share(speed: float, step: float, missed: float) -> None:
    """A bar and a ball with radii of 31.8 and 36.6 mm; 100 balls, spread evenly over a step."""
    passed = 0
    for shot in range(100):
        space = pymunk.Space()
        space.collision_slop = 1e-5
        bar = pymunk.Segment(space.static_body, (0, -0.5), (0, 0.5), 0.0318)
        ball = pymunk.Body(0.145, np.inf)
        ball.position, ball.velocity = (-0.2 - speed * step * (shot + 0.5) / 100, 0.0), (speed, 0.0)
        space.add(bar, ball, pymunk.Circle(ball, 0.0366))
        while ball.velocity.x == speed and ball.position.x < 0.1:
            space.step(step)
        passed += ball.position.x >= 0.1
    assert passed / 100 == pytest.approx(missed, abs=0.02)


@pytest.mark.parametrize(("step", "lost"), [(1e-2, 0.41), (1e-3, 0.07), (1e-4, 0.0075)])
def test_plain_pymunk_loses_the_stated_energy(step: float, lost: float) -> None:
    """A bat of 0.885 kg turns freely about a joint, 0.44 m from its center, at 11.5 rad/s."""
    space = pymunk.Space()
    body = pymunk.Body(0.885, 0.05)
    body.position, body.velocity, body.angular_velocity = (0.0, -0.44), (11.5 * 0.44, 0.0), 11.5
    space.add(body, pymunk.PivotJoint(space.static_body, body, (0.0, 0.0)))
    before = body.kinetic_energy
    for _ in range(round(1 / step)):
        space.step(step)
    assert 1 - body.kinetic_energy / before == pytest.approx(lost, rel=0.1)


def test_the_longest_step_agrees_with_a_hand_calculation() -> None:
    """By hand: a swung tip adds to the speed, a thin post replaces the radius of the barrel."""
    limit = longest(scene())
    PymunkSettings(step=limit * 0.999).check(scene())
    with pytest.raises(InputError, match="step"):
        PymunkSettings(step=limit * 1.001).check(scene())
    outer = np.array(BODY.profile.outer_diameter)[np.array(BODY.profile.z) <= BODY.length / 3]
    assert limit == pytest.approx((0.0366 + outer.min() / 2) / 26.8, rel=0.02)
    assert longest(scene(frames=(frame_at(-0.5, radius=0.01),))) == pytest.approx(0.0466 / 26.8)
    swung = scene(rate=-40.0, angle=1.0)
    assert longest(swung) / limit == pytest.approx(26.8 / (26.8 + 40 * swung.bat.axis))
    assert longest(scene(vx=0.0)) == np.inf


def longest(played: ShotScene) -> float:
    return longest_step(played, played.start)


def test_without_settings_the_step_is_short_enough() -> None:
    """The ball passes ball radius and barrel in less than the usual step."""
    fast = scene(vx=190.0, duration=0.02)
    with pytest.raises(InputError, match="step"):
        PymunkSettings(step=1e-3).check(fast)
    hits = [play(fast, name).first(Target.BAT).time for name in ("pymunk", "events", "closed-form")]
    assert hits[0] == pytest.approx(hits[2])
    assert hits[1] == pytest.approx(hits[2])


def test_a_ball_that_starts_in_the_bat_is_refused() -> None:
    with pytest.raises(InputError, match="gap to the bat"):
        play_pymunk(scene(x=-0.05))


def test_a_frame_without_an_opening_is_refused() -> None:
    with pytest.raises(ValueError, match="about the line of fire"):
        FrameSpec(bottom=0.1, top=0.2, tip_side=0.0, knob_side=1.0, radius=0.01, restitution=0.5)


@EVERY
def test_every_model_refuses_an_impossible_shot(model: str) -> None:
    """A ball on the edge of the tip, and an e_A at which the bat would pass through the ball."""
    played = scene(z=[-0.02, 6 * INCH], efficiency=constant(-0.9))
    outcome = play(played, model)
    assert outcome.refused.tolist() == [
        "the ball strikes the edge of the bat's end, where no collision model holds",
        "the bat would pass through the ball: no contact has such an e_A",
    ]
    assert not len(outcome.pieces.time)
    assert np.isnan(outcome.at(played, 0.01).x).all()


@EVERY
def test_a_ball_past_the_tip_misses(model: str) -> None:
    """A miss is an outcome, not a refusal: the ball passes beside or above the bat."""
    played = scene(z=[-0.0367, 0.1], y=[0.0, 0.15], gravity=0.0)
    outcome = play(played, model)
    assert outcome.refused.tolist() == ["", ""]
    assert set(outcome.pieces.struck) == {""}
    last = outcome.at(played, played.duration)
    assert last.rate[:, 0].tolist() == [0, 0]
    assert (last.x > 1).all()


@EVERY
def test_a_grazing_hit_does_not_fail(model: str) -> None:
    """Contacts deeper than the resolution are played; those about it may be refused or missed."""
    touching = 0.0366 + float(scene().bat.radius(np.array(6 * INCH)))
    depth = np.array([1e-5, 1e-6, 1e-8, 0.0, -1e-8, -1e-6])
    outcome = play(scene(y=touching - depth, gravity=0.0, duration=0.05), model)
    assert outcome.refused[[0, 1, 5]].tolist() == ["", "", ""]
    hit = outcome.first(Target.BAT)
    assert {0, 1} <= set(hit.shot) <= {0, 1, 2, 3, 4}
    shallow = 26.8 * np.exp(-0.006 * 0.9) * np.sqrt(2 * depth[:2] / touching)
    assert hit.speed[:2] == pytest.approx(shallow, rel=6e-2)
    assert (hit.speed > 0).all()


def test_a_frame_that_pymunk_ignores_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test changes pymunk so that it ignores every contact."""

    def ignore(_: Any, arbiter: Any, *__: Any) -> None:
        arbiter.process_collision = False

    monkeypatch.setattr(pymunk_scene._Shot, "_pass_others", ignore)
    with pytest.raises(RuntimeError, match="no contact with a frame"):
        play(scene(y=0.17, frames=(frame_at(-0.5),)), "pymunk")


def constant(value: float) -> Callable[..., Array]:
    """Return a function whose e_A is the same everywhere."""
    return lambda place, *_: np.full(len(place), value)


@EVERY
@pytest.mark.parametrize("z", [-0.5 * RADIUS, BODY.length + 0.5 * RADIUS])
def test_a_ball_on_the_edge_of_either_end_is_refused(model: str, z: float) -> None:
    """No collision model holds at the edge of the tip or of the knob."""
    assert "edge of the bat's end" in str(play(scene(z=z), model).refused[0])


def test_a_frame_lets_a_ball_through_clear_of_its_bars() -> None:
    """Opening of ±200 mm, bars of 40 mm, ball of 73.2 mm, plane 10 mm up: clear up to 163.4 mm.

    From 276.6 mm on the ball passes outside the bar.
    """
    frame = frame_at(-0.5)._replace(up=0.01)
    for height, clear in ((0.1633, True), (0.1635, False), (0.2765, False), (0.2767, True)):
        assert frame.clears(0.01 + height, RADIUS) == clear
        assert frame.clears(0.01 - height, RADIUS) == clear


def test_no_outline_is_steeper_than_its_bound() -> None:
    """Between stations a monotone cubic is at most three times as steep as the chord."""
    for diameters in ((0.02, 0.02, 0.06, 0.06), (0.066, 0.06, 0.03, 0.025)):
        profile = Profile(z=(0.0, 0.3, 0.5, 0.8), outer_diameter=diameters)
        bat = PivotedBat(profile, 0.7, 0.2)
        z = np.linspace(0.0, 0.8, 100_001)
        steepest = np.abs(np.gradient(bat.radius(z), z)).max()
        assert 0.5 * bat.steepest / 1.5 < steepest <= bat.steepest


def test_the_sliding_rate_is_the_derivative_of_the_position() -> None:
    """The oracle is a central difference of the position, with random motions and without air."""
    played = scattered(12, seed=4, drag=0.0, gravity=0.0)
    every, step = np.arange(12), 1e-6
    before, after = (
        nearness(played, move(played, played.start, np.full(12, sign * step), every)).place
        for sign in (-1.0, 1.0)
    )
    rate = nearness(played, played.start).sliding
    assert rate == pytest.approx((after - before) / (2 * step), rel=1e-6, abs=1e-6)
