"""A bat's angle by frame and its recoil, against the turn that was rendered or drawn."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from tests.simulation.instruments.camera.scenes import bat_of, course_of
from tests.video.boards import small_camera, true_model
from tests.video.calibration.test_plane import CAMERA
from virtual_lab.errors import InputError
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.scene import FilmedBat, background
from virtual_lab.streams import Streams
from virtual_lab.video.bat.angles import BatAngles, bat_angles, recoil_of
from virtual_lab.video.bat.outline import BatEdges, find_outline
from virtual_lab.video.clips.calibration_file import BatPlace, CameraModel

Array = NDArray[np.float64]
NO_BALLS = np.full((32, 3), np.nan)


def model_of(camera: Camera) -> CameraModel:
    sensor = camera.spec.sensor
    return replace(
        true_model(camera.lens, CAMERA),
        image_size=(sensor.columns, sensor.rows),
        plane_height_m=0.0,
    )


def outline_in(
    camera: Camera, rest: NDArray[np.float32], bat: FilmedBat, off: float = 0.0
) -> BatEdges:
    """Return a bat's outline in axes from under the camera, Y down; `off` misplaces its pivot."""
    x, y, _ = camera.lens.place
    pivot = (bat.pivot[0] - x, y - bat.pivot[1] - off)
    place = BatPlace(pivot_m=pivot, toward_m=(pivot[0], y), widest_m=0.06)
    return find_outline(rest, place, model_of(camera))


def films(camera: Camera, bat: FilmedBat, angles: Array, seed: int) -> list[NDArray[np.generic]]:
    """Return whole frames of a bat without a ball."""
    corner = np.zeros((1, 2), np.int64)
    still, frames = background(camera.spec), []
    for number, angle in enumerate(angles):
        light = still[None].copy()
        camera.put(bat, np.array([angle]), corner, light)
        grey = camera.sensor.expose(light, corner, Streams(seed), f"film.{number}", None, 2.5e-5)
        frames.append(grey[0])
    return frames


@pytest.fixture(scope="module")
def filmed() -> tuple[Camera, FilmedBat, BatEdges, Array, Array, list[NDArray[np.generic]]]:
    """Return a bat at rest for 8 frames, turning at 12 rad/s for 24: 0.06 rad, 40 px at its tip."""
    camera, bat = small_camera(3), bat_of(course_of())
    camera = replace(camera, spec=replace(camera.spec, empty_frames=32))
    outline = outline_in(camera, camera.empty(Streams(4), "empty", bat), bat)
    times = (np.arange(32) - 7.5) / 5000
    angles = 12.0 * np.maximum(times, 0.0)
    return camera, bat, outline, times, angles, films(camera, bat, angles, 5)


@pytest.mark.parametrize(("pivoted", "least"), [(True, 2.5e-5), (False, 8e-5)])
def test_angles_and_recoil_of_a_rendered_bat(filmed, pivoted: bool, least: float) -> None:
    """Errors over their own u, frame by frame; the rate within 3 u, of 0.02 or 0.07 %."""
    _, _, outline, times, angles, frames = filmed
    assert min((outline.side == each).sum() for each in (1, -1)) > 80
    taken = zip(times, frames, strict=True)
    found = bat_angles(taken, outline, NO_BALLS, pivoted=pivoted)
    off = found.angle - angles
    assert found.u.max() < least
    assert 0.55 < np.sqrt(np.mean((off / found.u) ** 2)) < 1.3
    recoil = recoil_of(found, 0.0)
    assert abs(recoil.rate.value - 12) < 3 * recoil.rate.u < 12 * (8e-4 if pivoted else 3e-3)
    assert abs(recoil.contact.value) < 3 * recoil.contact.u < 1e-5
    assert recoil.chi_square < 1.8
    assert recoil.frames == 24


def test_a_misplaced_pivot_hurts_only_who_trusts_it(filmed) -> None:
    """10 mm nearer: levers of 0.23 to 0.75 m are too short, so angles come out 2 % too large."""
    camera, bat, _, times, _, frames = filmed
    rest = camera.empty(Streams(4), "empty", bat)
    wrong = outline_in(camera, rest, bat, off=0.01)
    taken = list(zip(times, frames, strict=True))
    free = recoil_of(bat_angles(taken, wrong, NO_BALLS), 0.0)
    held = recoil_of(bat_angles(taken, wrong, NO_BALLS, pivoted=True), 0.0)
    assert abs(free.rate.value - 12) < 3 * free.rate.u
    # least squares of s ω = (s - 0.01) ω' over the visible s
    s = np.linspace(0.23, 0.75, 100)
    expected = 12 * (s * (s - 0.01)).sum() / ((s - 0.01) ** 2).sum()
    assert held.rate.value == pytest.approx(expected, rel=1.5e-3)


