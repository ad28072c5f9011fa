"""What a scene, a setting and a rung refuse, and in which words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.simulation.motion.scenes import BODY, Array, scene
from virtual_lab.errors import InputError
from virtual_lab.simulation.motion import play, pymunk_scene, space
from virtual_lab.simulation.motion.scene import Balls, Obstacle, Stops
from virtual_lab.simulation.motion.settings import Settings
from virtual_lab.units import INCH

POST = Obstacle(kind="frame", x=(-0.6, -0.6), z=(0.36, 0.36), radius=0.02, restitution=0.6)


@pytest.mark.parametrize(
    ("key", "settings", "allowed"),
    [
        ("step", {"step": 1e-2}, "allowed: below 0.00235"),
        ("step", {"step": 0.0}, "1e-07 s and up"),
        ("step", {"step": float("nan")}, "1e-07 s and up"),
        ("iterations", {"iterations": 9}, "allowed: 10 to 1000"),
        ("iterations", {"iterations": 10**6}, "allowed: 10 to 1000"),
        ("slop", {"slop": 0.1}, "allowed: 0 to 0.0001 m"),
        ("slop", {"slop": -1e-5}, "allowed: 0 to 0.0001 m"),
        ("bias", {"bias": 1.0}, "allowed: 0 and up, below 1"),
    ],
)
def test_unsafe_settings_are_refused(key: str, settings: dict[str, Any], allowed: str) -> None:
    """0.1 m is pymunk's own slop, 1e-2 s a step in which a 60 mph ball jumps the barrel."""
    with pytest.raises(InputError) as refused:
        play(scene(), "pymunk", settings=Settings(**settings))
    assert refused.value.key == key
    assert refused.value.value is settings[key] or np.isnan(settings[key])
    assert allowed in str(refused.value)


def test_the_longest_step_is_that_of_ball_and_barrel() -> None:
    """By hand: a swung tip adds to the ball, a thin post takes away from the barrel."""
    limit = Settings.reach(scene()) / 26.8
    Settings(step=limit * 0.999).check(scene())
    with pytest.raises(InputError, match="step"):
        Settings(step=limit * 1.001).check(scene())
    outer = np.array(BODY.profile.outer_diameter)[np.array(BODY.profile.z) <= BODY.length / 3]
    assert limit == pytest.approx((0.0366 + outer.min() / 2) / 26.8, rel=0.02)
    assert Settings.reach(scene(obstacles=(POST,))) == pytest.approx(0.0366 + 0.02)
    swung = scene(rate=-40.0, angle=1.0)
    assert Settings.fastest(swung) == pytest.approx(26.8 + 40 * swung.bat.axis)


@pytest.mark.parametrize(
    ("key", "other"),
    [
        ("mass", {"mass": 0.0}),
        ("restitution", {"restitution": 1.2}),
        ("drag", {"drag": -0.1}),
        ("vx", {"vx": np.inf}),
        ("duration", {"duration": 0.0}),
        ("angle", {"stops": Stops(low=0.1, high=1.0)}),
        ("stops", {"stops": Stops(low=1.0, high=-1.0)}),
        ("stop restitution", {"stops": Stops(low=-1.0, high=1.0, restitution=2.0)}),
        (
            "obstacle kind",
            {"obstacles": (Obstacle(kind="tree", x=(0, 0), z=(0, 0), radius=1, restitution=0),)},
        ),
        (
            "obstacle radius",
            {"obstacles": (Obstacle(kind="wall", x=(0, 0), z=(0, 0), radius=0, restitution=0),)},
        ),
        ("gap to the bat [m]", {"x": -0.05}),
        ("gap to the frame [m]", {"x": -0.61, "z": 0.36, "obstacles": (POST,)}),
    ],
)
def test_a_scene_that_cannot_be_is_refused(key: str, other: dict[str, Any]) -> None:
    with pytest.raises(InputError) as refused:
        play(scene(**other))
    assert refused.value.key == key
    assert "allowed" in str(refused.value)


def test_one_ball_a_shot() -> None:
    two = scene(z=[0.1, 0.2])
    one = np.full(1, 0.145)
    with pytest.raises(InputError, match="mass = 1; allowed: one a shot"):
        type(two)(
            start=two.start,
            balls=Balls(mass=one, restitution=one, drag=one, radius=0.03),
            bat=two.bat,
            efficiency=two.efficiency,
            duration=0.1,
        )


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_an_efficiency_that_is_no_number_is_refused(rung: str) -> None:
    with pytest.raises(InputError, match="efficiency = nan; allowed: finite"):
        play(scene(efficiency=constant(np.nan)), rung)


