"""A camera's frames: before the day is handed in they tell what the sketch tells, and no more."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.bench.days import scenario
from tests.bench.test_web import Browser
from tests.bench.test_web import served as served_day
from virtual_lab import lab
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.day import DayEvent
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.sketching import sketch_film
from virtual_lab.bench.machines.stored_day import laboratory_of

FILMED = {"procedure": "bbcor", "rig": "filmed-cannon"}
HEIGHT, WIDTH = 202, 322  # of a frame in the picture, with its edge


def event(rebound: float, way: str = "back") -> DayEvent:
    return DayEvent(
        number=1,
        action="fire",
        arguments={},
        seconds=0.0,
        records={"log": {"place": [0.15]}},
        sketch={
            "struck": ["bat"],
            "way": way,
            "side": "straight",
            "rebound": rebound,
            "turn": 30.0,
        },
    )


def setup(seed: int, *faults: str) -> lab.TestSetup:
    return laboratory_of(scenario(faults, **FILMED), seed, b"").setup


def fitted(film: bytes) -> float:
    """Return e_A as the ball's ways before the bat and after it have it, frame for frame."""
    picture = cv2.imdecode(np.frombuffer(film, np.uint8), cv2.IMREAD_GRAYSCALE)
    middles = []
    for number in range(6):
        row, column = divmod(number, 3)
        frame = picture[row * HEIGHT :, column * WIDTH :][1 : HEIGHT - 1, 1 : WIDTH - 1]
        middles.append(np.nonzero(frame > 180)[1].mean())
    coming, going = middles[1] - middles[0], middles[4] - middles[5]
    return float(going / coming)


@pytest.mark.parametrize("rebound", [0.12, 0.31])
def test_a_fit_of_the_frames_gives_the_efficiency_of_the_sketch(rebound: float) -> None:
    """Their e_A is the sketch's, which is off by 0.03 a day and 0.03 a shot: u is at least 0.02."""
    assert fitted(sketch_film(setup(3), event(rebound))) == pytest.approx(rebound, abs=0.02)


def test_another_truth_leaves_the_frames_unchanged() -> None:
    """Seed and faults exchanged behind the same entry: byte for byte the same picture."""
    one, other = (
        sketch_film(setup(seed, *faults), event(0.2))
        for seed, faults in ((3, ()), (77, ("cannon-slow", "aim-along")))
    )
    assert one == other != sketch_film(setup(3), event(0.21))


def test_a_shot_without_a_ball_has_no_frames() -> None:
    missed = DayEvent(number=1, action="fire", arguments={}, seconds=0.0, sketch={"struck": []})
    assert sketch_film(setup(3), missed) == b""


def test_frames_show_the_sketch_before_the_reveal_and_the_truth_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the hand-in begins the debrief: 13 s of films, in the background of later tests
    monkeypatch.setattr(ServedDay, "_make_debrief", lambda day: None)
    browsers = [Browser(served_day(tmp_path / name, name)) for name in ("filmed-day", "plain-day")]
    for browser in browsers:
        browser.open()
        assert browser.ask("/film?shot=1").status == 404
        for name, given in (
            ("set-place", {"place": 150}),
            ("load-ball", {"ball": 1}),
            ("fire", {}),
        ):
            browser.day.do(action_of(name, given))
    filmed, plain = browsers
    assert "camera" not in filmed.day.stored.day.events[-1].records
    assert plain.ask("/film?shot=1").status == 404
    assert 'src="/film?shot=1&amp;as=seen"' in filmed.ask("/").text
    assert 'src="/film' not in plain.ask("/").text
    seen = filmed.day.film(1, true=False)
    assert filmed.day.film(1, true=True) == seen
    answer = filmed.ask("/film?shot=1&as=it-was")
    assert (answer.status, answer.headers["content-type"]) == (200, "image/png")
    for name, given in (("give-verdict", {"verdict": "INVALID"}), ("hand-in", {})):
        filmed.day.do(action_of(name, given))
    assert filmed.day.film(1, true=True) != filmed.day.film(1, true=False) == seen
    assert "as=it-was" in filmed.ask("/").text
