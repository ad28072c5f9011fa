"""Slow motion tells what happened in kind; whoever fits it learns less than by measuring."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.bench.days import PLAIN, apparatus, day_of, scenario
from virtual_lab.bench.day.day import Day, DayEvent, replay_events
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.machines.firing import Firing, ShotConditions
from virtual_lab.bench.machines.sketching import blur_rebound, scene_of_shot, sketch_of, true_motion
from virtual_lab.bench.pages.page import day_page
from virtual_lab.bench.pages.slow_motion import contact_words, motion_of_sketch, slow_motion
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.streams import Streams

DAYS, SHOTS = 60, 4
TRUE = 0.25  # e_A of every shot
READY = frozenset({"zero-encoder", "wait-pressure", "wait-rest"})


@cache
def plain_day() -> Day:
    return day_of(PLAIN)


def conditions(shot: int) -> ShotConditions:
    return ShotConditions(
        shot=shot,
        ball=0,
        place=0.163,
        turn_rate=0.0,
        ready=READY,
        scrap=1,
        shift=(),
        warm=0,
        wall=1,
    )


def fitted(day: Day, shot: int, rebound: float, turn: float) -> tuple[float, float]:
    """Return e_A and the bat's rate [rad/s] as straight lines through a page's frames have them."""
    sketch = {"struck": ["bat"], "way": "back", "side": "straight", "rebound": rebound}
    event = DayEvent(
        number=1, action="fire", arguments={}, seconds=0.0, sketch=sketch | {"turn": turn}
    )
    rules = Desk(day).rules.spec
    drawn = slow_motion(shot, motion_of_sketch(event, rules, 0.163), day, rules)
    frames = np.array(json.loads(drawn.frames), dtype=float)
    before, after = frames[frames[:, 0] < 0], frames[frames[:, 0] > 0]
    speeds = [np.polyfit(part[:, 0], part[:, 1], 1)[0] for part in (before, after)]
    rate = np.polyfit(after[:, 0], np.radians(after[:, 3]), 1)[0] * 1e3
    return -speeds[1] / speeds[0], float(rate)


def test_no_fit_of_the_animations_gives_the_efficiency() -> None:
    """u(e_A) of a shot is at least 0.02, by the ball, by the bat and by both; so is a day's."""
    day = plain_day()
    by_ball, by_bat = np.empty((DAYS, SHOTS)), np.empty((DAYS, SHOTS))
    laboratory = apparatus().laboratory
    body, rules = laboratory.specimen.bat.body, laboratory.rules.spec
    lever = body.length - rules.pivot_from_knob - 0.163
    inertia = beam_of(body).inertia(lever + 0.163)
    blow = laboratory.specimen.balls.spec.mass * rules.ball_speed * lever
    for number in range(DAYS):
        firing = Firing(replace(laboratory, draws=Streams(number)))
        for shot in range(SHOTS):
            sketch = blur_rebound(firing, conditions(shot), TRUE)
            by_ball[number, shot], rate = fitted(day, shot, *sketch)
            by_bat[number, shot] = rate * inertia / blow - 1
    both = by_ball + (by_bat - by_ball) * np.var(by_ball) / (np.var(by_bat) + np.var(by_ball))
    for found in (by_ball, by_bat, both):
        assert np.sqrt(np.mean((found - TRUE) ** 2)) >= 0.02
        assert np.sqrt(np.mean((found.mean(axis=1) - TRUE) ** 2)) >= 0.02
        within = found - found.mean(axis=1, keepdims=True)
        assert np.sqrt(np.sum(within**2) / (DAYS * (SHOTS - 1))) >= 0.02


def test_the_sketch_shows_the_true_events() -> None:
    """Each shot of a plain day: the bat struck once, the ball back, within the blur."""
    day = plain_day()
    fired = [event.sketch for event in day.events if event.action == "fire"]
    assert [sketch["struck"] for sketch in fired] == [["bat"]] * 7
    assert {sketch["way"] for sketch in fired} == {"back"}
    found = Desk(day).reduction_by_rules.shots.collision_efficiency
    assert np.abs([sketch["rebound"] for sketch in fired] - found).max() < 0.2


def test_the_page_shows_the_true_scene_only_after_the_reveal() -> None:
    """A true scene drawn to the millimeter gives e_A to 0.002: it is not there before."""
    day, firing = plain_day(), apparatus().firing
    rules = Desk(day).rules.spec
    motion = true_motion(firing, day, 3)
    assert motion is not None
    true = firing.shot(firing.conditions(before_shot(day, 3)))[1].truth["collision_efficiency"][0]
    frames = np.array(json.loads(slow_motion(3, motion, day, rules).frames), dtype=float)
    near = (frames[:, 0] > 1) & (frames[:, 0] < 100)
    back = -np.polyfit(frames[near, 0], frames[near, 1], 1)[0] / rules.ball_speed
    assert back == pytest.approx(true, abs=0.01)
    page = day_page(Desk(day), scenario().briefing(), shot=3)
    assert "Top view of the true motion" not in page
    assert "Top view of the true motion" in day_page(
        Desk(day), scenario().briefing(), shot=3, true_motion=motion
    )


def before_shot(day: Day, shot: int) -> Day:
    morning = Day(morning=day.morning, balls=day.balls)
    at = [event.number for event in day.events if event.action == "fire"][shot - 1]
    return replay_events(morning, day.events[: at - 1])


def test_the_sketch_says_that_a_shot_hit_a_frame() -> None:
    """Aimed beyond the opening of the gates, the ball strikes a frame before the bat."""
    seen = scene_of_shot(apparatus().firing, conditions(0)._replace(place=0.55))
    assert seen is not None
    assert seen[1].pieces.struck[1] == "frame"
    assert contact_words(["frame"]) == "The ball hits the frame of a gate."
    assert contact_words(["bat", "stop"], "back", "up") == (
        "The ball hits the bat; the bat hits its stop; the ball rebounds upward."
    )
    assert contact_words([]) == "No ball reached the bat."


@pytest.mark.parametrize(("up", "side"), [(0.025, "up"), (-0.025, "down")])
def test_the_sketch_shows_the_side_to_which_the_ball_flies(up: float, side: str) -> None:
    """Aimed 25 mm across: the sketch's side is that to which the ball flies off the bat."""
    aimed = conditions(0)._replace(shift=((0.0, up),))
    firing = apparatus().firing
    seen = scene_of_shot(firing, aimed)
    assert seen is not None
    climbs = float(seen[1].pieces.state.vy[1])
    assert climbs * up > 0
    assert sketch_of(firing, aimed)["side"] == side
