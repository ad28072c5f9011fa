"""Clips of known truth through the complete tracker; doubtful clips give no number."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.video.once import searching_once
from tests.video.scenes import Film, matte
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.clips.calibration_file import (
    CameraModel,
    ClipCalibration,
    read_calibration,
)
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.knowledge import GRAVITY, knowledge_of
from virtual_lab.video.follow.sharpening import SharpBall, wants_sharp
from virtual_lab.video.show.track_text import track_document, track_text

RATE = 5000.0
SCALE = 1e-3
UNIT = SCALE * RATE  # pixel per frame [m/s]
KNOWN = ClipCalibration(
    metres_per_pixel=SCALE, frames_per_second=RATE, exposure_s=0.1 / RATE, lens_blur_px=0.7
)


class Hit:
    """Results of a clip with one hit."""

    def __init__(self, result: FollowedClip) -> None:
        self.clip, self.document = result, track_document(result)
        before, after = [*result.flights, None][:2]
        assert before is not None
        self.flags, self.warnings = result.flags, result.warnings
        self.speed_in, self.angle_in = before.speed_out, before.angle_out
        self.speed_out: Estimate | None = after.speed_in if after else None
        self.angle_out: Estimate | None = after.angle_in if after else None
        (contact,) = result.contacts or [None]
        self.restitution = contact.restitution if contact else None
        self.contact_time = contact.time if contact else None


def run(
    frames: Iterable[NDArray[np.generic]], at: Path, calibration: ClipCalibration = KNOWN
) -> tuple[SharpBall, Hit]:
    np.save(at / "clip.npy", np.stack(list(frames)))
    return hit(at / "clip.npy", calibration)


Flown = Callable[[Film], tuple[SharpBall, Hit]]


@pytest.fixture(scope="module", autouse=True)
def searched_once() -> Iterator[None]:
    """Search each clip once, because it is located with several calibrations."""
    with searching_once():
        yield


def track_hit(path: Path, calibration: ClipCalibration) -> FollowedClip:
    """Follow a ball through a clip of a calibrated camera that stands still."""
    clip = open_clip(path, calibration)
    return follow(clip, knowledge_of(clip, calibration))


def hit(path: Path, calibration: ClipCalibration) -> tuple[SharpBall, Hit]:
    result = track_hit(path, calibration)
    assert result.sharp is not None, result.warnings
    return result.sharp, Hit(result)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Return a function that films and tracks a ball, once."""

    @cache
    def get(film: Film) -> tuple[SharpBall, Hit]:
        calibration = replace(KNOWN, exposure_s=film.shutter / RATE)
        return run(film.frames(), tmp_path_factory.mktemp("film"), calibration)

    return get


def require(film: Film, result: Hit) -> None:
    """Require that both speeds are right within 4 u, and that their u are small."""
    assert result.speed_out is not None
    assert result.restitution is not None
    into = np.hypot(*film.velocity_in) * UNIT
    out = np.hypot(*film.velocity_out) * UNIT
    for said, true in ((result.speed_in, into), (result.speed_out, out)):
        assert abs(said.value - true) < 4 * said.u
        assert said.u < 6e-4 * true
    assert abs(result.restitution.value - out / into) < 4 * result.restitution.u


SCENES = {
    "light on dark": Film(),
    "dark, and slow where it turns": Film(
        velocity_in=(3.0, 0.4),
        velocity_out=(-1.5, 0.3),
        contact=(150.0, 100.0),
        before=20.4,
        count=45,
        light=15.0,
        dark=120.0,
    ),
    "beside a bat that swings": Film(bat=True),
    "small": Film(radius=5.0),
    "blurred": Film(shutter=0.6),
    "dim": Film(light=75.0, dark=20.0, slope=10.0, noise=4.0),
    "steep": Film(velocity_in=(2.1, 8.0), velocity_out=(3.4, -4.0), contact=(150.0, 150.0)),
    "cut by the frame": Film(contact=(180.0, 100.0)),
}


@pytest.mark.parametrize("scene", SCENES)
def test_speeds_are_right_within_their_uncertainty(scene: str, flown: Flown) -> None:
    film = SCENES[scene]
    tracked, result = flown(film)
    require(film, result)
    assert result.flags == ()
    assert result.contact_time is not None
    assert abs(result.contact_time.value * RATE - film.before) < 4 * RATE * result.contact_time.u
    places, sides = np.stack(film.places()), np.array(film.shape[::-1])[:, None]
    inside = ((places > film.radius + 2) & (places < sides - film.radius - 2)).all(axis=0)
    assert set(np.flatnonzero(inside)) <= set(tracked.frames.tolist())
    located, true = tracked.located, places[:, tracked.frames]
    pulls = [(located.x - true[0]) / located.x_u, (located.y - true[1]) / located.y_u]
    # bounds for about 80 degrees of freedom
    assert 0.5 < np.mean(np.square(pulls)[:, located.flags == 0]) < 2.0


