"""All models of the motion against scipy's integrator, each other and conservation laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.simulation.motion.reference import reference
from tests.simulation.motion.scenes import (
    AXIS,
    INERTIA,
    MASS,
    RADIUS,
    Array,
    frame_at,
    play,
    rigid,
    scattered,
    scene,
    stop,
)
from virtual_lab.relations.flight import speed_after, time_before
from virtual_lab.simulation.motion import pymunk_scene
from virtual_lab.simulation.motion.played import PlayedShots, Target
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, play_pymunk
from virtual_lab.simulation.motion.scene import ShotScene, ShotState
from virtual_lab.units import INCH

EVERY = pytest.mark.parametrize("model", ["closed-form", "events", "pymunk"])
CARRIED = pytest.mark.parametrize("model", ["events", "pymunk"])


def struck(outcome: PlayedShots, shot: int = 0) -> list[str]:
    return outcome.pieces.struck[outcome.pieces.shot == shot].tolist()[1:]


def end(outcome: PlayedShots, played: ShotScene) -> Array:
    return np.array(outcome.at(played, played.duration))[..., 0]


def assert_as_reference(played: ShotScene, outcome: PlayedShots, shot: int, within: float) -> None:
    true = reference(played, shot)
    pieces = outcome.pieces.part(outcome.pieces.shot == shot)
    assert struck(outcome, shot) == [contact[1] for contact in true.contacts]
    for column, name in ((0, "time"), (2, "place"), (3, "speed")):
        expected = [contact[column] for contact in true.contacts]
        assert getattr(pieces, name)[1:] == pytest.approx(expected, abs=within, nan_ok=True)
    if Target.BAT in pieces.struck:
        hit = pieces.state.part(pieces.struck == Target.BAT)
        assert [hit.vx[0], hit.vy[0], hit.vz[0]] == pytest.approx(true.ball_velocity, abs=within)
        assert hit.rate[0] == pytest.approx(true.bat_rate, abs=within)
    last = [*true.place, *true.velocity, true.angle, true.rate]
    assert end(outcome, played)[:, shot] == pytest.approx(last, abs=within)


@EVERY
def test_every_model_agrees_with_scipy(model: str) -> None:
    """Bat at rest or swung, ball oblique and off the axis, with drag and gravity."""
    played = scattered(25, seed=1)
    outcome = play(played, model)
    assert set(outcome.refused) == {""}
    assert (outcome.pieces.struck == Target.BAT).sum() > 15
    for shot in range(played.shots):
        assert_as_reference(played, outcome, shot, 1e-10)


def test_the_models_agree_for_any_step() -> None:
    played = scattered(6, seed=2)
    times = np.linspace(0, 0.12, 9)
    closed = play(played, "closed-form")
    for step in (7e-4, 1.1e-4):
        carried = play_pymunk(played, PymunkSettings(step=step))
        for name in ("time", "place", "speed"):
            value, true = getattr(carried.pieces, name), getattr(closed.pieces, name)
            assert value == pytest.approx(true, abs=1e-11, nan_ok=True), name
        value, true = (np.array(each.at(played, times)) for each in (carried, closed))
        assert value == pytest.approx(true, abs=1e-9)


def test_steps_by_the_present_speed_find_the_same_contacts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Slow balls after a weak rebound, a bat that returns from its stop, and a frame."""
    shots, rng = 6, np.random.default_rng(11)
    played = scene(
        z=rng.uniform(3, 5, shots) * INCH,
        y=rng.uniform(-1e-3, 1e-3, shots),
        vx=rng.uniform(24, 60, shots),
        vz=rng.uniform(-0.3, 0.3, shots),
        efficiency=lambda place, *_: np.full(len(place), -0.02),
        stop=stop(0.6),
        frames=(frame_at(-0.3, bottom=-0.12),),
        gravity=0.5,
        duration=0.25,
    )
    steps: list[float] = []
    carried = pymunk_scene._Shot._carry

    def carry(shot: pymunk_scene._Shot, span: float) -> Array:
        steps.append(span)
        return carried(shot, span)

    monkeypatch.setattr(pymunk_scene._Shot, "_carry", carry)
    pieces = play_pymunk(played).pieces
    assert len(steps) < shots * played.duration / 3e-3  # the initial speed requires 0.9 ms
    fixed = play_pymunk(played, PymunkSettings(step=2e-4)).pieces
    assert pieces.struck.tolist() == fixed.struck.tolist()
    assert {*pieces.struck} == set(Target)
    for name in ("shot", "time", "place", "speed"):
        value, true = getattr(pieces, name), getattr(fixed, name)
        assert value == pytest.approx(true, rel=1e-11, nan_ok=True), name
    assert np.array(pieces.state) == pytest.approx(np.array(fixed.state), rel=1e-9, abs=1e-9)