# a pixel is a millimetre of the plane, its places are the picture's
FLAT = replace(
    CAMERA,
    image_size=(260, 200),
    matrix=((1000.0, 0.0, 0.0), (0.0, 1000.0, 0.0), (0.0, 0.0, 1.0)),
    distortion=(0.0,) * 4,
    rotation=(0.0, 0.0, 0.0),
    translation_m=(0.0, 0.0, 1.0),
    plane_height_m=0.0,
)
STANDS = BatPlace(pivot_m=(0.12, 0.3), toward_m=(0.12, 0.1), widest_m=0.04)


def bar(angle: float, shift: float = 0.0) -> Array:
    """Return a picture of a tapered bar about pixel (120, 300), its edges blurred by 0.8 px."""
    y, x = np.mgrid[:200, :260] - np.array([300.0, 120.0])[:, None, None]
    cos, sin = np.cos(angle), np.sin(angle)
    across, along = x * cos + y * sin - shift, y * cos - x * sin
    half = 14 - 0.03 * along
    return 40 + 120 * ndtr((across + half) / 0.8) * ndtr((half - across) / 0.8)


def test_a_bar_that_turns() -> None:
    """Drawn in closed form, no noise: to 2e-5 rad, shifted or not."""
    edges = find_outline(bar(0.0), STANDS, FLAT)
    turns = np.linspace(0.0, 0.1, 15)
    for pivoted, shift in ((True, 0.0), (False, 2.5)):
        frames = [(k, bar(angle, shift * (k > 0))) for k, angle in enumerate(turns)]
        found = bat_angles(frames, edges, NO_BALLS, pivoted=pivoted)
        np.testing.assert_allclose(found.angle, turns, atol=2e-5)


def test_a_hidden_bat_has_no_angle() -> None:
    """Behind a ball, out of the picture, or not there."""
    edges = find_outline(bar(0.0), STANDS, FLAT)
    empty = np.full((200, 260), 40.0)
    balls = np.array([[120.0, 100.0, 300.0], [np.nan] * 3, [np.nan] * 3])
    frames = [(0.0, bar(0.0)), (1.0, bar(0.0)[:, :60]), (2.0, empty)]
    found = bat_angles(frames, edges, balls)
    assert np.isnan(found.angle).all()
    assert not found.points.any()
    away = replace(STANDS, pivot_m=(0.9, 0.3), toward_m=(0.9, 0.1))
    with pytest.raises(InputError, match="no edge of it shows"):
        find_outline(empty, STANDS, FLAT)
    with pytest.raises(InputError, match="does not cross the picture"):
        find_outline(bar(0.0), away, FLAT)


def test_a_recoils_uncertainty_is_its_scatter() -> None:
    """400 records of 6 frames before and 14 after: rate and time of contact over their u."""
    draws = Streams(6)
    times, u = (np.arange(20) - 5.5) / 5000, np.linspace(2e-5, 6e-5, 20)
    noise = u * draws.normal("angles", (400, 20))
    known = 2e-5 * draws.normal("contact", 400)
    pulls = []
    for wrong, each in zip(known, noise, strict=True):
        found = BatAngles(
            times=times,
            angle=1e-4 + 9.0 * np.maximum(times, 0.0) + each,
            u=u,
            points=np.full(20, 99),
        )
        recoil = recoil_of(found, float(wrong))
        rate, contact = recoil.rate, recoil.contact
        pulls.append([(rate.value - 9) / rate.u, contact.value / contact.u])
    # u is never below that of the frames' own, so pulls are a little smaller than 1
    assert np.all(np.abs(np.mean(np.square(pulls), axis=0) - 0.93) < 4 * np.sqrt(2 / 400))
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 4 / np.sqrt(400))


def test_a_recoil_needs_frames_on_both_sides() -> None:
    times = np.arange(6.0)
    found = BatAngles(times=times, angle=times, u=np.ones(6), points=np.full(6, 99))
    for contact, words in ((3.5, "frames after contact = 2"), (-0.5, "frames before contact = 0")):
        with pytest.raises(InputError, match=words):
            recoil_of(found, contact)