def test_speeds_are_right_with_sixteen_bits(tmp_path: Path) -> None:
    film = Film(shutter=0.5)
    _, result = run(film.frames(full=4095.0), tmp_path, replace(KNOWN, exposure_s=0.5 / RATE))
    require(film, result)
    assert result.clip.clip.full_scale == 4095.0


def test_a_floor_s_restitution_is_that_of_the_vertical_speeds(tmp_path: Path) -> None:
    film = Film(
        velocity_in=(4.0, 6.0),
        velocity_out=(3.1, -4.5),
        contact=(170.0, 160.0),
        gravity=(0.0, 0.04),
    )
    pull = 0.04 * SCALE * RATE**2
    _, result = run(film.frames(), tmp_path, replace(KNOWN, gravity_mps2=(0.0, pull)))
    assert result.restitution is not None
    assert result.document["restitution_of"] == "speeds along the vertical"
    assert abs(result.restitution.value - 4.5 / 6.0) < 4 * result.restitution.u
    assert result.restitution.u < 1e-3
    assert result.speed_in.value == pytest.approx(np.hypot(4.0, 6.0) * UNIT, rel=3e-4)
    _, bent = run(film.frames(), tmp_path)
    assert "CROOKED" in bent.flags


def test_speeds_are_corrected_by_the_calibrated_drag(tmp_path: Path) -> None:
    """By an exact flight with dv/dx = -κv, v at the contact is e^(-κx) times v at distance x."""
    drag = 0.5  # drag [1/m]: 8 % over the path, 2 % of the speed if it were left out
    film = Film()
    into, out = np.hypot(*film.velocity_in) * UNIT, np.hypot(*film.velocity_out) * UNIT

    class Dragged(Film):
        def places(self) -> tuple[NDArray[np.float64], ...]:
            before = self.t < 0
            speed = np.where(before, into, out)
            way = np.log1p(drag * speed * self.t / RATE) / drag / SCALE
            pairs = zip(self.contact, self.velocity_in, self.velocity_out, strict=True)
            return tuple(
                start + way * UNIT * np.where(before, first / into, second / out)
                for start, first, second in pairs
            )

    calibration = replace(KNOWN, drag_per_m=drag, drag_per_m_u=0.001)
    _, result = run(Dragged().frames(), tmp_path, calibration)
    require(film, result)


def test_lost_frames_are_flagged_and_corrected(tmp_path: Path) -> None:
    """One lost frame of 19 would change the speed by 7 %; two more are lost after the contact."""
    film = Film()
    frames = list(film.frames())
    _, result = run(frames[:8] + frames[9:27] + frames[29:], tmp_path)
    assert result.flags == ("LOST_FRAMES",)
    assert any("1 before frame 8, 2 before frame 26" in each for each in result.warnings)
    require(film, result)


def test_time_stamps_account_for_lost_frames(tmp_path: Path) -> None:
    film = Film()
    frames, t = list(film.frames()), np.arange(film.count) / RATE
    numbers = [k for k in range(film.count) if k not in {8, 30, 31}]
    calibration = stamped(tmp_path, t[numbers])
    _, result = run([frames[k] for k in numbers], tmp_path, calibration)
    assert result.flags == ()
    require(film, result)
    np.save(tmp_path / "clip.npy", np.stack([frames[k] for k in numbers]))
    plain = track_hit(tmp_path / "clip.npy", stamped(tmp_path, t[: len(numbers)]))
    assert "NOT_SHARP" in plain.flags
    assert any("farther than the time stamps explain" in each for each in plain.warnings)


def stamped(at: Path, times: NDArray[np.float64]) -> ClipCalibration:
    (at / "stamps.csv").write_text("\n".join(map(repr, times.tolist())))
    (at / "cal.toml").write_text(
        f"metres_per_pixel = {SCALE}\nexposure_s = 2e-5\nlens_blur_px = 0.7\n"
        'timestamps = "stamps.csv"\n'
    )
    return read_calibration(at / "cal.toml")