@EVERY
def test_the_state_at_a_moment_is_that_at_the_end_of_a_shorter_record(model: str) -> None:
    moments = (0.01, 0.033, 0.08)
    shots: dict[str, Any] = {"z": [5 * INCH, 7 * INCH], "vz": 1.0}
    played = scene(**shots, duration=0.08)
    states = np.array(play(played, model).at(played, (0.0, *moments)))
    assert states[..., 0].tolist() == np.array(played.start).tolist()
    for column, moment in enumerate(moments, 1):
        shorter = scene(**shots, duration=moment)
        assert states[..., column] == pytest.approx(end(play(shorter, model), shorter), abs=1e-11)


def test_a_square_hit_on_a_bat_at_rest_agrees_with_the_textbook() -> None:
    """By hand: time from distance, e_A, angular momentum, and the speed after drag."""
    z = np.array([5, 8]) * INCH
    played = scene(z=z, gravity=0.0)
    outcome = play(played, "closed-form")
    path = 0.9 - RADIUS - played.bat.radius(z)
    speed = 26.8 * np.exp(-0.006 * path)
    time, e_A = time_before(path, speed, 0.006), rigid(z)
    hit = outcome.first(Target.BAT)
    assert hit.time == pytest.approx(time, rel=1e-12)
    assert hit.place == pytest.approx(z, rel=1e-15)
    assert hit.speed == pytest.approx(speed, rel=1e-12)
    assert hit.state.vx == pytest.approx(-e_A * speed, rel=1e-12)
    recoil = MASS * (AXIS - z) * (1 + e_A) * speed / INERTIA
    assert hit.state.rate == pytest.approx(recoil, rel=1e-12)
    final_speed = speed_after(0.2 - time, e_A * speed, 0.006)
    assert -end(outcome, played)[3] == pytest.approx(final_speed, rel=1e-12)


@EVERY
def test_a_ball_off_the_axis_slides_without_friction(model: str) -> None:
    """The speed back along the line of fire is e_A cos² - sin² of the speed in."""
    y = np.array([-0.02, 0.01, 0.03])
    played = scene(y=y, gravity=0.0, drag=0.0)
    hit = play(played, model).first(Target.BAT)
    angle = np.arcsin(y / (RADIUS + float(played.bat.radius(np.array(6 * INCH)))))
    speed, e_A = 26.8 * np.cos(angle), rigid(np.array(6 * INCH))
    assert hit.speed == pytest.approx(speed, rel=1e-9)
    back = e_A * np.cos(angle) ** 2 - np.sin(angle) ** 2
    assert -hit.state.vx / 26.8 == pytest.approx(back, rel=1e-9)
    assert hit.state.vy == pytest.approx((1 + e_A) * speed * np.sin(angle), rel=1e-9)


@EVERY
def test_a_lossless_collision_keeps_energy_and_angular_momentum(model: str) -> None:
    """Lossless impact without air, at any angle and swing."""

    def lossless(place: Array, *_: Any) -> Array:
        r = MASS * (AXIS - place) ** 2 / INERTIA
        return (1 - r) / (1 + r)

    played = scattered(12, seed=3, drag=0.0, gravity=0.0, y=0.0, vy=0.0, efficiency=lossless)
    outcome = play(played, model)
    assert (outcome.pieces.struck == Target.BAT).sum() == 12
    last = ShotState(*end(outcome, played))

    def energy(state: ShotState) -> Array:
        square = state.vx**2 + state.vy**2 + state.vz**2
        return np.asarray(MASS / 2 * square + INERTIA / 2 * state.rate**2)

    def momentum(state: ShotState) -> Array:
        """Return the angular momentum about the axis; recoil by a ball from -x is positive."""
        arm = (AXIS - state.z) * state.vx + state.x * state.vz
        return np.asarray(MASS * arm + INERTIA * state.rate)

    assert energy(last) == pytest.approx(energy(played.start), rel=1e-11)
    assert momentum(last) == pytest.approx(momentum(played.start), rel=1e-11)


@CARRIED
def test_a_post_affects_only_the_shots_that_strike_it(model: str) -> None:
    """The other shots have the contacts of the closed form."""
    z = np.array([5 * INCH, 0.38, 7 * INCH, 0.366])
    played = scene(z=z, duration=0.08, frames=(frame_at(-0.6),))
    outcome, plain = play(played, model), play(played, "closed-form")
    for shot in (0, 2):
        pieces, other = (each.pieces.part(each.pieces.shot == shot) for each in (outcome, plain))
        assert pieces.time == pytest.approx(other.time, abs=1e-11)
    assert outcome.pieces.shot.tolist() == sorted(outcome.pieces.shot.tolist())
    for shot in (1, 3):  # shots that strike the post; one barely
        assert struck(outcome, shot)[0] == Target.FRAME
        assert_as_reference(played, outcome, shot, 1e-6)