def test_rungs_have_names() -> None:
    with pytest.raises(InputError, match="allowed: closed-form, pymunk"):
        play(scene(), "exact")


@pytest.mark.parametrize("rung", [None, "closed-form", "pymunk"])
def test_what_no_rung_can_do_is_said(rung: str | None) -> None:
    """A ball on the tip's edge, and an e_A by which the bat would run through the ball."""
    played = scene(z=[-0.02, 6 * INCH], efficiency=constant(-0.9))
    outcome = play(played, rung)
    assert outcome.refused.tolist() == [
        "the ball strikes the edge of the bat's end, where no collision model holds",
        "the bat follows faster than the ball leaves it: no such e_A can be",
    ]
    for name in ("time", "bat_rate", "collision_efficiency", "pivot_drift"):
        assert np.isnan(getattr(outcome, name)).all()
    assert np.isnan(outcome.end.x).all()
    assert not len(outcome.events.time)


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_a_ball_past_the_tip_misses(rung: str) -> None:
    """No contact is an outcome, not a refusal: by more than its radius, above or beside."""
    outcome = play(scene(z=[-0.0367, 0.1], y=[0.0, 0.15], gravity=0.0), rung)
    assert outcome.refused.tolist() == ["", ""]
    assert np.isnan(outcome.time).all()
    assert outcome.end.rate.tolist() == [0, 0]
    assert (outcome.end.x > 1).all()


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_a_graze_ends_and_is_no_fault(rung: str) -> None:
    """Depths above, about and below what the search tells apart: done, refused, or a miss."""
    touching = 0.0366 + float(scene().bat.barrel.radius(np.array(6 * INCH)))
    depth = np.array([1e-5, 1e-6, 1e-8, 0.0, -1e-8, -1e-6])
    outcome = play(scene(y=touching - depth, gravity=0.0, duration=0.05), rung)
    assert outcome.refused[[0, 1, 5]].tolist() == ["", "", ""]
    assert np.isnan(outcome.time[5])
    shallow = 26.8 * np.exp(-0.006 * 0.9) * np.sqrt(2 * depth[:2] / touching)
    assert outcome.relative_speed[:2] == pytest.approx(shallow, rel=6e-2)


def test_without_settings_the_step_is_short_enough() -> None:
    fast = scene(vx=190.0, duration=0.02)
    with pytest.raises(InputError, match="step"):
        Settings().check(fast)
    Settings.safe(fast).check(fast)
    assert Settings.safe(scene()) == Settings()
    outcome = play(fast, "pymunk")
    assert outcome.time == pytest.approx(play(fast).time)


def test_a_contact_not_seen_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mutation: the search for the touch is blind, whatever the step."""
    monkeypatch.setattr(pymunk_scene._Shot, "_touch", lambda *_: np.inf)
    for step in (2e-3, 5e-4, 1e-4):
        with pytest.raises(pymunk_scene.MissedContactError, match="met unseen"):
            play(scene(), "pymunk", settings=Settings(step=step))


def test_an_obstacle_pymunk_does_not_feel_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mutation: pymunk is told to let every contact pass."""

    def ignore(_: Any, arbiter: Any, *__: Any) -> None:
        arbiter.process_collision = False

    monkeypatch.setattr(space.Space, "_pass_others", ignore)
    with pytest.raises(pymunk_scene.MissedContactError, match="no contact with an obstacle"):
        play(scene(z=0.36, obstacles=(POST,)), "pymunk")


def test_a_ball_coming_down_on_a_low_wall_is_refused() -> None:
    low = Obstacle(
        kind="wall", x=(-0.4, -0.4), z=(-1.0, 1.0), radius=0.15, restitution=0.5, high=-0.05
    )
    outcome = play(scene(y=0.001, vy=-0.5, vx=15.0, obstacles=(low,)), "pymunk")
    assert outcome.refused.tolist() == ["the ball comes on a wall from above or below"]


def constant(value: float) -> Callable[..., Array]:
    """Return an e_A that is the same everywhere."""
    return lambda place, *_: np.full(len(place), value)
