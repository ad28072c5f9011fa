"""Made-up twins of users' clips through the whole following: what is found, and what is not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.video.scenery.filming import film
from tests.video.scenery.scene import BallTruth, Made, Scene
from tests.video.scenery.scenes import SCENES
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.follow.following import Followed, Known, follow

Get = Callable[[str], tuple[Made, Followed]]
RATES = {"doubled": 60.0, "thinned": 25.0}


@pytest.fixture(scope="session")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Get:
    """Return what films a scene and follows it, once a session."""
    done: dict[str, tuple[Made, Followed]] = {}

    def get(name: str) -> tuple[Made, Followed]:
        if name not in done:
            done[name] = run(SCENES[name], tmp_path_factory.mktemp(name))
        return done[name]

    return get


def run(scene: Scene, folder: Path) -> tuple[Made, Followed]:
    made = film(scene, folder)
    rate = scene.fps
    if scene.stored == "doubled":
        rate = 2 * rate
    elif scene.stored == "repeated":
        rate = rate * len(made.exposures) / scene.count
    clip = open_clip(made.path, ClipCalibration(frames_per_second=rate))
    diameter = scene.actors[0].ball.diameter if scene.actors else 0.05
    return made, follow(clip, Known(rate=rate, ball=diameter, ball_u=0.01 * diameter))


def require_flights(truth: BallTruth, found: Followed, least: float = 0.8) -> None:
    """Require every flight of eight readable frames, and so much of it; nothing where none is."""
    frames = truth.frames
    for flight in truth.flights:
        if flight.places < 8:
            continue
        inside = np.arange(flight.first_frame, flight.last_frame + 1)
        readable = inside[frames.readable[inside]]
        placed = [
            np.isin(way.frames, readable).sum()
            for way in found.ways
            if way.frames[0] <= flight.last_frame and flight.first_frame <= way.frames[-1]
        ]
        assert max(placed, default=0) >= least * len(readable)
    for way in found.ways:
        here = np.isfinite(frames.x[way.frames])
        off = way.xy[here] - np.stack([frames.x, frames.y], axis=1)[way.frames[here]]
        assert np.abs(off - np.median(off, axis=0)).max() < 0.35 * way.radius


def require_contacts(truth: BallTruth, found: Followed) -> None:
    """Require that each contact is a true one, its frame to 0.2, its restitution to 2.5 u."""
    for contact in found.contacts:
        true = min(truth.contacts, key=lambda each: abs(each.frame - contact.frame))
        assert abs(true.frame - contact.frame) < 0.25
        assert contact.kind == true.kind
        if contact.restitution is not None:
            off = abs(contact.restitution.value - true.restitution)
            assert off < 2.5 * contact.restitution.u + 1e-3
            assert "TILTED" in found.flags or contact.restitution.u <= 0.03


@pytest.mark.parametrize(
    ("name", "contacts", "flags"),
    [
        ("thrown-on-wall", 2, {"READOUT_UNKNOWN"}),
        ("dropped-on-carpet", 2, {"READOUT_UNKNOWN"}),
        ("light-ball", 2, {"READOUT_UNKNOWN"}),
        ("against-wall", 1, {"READOUT_UNKNOWN"}),
        ("doubled", 3, {"READOUT_UNKNOWN", "REPEATED_FRAMES"}),
        ("lost", 3, {"READOUT_UNKNOWN", "LOST_FRAMES"}),
    ],
)
def test_flights_and_contacts(name: str, contacts: int, flags: set[str], followed: Get) -> None:
    made, found = followed(name)
    assert found.motion.kind == "flights"
    assert set(found.flags) == flags
    assert len(found.contacts) == contacts
    require_flights(made.truth, found)
    require_contacts(made.truth, found)
    if name == "lost":
        return
    for flight in found.flights:
        pull = flight.acceleration
        assert abs(pull.value - 9.81) < 3 * pull.u < 0.3 * 9.81


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("carried", "carried"),
        ("pendulum", "pendulum"),
        ("free-fall", "free-fall"),
        ("rolling", "rolling"),
        ("empty", "none"),
        ("thrown-up", "flights"),
    ],
)
def test_kinds_of_motion(name: str, kind: str, followed: Get) -> None:
    made, found = followed(name)
    assert found.motion.kind == kind
    assert found.contacts == []
    assert bool(found.flights) == (kind in {"flights", "free-fall"})
    if kind == "pendulum":
        length, swing = 0.95, 0.35
        period = 2 * np.pi * np.sqrt(length / 9.81) * (1 + swing**2 / 16)
        assert found.motion.period == pytest.approx(period, rel=0.01)
    if kind in {"flights", "free-fall"}:
        require_flights(made.truth, found)


def test_a_repeat_that_takes_no_time_is_told_by_the_motion(followed: Get) -> None:
    made, found = followed("repeated")
    assert "REPEATED_FRAMES" in found.flags
    require_contacts(made.truth, found)
    assert len(found.contacts) == 2
    assert "GRAVITY" not in found.flags


def test_thinned_frames_are_found_by_the_motion(followed: Get) -> None:
    """Thirty a second thinned to 25 under even time stamps: g is off, and that is said."""
    made, found = followed("thinned")
    assert "LOST_FRAMES" in found.flags
    require_contacts(made.truth, found)
    missing = {frame for way in found.ways for frame in way.lost}
    gaps = np.flatnonzero(np.diff(made.exposures) > 1) + 1
    assert missing
    assert missing <= set(gaps.tolist())


def test_a_tilted_camera_is_said_and_covered(followed: Get) -> None:
    made, found = followed("tilted")
    assert "TILTED" in found.flags
    require_contacts(made.truth, found)


def test_a_wrong_frame_rate_is_told_by_gravity(followed: Get, tmp_path: Path) -> None:
    made, _ = followed("dropped-on-carpet")
    clip = open_clip(made.path, ClipCalibration())
    found = follow(clip, Known(rate=30.0, ball=0.04, ball_u=4e-4))
    assert "GRAVITY" in found.flags
    assert found.flights
    assert all(each.acceleration.value < 1.0 for each in found.flights)
    assert tmp_path.exists()


def test_a_second_ball_is_said_and_can_be_pointed_at(followed: Get) -> None:
    made, found = followed("two-balls")
    assert "SECOND_BALL" in found.flags
    require_contacts(made.truth, found)
    frames = made.truths[1].frames
    k = int(np.flatnonzero(frames.readable)[5])
    known = replace(found.known, ball=0.04, ball_u=4e-4, ball_at=(frames.x[k], frames.y[k], k))
    other = follow(found.clip, known)
    require_contacts(made.truths[1], other)
    assert other.contacts


def test_speeds_carry_what_an_unknown_readout_may_do(followed: Get) -> None:
    made, found = followed("rolling-shutter")
    assert {"READOUT_UNKNOWN", "ROLLING_SHUTTER"} & set(found.flags)
    require_contacts(made.truth, found)
    contact = found.contacts[0]
    true = min(made.truth.contacts, key=lambda each: abs(each.frame - contact.frame))
    speed = found.flights[contact.before].speed_out
    assert abs(speed.value - np.hypot(*true.velocity_in)) < 2.5 * speed.u
    known = replace(found.known, readout=made.scene.phone.readout)
    told = follow(found.clip, known)
    assert "READOUT_UNKNOWN" not in told.flags
    assert told.flights[0].speed_out.u < speed.u + 1e-3
    require_contacts(made.truth, told)