def test_frames_of_the_contact_are_left_out(tmp_path: Path) -> None:
    """The ball stays on the bat for three frames, so near its paths that hulls include them."""
    film = Film(
        velocity_in=(5.0, 0.4), velocity_out=(-2.5, 0.3), contact=(150.0, 100.0), before=20.0,
        count=45, bat=True,
    )  # fmt: skip
    rest = [(0.5, 0.1), (0.8, 0.1), (0.3, 0.0)]
    frames = list(film.frames())
    rng = np.random.default_rng(2)
    scene = np.broadcast_to(40 + 30 * np.linspace(0, 1, 320), (200, 320))
    held = []
    for dx, dy in rest:
        share = matte(film.shape, film.contact[0] + dx, film.contact[1] + dy, film.radius)
        image = scene * (1 - share) + film.light * share + 1.5 * rng.standard_normal(film.shape)
        held.append(np.clip(np.round(image), 0, 255).astype(np.uint8))
    _, result = run(frames[:20] + held + frames[20:], tmp_path)
    require(film, result)
    before, after = result.clip.flights
    assert 3 <= after.first_frame - before.last_frame - 1 <= 6
    flown = np.concatenate([way.frames for way in result.clip.ways])
    assert not {20, 21, 22} & set(flown.tolist())


def test_a_ball_that_flies_by_has_one_speed(tmp_path: Path) -> None:
    film = Film(velocity_out=(9.3, 1.1), contact=(190.0, 100.0), count=34)
    _, result = run(film.frames(), tmp_path)
    assert result.flags == ()
    assert result.speed_out is None
    assert result.restitution is None
    assert abs(result.speed_in.value - np.hypot(9.3, 1.1) * UNIT) < 4 * result.speed_in.u


def test_a_ball_that_leaves_faster_than_it_came_has_no_restitution(tmp_path: Path) -> None:
    """A body at rest gives back less than it takes; the speeds, which are right, are kept."""
    film = Film(velocity_out=(-11.2, 1.7), contact=(250.0, 100.0))
    _, result = run(film.frames(), tmp_path)
    assert result.flags == ("ABOVE_ONE",)
    assert result.restitution is None
    assert result.document["restitution"] is None
    assert any("speeds is 1.21," in each for each in result.warnings)
    assert result.speed_out is not None
    assert abs(result.speed_out.value - np.hypot(11.2, 1.7) * UNIT) < 4 * result.speed_out.u
    assert "restitution not stated" in track_text(result.clip)
    assert "flight 2" in track_text(result.clip)
    fastest = re.match(r"fastest: ([\d.]+) ± ([\d.]+) m/s \(([\d.]+) ± .*", track_text(result.clip))
    assert float(fastest[1]) == pytest.approx(result.speed_out.value, rel=1e-3)
    assert float(fastest[2]) == pytest.approx(2 * result.speed_out.u, rel=0.06)
    assert float(fastest[3]) == pytest.approx(result.speed_out.value / 0.44704, rel=1e-3)
    assert fastest[0].endswith(" of flight 2")
    assert result.document["speed_out_m_per_s"] == {
        "value": result.speed_out.value,
        "u": result.speed_out.u,
    }
    slower = replace(film, velocity_out=(-9.1, 1.7))
    require(slower, run(slower.frames(), tmp_path)[1])


def test_flights_that_do_not_meet_have_no_contact(tmp_path: Path) -> None:
    """The ball flies out from a point 45 pixels before that of its arrival, like another ball."""
    one = Film()
    other = replace(one, contact=(one.contact[0] - 45, one.contact[1]), seed=2)
    cut = int(one.before) + 1
    frames = [*list(one.frames())[:cut], *list(other.frames())[cut:]]
    _, result = run(frames, tmp_path)
    assert "CONTACT_OUTSIDE" in result.flags
    assert result.restitution is None
    assert result.contact_time is None
    assert result.document["contact"] is None
    assert any("do not meet between" in each for each in result.warnings)
    assert "restitution" not in track_text(result.clip).split("\n  warning")[0]


def test_the_balls_diameter_sets_the_scale(tmp_path: Path) -> None:
    film = Film()
    calibration = replace(KNOWN, metres_per_pixel=None, ball_diameter_m=0.028)
    tracked, result = run(film.frames(), tmp_path, calibration)
    assert tracked.plane.source == "ball"
    assert tracked.plane.metres_per_pixel == pytest.approx(SCALE, rel=3e-3)
    assert abs(result.speed_in.value - np.hypot(*film.velocity_in) * UNIT) < 2 * result.speed_in.u
    assert result.restitution is not None
    assert result.restitution.u < 1e-3  # u without a part of the scale


