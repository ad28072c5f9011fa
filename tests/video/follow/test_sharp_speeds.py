"""Speeds of a hit from positions of known flights: their u by closed forms and by repetition."""

import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.video.calibration.plane import Plane
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.following import FollowedClip, measure
from virtual_lab.video.follow.knowledge import knowledge_of
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound
from virtual_lab.video.follow.sharpening import SharpBall, settle
from virtual_lab.video.locate.located import Located

Array = NDArray[np.float64]

RATE = 5000.0
SCALE = 1e-3  # meters per pixel
INTO, OUT = np.array([46.5, 5.5]), np.array([-31.0, 8.5])  # velocities [m/s]
SIZE = (240, 400)  # rows, columns
KNOWN = ClipCalibration(metres_per_pixel=SCALE, frames_per_second=RATE)


def flown(t: Array, into: Array = INTO, out: Array = OUT) -> Array:
    """Return the positions of a ball that is struck at the origin at 0 s, (frame, 2) [m]."""
    return np.where(t[:, None] < 0, np.outer(t, into), np.outer(t, out))


def measured(
    t: Array,
    places: Array,
    *,
    u: float = 1e-7,
    calibration: ClipCalibration = KNOWN,
    exposure: float = 0.0,
    radius: Array | None = None,
) -> FollowedClip:
    """Measure positions [m] at times [s]; those before and after 0 s are two flights."""
    count, numbers = len(t), np.arange(len(t))
    pixels = places / SCALE + np.array([SIZE[1] - 1, SIZE[0] - 1]) / 2
    clip: Any = SimpleNamespace(
        shape=SIZE,
        times=t,
        count=count,
        warnings=(),
        source=SimpleNamespace(path="clip", exposure=None),
    )
    blobs = np.zeros(count, BLOB)
    blobs["frame"], blobs["radius"] = numbers, 15.0
    located = replace(
        Located.start(pixels, 15.0, np.zeros(2)),
        x_u=np.full(count, u / SCALE),
        y_u=np.full(count, u / SCALE),
        pattern_u=np.zeros(count),
    )
    if radius is not None:
        located = replace(located, radius=radius)
    ball = SharpBall(
        frames=numbers,
        located=located,
        plane=Plane(
            metres_per_pixel=SCALE,
            relative_u=0.0,
            source="given",
            places=pixels * SCALE,
            sizes=np.ones(count),
            sense=1.0,
        ),
    )
    scene = FlightScene(
        blobs=blobs,
        time=numbers.astype(float),
        stamped=numbers.astype(float),
        size=SIZE[::-1],
        exposure=exposure * RATE,
    )
    coarse = Piece.of(blobs, numbers, t * RATE)
    ways = [some for each in (t < 0, t >= 0) if len((some := coarse.part(each)).t)]
    said = replace(knowledge_of(clip, calibration), exposure=exposure)
    scene, ways, ball = settle(scene, ways, ball, said)
    watched = Watched(still=cast("Any", None), blobs=blobs, change=np.full(count, np.nan))
    return measure(clip, watched, said, FlightsFound(scene=scene, ways=ways), sharp=ball)


def frames(before: int, after: int, late: float = 0.5) -> Array:
    """Return the times of frames; the first one is `late` frames after a contact at 0 s."""
    return (np.arange(-before, after) + late) / RATE


def repeated(draw: Callable[[np.random.Generator], FollowedClip], clips: int = 200) -> list[Any]:
    return [draw(np.random.default_rng([seed, 71])) for seed in range(clips)]


@pytest.mark.long
def test_the_u_of_a_hit_is_the_scatter_of_repetitions() -> None:
    """Errors of time, speeds and restitution over u, for 30 frames before the contact and 5 after.

    The rms of 200 clips scatters by 5 % about 1. The few positions of the outbound flight give a
    uncertain scatter, so that u may be larger.
    """
    t, noise = frames(30, 5), 3e-5

    def draw(rng: np.random.Generator) -> FollowedClip:
        places = flown(t) + noise * rng.standard_normal((len(t), 2))
        return measured(t, places, u=noise)

    clips = repeated(draw)
    into, out = np.hypot(*INTO), np.hypot(*OUT)
    scores = {
        "time": [c.contacts[0].t / RATE / c.contacts[0].time.u for c in clips],
        "in": [(c.flights[0].speed_out.value - into) / c.flights[0].speed_out.u for c in clips],
        "out": [(c.flights[1].speed_in.value - out) / c.flights[1].speed_in.u for c in clips],
    }
    ratios = [each.contacts[0].restitution for each in clips]
    scores["restitution"] = [(r.value - out / into) / r.u for r in ratios if r]
    assert len(scores["restitution"]) == len(clips)
    for name, each in scores.items():
        assert 0.5 < np.sqrt(np.mean(np.square(each))) < 1.15, name