@CARRIED
def test_a_bat_that_comes_back_strikes_again(model: str) -> None:
    """A lively stop throws the bat after a slow ball."""
    played = scene(z=3 * INCH, stop=stop(0.02, 1.0), duration=0.3, vx=10.0, gravity=0.0)
    outcome = play(played, model)
    assert struck(outcome)[:3] == [Target.BAT, Target.STOP, Target.BAT_AGAIN]
    assert_as_reference(played, outcome, 0, 1e-9)


@CARRIED
def test_a_full_turn_of_the_bat_is_a_second_contact(model: str) -> None:
    """Without a stop the bat turns on and strikes the ball, which barely rebounded."""
    played = scene(
        z=4 * INCH, efficiency=lambda place, *_: np.full(len(place), -0.02), duration=1.0,
        gravity=0.0, drag=0.0,
    )  # fmt: skip
    outcome = play(played, model)
    assert struck(outcome)[:2] == [Target.BAT, Target.BAT_AGAIN]
    assert_as_reference(played, outcome, 0, 1e-8)


@CARRIED
def test_a_frame_stops_only_a_ball_that_strikes_a_bar(model: str) -> None:
    """Four balls in the same plane: between the bars, onto one, over and under them."""
    played = scene(y=[0.15, 0.17, 0.29, -0.3], frames=(frame_at(-0.5),), gravity=0.0, duration=0.03)
    outcome = play(played, model)
    met = [Target.FRAME in struck(outcome, shot) for shot in range(4)]
    assert met == [False, True, False, False]
    assert end(outcome, played)[3, 1] == pytest.approx(-0.6 * 26.8, rel=1e-2)
    assert_as_reference(played, outcome, 1, 1e-7)


@CARRIED
@pytest.mark.parametrize("aside", [-1.0, 0.0, 1.0])
def test_a_ball_on_the_end_of_a_bar_strikes_its_post(model: str, aside: float) -> None:
    """Along a bar, within its thickness, where pymunk's own segment misses its end."""
    played = scene(
        x=-0.53, z=-0.3, vx=aside, vz=10.0, frames=(frame_at(-0.5),), gravity=0.0, duration=0.03
    )
    outcome = play(played, model)
    assert struck(outcome)[0] == Target.FRAME
    assert_as_reference(played, outcome, 0, 1e-6)  # tolerance: pymunk's nanometre, on a curve


@CARRIED
def test_a_ball_that_descends_while_over_a_bar_does_not_strike_it(model: str) -> None:
    """It is over the bar from 11 to 39 ms and clears it to 17; the bat meets its stop at 20 ms."""
    frame = frame_at(-0.5, bottom=-0.038)
    played = scene(vx=4.0, x=-0.6, y=0.0, rate=10.0, stop=stop(0.2), frames=(frame,), duration=0.1)
    assert struck(play(played, model)) == [Target.STOP]


@EVERY
def test_a_falling_ball_strikes_from_above(model: str) -> None:
    """Gravity alone moves the ball: v² = 2 g h, and it rebounds straight up."""
    played = scene(x=0.0, y=0.2, vx=0.0, z=6 * INCH, duration=0.2)
    hit = play(played, model).first(Target.BAT)
    fall = 0.2 - RADIUS - float(played.bat.radius(np.array(6 * INCH)))
    speed = np.sqrt(2 * 9.80665 * fall)
    assert hit.time.tolist() == [pytest.approx(speed / 9.80665, rel=1e-9)]
    assert hit.speed == pytest.approx(speed, rel=1e-9)
    assert hit.state.vy == pytest.approx(rigid(np.array(6 * INCH)) * speed, rel=1e-9)


@CARRIED
def test_a_ball_trapped_between_two_bars_is_refused(model: str) -> None:
    frames = frame_at(-0.5, restitution=1.0), frame_at(-0.7, restitution=1.0)
    played = scene(x=-0.6, y=0.2, gravity=0.0, drag=0.0, duration=0.5, frames=frames)
    assert play(played, model).refused.tolist() == ["more than 100 contacts in one record"]


@CARRIED
def test_the_post_of_the_stop_throws_a_ball_back(model: str) -> None:
    """A ball behind the bat strikes the post of the stop."""
    angle = np.pi / 2
    played = scene(x=0.2, z=0.3, vx=4.0, vz=8.0, stop=stop(angle), gravity=0.0, duration=0.15)
    outcome = play(played, model)
    assert struck(outcome) == [Target.STOP]
    hit = outcome.first(Target.STOP)
    direction = angle + np.arcsin(played.bat.widest / 0.4)
    post = 0.4 * np.sin(direction), AXIS - 0.4 * np.cos(direction)
    gap = np.hypot(hit.state.x[0] - post[0], hit.state.z[0] - post[1])
    assert gap == pytest.approx(0.03 + RADIUS, abs=1e-8)