@pytest.mark.parametrize("bat", [False, True])
def test_without_a_ball_there_is_no_flight(bat: bool, tmp_path: Path) -> None:
    film = Film(bat=bat, contact=(230.0 if bat else 900.0, 100.0), count=12 + 28 * bat)
    empty = replace(film, light=film.dark, slope=0.0, noise=1.5)
    np.save(tmp_path / "clip.npy", np.stack(list(empty.frames())))
    result = track_hit(tmp_path / "clip.npy", KNOWN)
    assert result.flights == []
    assert "ball_at=" in " ".join(result.warnings)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("ball_diameter_m", 0.083, "radius near 41"),
        ("lens_blur_px", None, r"does not give lens_blur_px \(virtual-lab calibrate measures it"),
        ("exposure_s", None, r"does not give exposure_s \(the camera's own setting"),
    ],
)
def test_a_ball_that_cannot_be_located_sharply_is_flagged(
    key: str, value: float | None, words: str, tmp_path: Path
) -> None:
    """The ball has another size, or the calibration lacks a key, which is named."""
    np.save(tmp_path / "clip.npy", np.stack(list(Film().frames())))
    result = track_hit(tmp_path / "clip.npy", replace(KNOWN, **{key: value}))
    assert result.sharp is None
    assert "NOT_SHARP" in result.flags
    assert re.search(words, " ".join(result.warnings))
    assert len(result.flights) == 2
    if key == "ball_diameter_m":
        # file with scale and rate only, which is measured by hulls without a flag
        bare = replace(KNOWN, lens_blur_px=None, exposure_s=None)
        assert track_hit(tmp_path / "clip.npy", bare).flags == ()


def test_gravity_as_ruler_and_positions_by_hand_need_no_outlines(flown: Flown) -> None:
    result = flown(SCENES["light on dark"])[1].clip
    by_hand = {"by_hand": np.array([])}
    for stated, sharp in (({}, True), ({"ruler": GRAVITY}, False), (by_hand, False)):
        knowledge = replace(result.knowledge, **stated)
        assert wants_sharp(knowledge, result.watched, result.ways) == sharp


@pytest.mark.parametrize(("sense", "turn"), [(1.0, (0.0, 0.0, 0.0)), (-1.0, (np.pi, 0.0, 0.0))])
def test_angles_do_not_depend_on_the_cameras_axes(
    sense: float, turn: tuple[float, float, float], flown: Flown, tmp_path: Path
) -> None:
    """A camera 1 m away with 1 mm per pixel has Y down the picture, or up as on a rig."""
    film = SCENES["steep"]
    rows, columns = next(iter(film.frames())).shape
    camera = CameraModel(
        image_size=(columns, rows),
        matrix=((1000.0, 0.0, 120.0), (0.0, 1000.0, 80.0), (0.0, 0.0, 1.0)),
        distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        rotation=turn,
        translation_m=(0.0, 0.0, 1.0),
    )
    plain, flat = flown(film)
    tracked, turned = run(
        film.frames(), tmp_path, replace(KNOWN, metres_per_pixel=None, camera=camera)
    )
    assert tracked.plane.sense == sense
    assert plain.plane.sense == 1.0
    assert flat.angle_out is not None
    assert turned.angle_out is not None
    for said, without, (right, down) in (
        (turned.angle_in, flat.angle_in, film.velocity_in),
        (turned.angle_out, flat.angle_out, film.velocity_out),
    ):
        assert said.value == pytest.approx(without.value, abs=2 * said.u)
        assert said.value == pytest.approx(np.arctan2(-down, right), abs=5 * without.u + 2 * said.u)
    # effect of half a degree off the plane: at its middle, the flight is off it by the slope times
    # the way to the contact, and v_z reads as X/Z v_z along the picture
    places = np.stack(film.places())[:, tracked.frames]
    into = tracked.frames < film.before
    middle = places[:, into].mean(axis=1)
    off = (middle - [120.0, 80.0] + middle - film.contact) / 1000.0
    along = off @ film.velocity_in / np.hypot(*film.velocity_in)
    more = abs(np.tan(np.radians(0.5)) * along * turned.speed_in.value)
    added = np.sqrt(turned.speed_in.u**2 - flat.speed_in.u**2)
    # the growth of a ball of 14 pixels tells little more
    assert 0.5 * more < added < 1.1 * more