def test_the_u_of_angle_and_position_are_the_textbooks() -> None:
    """For N = 20 positions with σ, the slope of a line has σ_v = σ √(12/N(N² - 1))/dt.

    At its end, half a frame further, a line has σ² (1/N + 12 (N/2)²/N(N² - 1)); the position of the
    contact is the mean of two such ends. The u of each angle is σ_v over the flight's speed.
    """
    t, noise, count = frames(20, 20), 3e-5, 20
    result = measured(t, flown(t), u=noise)
    slope = noise * np.sqrt(12 / (count * (count**2 - 1))) * RATE
    for flight, velocity in zip(result.flights, (INTO, OUT), strict=True):
        assert flight.angle_in.u == pytest.approx(slope / np.hypot(*velocity), rel=1e-3)
    end = np.hypot(noise / np.sqrt(count), slope / RATE * count / 2)
    # allowance for the time of the contact, which is not known either
    assert result.contacts[0].metres_u == pytest.approx(end / np.sqrt(2), rel=0.03)
    change = np.hypot(*(OUT - INTO))
    assert result.contacts[0].time.u == pytest.approx(end * np.sqrt(2) / change, rel=1e-3)


def test_the_u_of_a_clock_is_in_speeds_but_not_in_restitution() -> None:
    calibration = ClipCalibration(
        metres_per_pixel=SCALE, frames_per_second=RATE, frames_per_second_u=0.01 * RATE
    )
    t = frames(20, 20)
    result = measured(t, flown(t), calibration=calibration)
    for flight in result.flights:
        assert flight.speed_in.u == pytest.approx(0.01 * flight.speed_in.value, rel=1e-3)
    assert result.contacts[0].restitution is not None
    assert result.contacts[0].restitution.u < 1e-4


def test_the_u_of_drag_adds_up_in_both_speeds() -> None:
    """Half of each path lies before the other: e errs by u(κ) (s_in + s_out), without a root."""
    calibration = ClipCalibration(metres_per_pixel=SCALE, frames_per_second=RATE, drag_per_m_u=0.02)
    t = frames(20, 20)
    result = measured(t, flown(t), calibration=calibration)
    restitution = result.contacts[0].restitution
    assert restitution is not None
    ways = [10 / RATE * np.hypot(*each) for each in (INTO, OUT)]  # paths to each middle
    assert restitution.u == pytest.approx(restitution.value * 0.02 * sum(ways), rel=0.02)
    speeds = result.flights[0].speed_out, result.flights[1].speed_in
    for speed, way in zip(speeds, ways, strict=True):
        assert speed.u == pytest.approx(0.02 * way * speed.value, rel=0.02)


@pytest.mark.parametrize("late", [0.1, 0.5, 0.9])
def test_a_frame_exposed_during_the_contact_is_in_no_flight(late: float) -> None:
    """Positions are means over 0.9 of a frame, and so uncertain that no line rejects one."""
    t, exposure = frames(20, 20, late), 0.9 / RATE
    moments = exposure * (np.arange(200) + 0.5 - 100) / 200
    places = np.mean([flown(t + moment) for moment in moments], axis=0)
    result = measured(t, places, u=5e-3, exposure=exposure)
    spanned = np.abs(t) < exposure / 2
    assert spanned.sum() == {0.1: 1, 0.5: 0, 0.9: 1}[late]
    used = np.isin(np.arange(len(t)), np.concatenate([way.frames for way in result.ways]))
    assert not (used & spanned).any()
    assert (used | spanned).all()


@pytest.mark.parametrize(("off_up", "kind"), [(0, "floor"), (32, "floor"), (38, "struck")])
def test_a_floor_s_change_of_velocity_is_upward_to_35_degrees(off_up: float, kind: str) -> None:
    """Off a floor, the restitution is that of the vertical parts; otherwise that of the speeds."""
    calibration = ClipCalibration(
        metres_per_pixel=SCALE, frames_per_second=RATE, gravity_mps2=(0.0, 9.81)
    )
    turn = np.radians(off_up)
    into = np.array([10.0 if kind == "floor" else -10.0, 30.0])
    out = into + 50 * np.array([np.sin(turn), -np.cos(turn)])
    t = frames(20, 20)
    fall = 0.5 * np.outer(t**2, (0.0, 9.81))
    result = measured(t, flown(t, into, out) + fall, calibration=calibration)
    (contact,) = result.contacts
    assert contact.kind == kind
    ratio = -out[1] / into[1] if kind == "floor" else np.hypot(*out) / np.hypot(*into)
    assert contact.restitution is not None
    assert contact.restitution.value == pytest.approx(ratio, rel=1e-4)


@pytest.mark.parametrize("right", [0.1, -0.1])
def test_a_ball_that_comes_nearer_is_flagged_and_corrected(right: float) -> None:
    """At w m/s toward the camera at Z, picture and position grow by w/Z per second."""
    t, rate, true = frames(40, 0), 2.0, 20.0
    middle = t - t.mean()
    nearer = 1 / (1 - rate * middle)
    places = np.stack([(right + true * middle) * nearer, 0 * t], axis=1)
    result = measured(t, places, radius=15 * nearer)
    assert "OFF_PLANE" in result.flags
    said = re.search(r"grows by \+([\d.]+) %", " ".join(result.warnings))
    assert said is not None
    assert float(said[1]) == pytest.approx(100 * rate * np.ptp(t), rel=0.1)
    # uncorrected, the speed would be wrong by 1 %
    assert result.flights[0].speed_in.value == pytest.approx(true, rel=1e-4)
