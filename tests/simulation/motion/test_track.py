"""What a track says of any moment and plane, against shorter records and light gates by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.motion.scenes import scattered, scene
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.scene import Obstacle, State, Stops
from virtual_lab.units import INCH

POST = Obstacle(kind="frame", x=(-0.6, -0.6), z=(0.36, 0.36), radius=0.02, restitution=0.6)


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_any_moment_is_the_end_of_a_shorter_record(rung: str) -> None:
    moments = (0.0, 0.01, 0.033, 0.08)
    played = scene(z=[5 * INCH, 7 * INCH], duration=0.08, vz=1.0)
    outcome = play(played, rung)
    found = outcome.track.at(played, moments)
    for column, moment in enumerate(moments[1:], 1):
        end = play(scene(z=[5 * INCH, 7 * INCH], duration=moment, vz=1.0), rung).end
        for name in State.__slots__:
            assert getattr(found, name)[:, column] == pytest.approx(getattr(end, name), abs=1e-11)
    for name in State.__slots__:
        assert getattr(found, name)[:, 0].tolist() == getattr(played.start, name).tolist()


def test_a_track_of_both_rungs_is_one_track() -> None:
    """Stops and a post: the pieces meet in place though not in speed, and end as the outcome."""
    stops = Stops(low=-1.0, high=0.4, restitution=0.5)
    played = scene(z=[6 * INCH, 0.36, 0.6], stops=stops, obstacles=(POST,), duration=0.2)
    outcome = play(played)
    track = outcome.track
    assert track.shot.tolist() == sorted(track.shot.tolist())
    assert len(track.shot) == len(played) + len(outcome.events.shot)
    final = track.at(played, [played.duration])
    for name in State.__slots__:
        assert getattr(final, name)[:, 0] == pytest.approx(getattr(outcome.end, name), abs=1e-11)
    inner = np.flatnonzero(track.begins > 0)
    for piece in inner:
        time, shot = track.begins[piece], track.shot[piece]
        just = track.at(played, [time - 1e-9, time + 1e-9])
        for name in ("x", "y", "z", "angle"):
            before, after = getattr(just, name)[shot]
            assert after == pytest.approx(before, abs=1e-6)


def test_gates_read_the_speed_from_passages() -> None:
    """A gate pair each way: drag integrated by hand gives the speeds at the bat back."""
    played = scene(z=[5 * INCH, 7 * INCH], gravity=0.0)
    outcome = play(played)
    far, near = 0.8, 0.5  # of the ball's centre at contact, ahead of the bat
    touch = -0.0366 - played.bat.barrel.radius(played.start.z)[0]
    one = played.part(slice(0, 1))
    track = outcome.track.part(outcome.track.shot == 0)
    passed = track.passages(one, [touch - far, touch - near])
    assert passed.plane.tolist() == [0, 1, 1, 0]
    assert passed.state.x == pytest.approx(touch - np.array([far, near, near, far]), abs=1e-13)
    # speed v exp(κ x) a distance x ahead of the bat on the way in, v exp(-κ x) on the way out
    grown = [
        (np.exp(sign * 0.006 * far) - np.exp(sign * 0.006 * near)) / (sign * 0.006)
        for sign in (-1, 1)
    ]
    into = grown[0] / (passed.time[1] - passed.time[0])
    out = grown[1] / (passed.time[3] - passed.time[2])
    assert into == pytest.approx(outcome.relative_speed[0], rel=1e-11)
    assert out == pytest.approx(-outcome.ball_velocity[0, 0], rel=1e-11)


def test_a_ball_thrown_back_by_a_post_passes_its_gate_twice() -> None:
    played = scene(z=[0.36, 6 * INCH], obstacles=(POST,), duration=0.05)
    outcome = play(played)
    passed = outcome.track.passages(played, [-0.8, -0.3])
    assert passed.plane[passed.shot == 0].tolist() == [0, 0]
    assert passed.state.vx[passed.shot == 0].tolist()[1] < 0
    assert passed.plane[passed.shot == 1].tolist()[:2] == [0, 1]


def test_a_refused_shot_has_no_track() -> None:
    played = scene(z=[-0.02, 6 * INCH])
    for rung in ("closed-form", "pymunk"):
        outcome = play(played, rung)
        assert set(outcome.track.shot.tolist()) == {1}
        assert np.isnan(outcome.track.at(played, [0.01]).x[0]).all()
        assert set(outcome.track.passages(played, [-0.5]).shot.tolist()) == {1}


def test_tracks_of_the_rungs_agree() -> None:
    played = scattered(6, seed=5)
    times = np.linspace(0, 0.12, 9)
    one, other = (play(played, rung).track.at(played, times) for rung in ("closed-form", "pymunk"))
    for name in State.__slots__:
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-9)
