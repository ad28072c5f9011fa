"""Frames against the closed form of the flights, and summed records against the Fisher bound."""

from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.instruments.camera.scenes import (
    QUIET,
    SHOTS,
    TOUCHED,
    bat_of,
    camera_of,
    course_of,
    spec_of,
)
from virtual_lab.records import join
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.camera.ball import render_balls
from virtual_lab.simulation.instruments.camera.scene import background
from virtual_lab.simulation.instruments.camera.spec import BallLook
from virtual_lab.streams import Streams

PLAIN = BallLook(albedo=0.85, seam_contrast=0.0)


def test_frames_show_the_ball_at_its_true_position() -> None:
    """The oracle is the closed form of the gates: the time at which a ball passes a position."""
    course = course_of()
    camera = camera_of(spec_of("camera-overhead"), Streams(1))
    record, truth = camera.watch(course, QUIET, "c", np.arange(SHOTS), RecordDetail.SUMMED)
    x, z = truth["frame_position"][..., 0], truth["frame_position"][..., 2]
    before = truth["frame_time"] < course.contact[:, None]
    after = truth["frame_time"] > course.leaving[:, None]
    assert before.sum() > 30
    assert after.sum() > 40
    since, height = course.passage.inbound(-x)
    assert np.abs(course.contact[:, None] - since - truth["frame_time"])[before].max() < 1e-12
    assert np.abs(height - z)[before].max() < 1e-12
    since, height = course.passage.outbound(-x)
    assert np.abs(course.leaving[:, None] + since - truth["frame_time"])[after].max() < 1e-12
    assert np.abs(height - z)[after].max() < 1e-12
    steps = np.diff(record.times, axis=1)
    assert steps == pytest.approx(np.full(steps.shape, 1 / 5000), abs=1e-12)
    assert record.times == pytest.approx(truth["frame_time"] * camera.clock, abs=1e-12)


def test_the_centre_moves_smoothly_during_contact() -> None:
    """At both ends of contact, position and speed equal those of the flights."""
    course = course_of()
    shot, step = np.arange(3), 1e-8
    for end, speed in (
        (course.contact, course.passage.speed_in),
        (course.leaving, -course.passage.speed_out),
    ):
        places = [course.at(shot, end + k * step)[:, 0] for k in (-1, 0, 1)]
        assert np.abs(places[1]).max() < 1e-12
        assert (places[2] - places[1]) / step == pytest.approx(speed, rel=1e-3)
        assert (places[1] - places[0]) / step == pytest.approx(speed, rel=1e-3)
    deepest = course.at(shot, course.contact + TOUCHED / 3)[:, 0]
    assert np.all(deepest > 2e-3)


def test_lost_frames_leave_a_gap_in_the_time_stamps() -> None:
    """A fifth of 96 frames is missing, and the time stamps of the others show the gaps."""
    clock = replace(spec_of("camera-overhead").clock, drop_rate=0.2)
    camera = camera_of(spec_of("camera-overhead", clock=clock), Streams(2))
    record, truth = camera.watch(
        course_of(), Streams(3), "c", np.arange(SHOTS), RecordDetail.SUMMED
    )
    there = np.isfinite(record.times)
    assert 5 < (~there).sum() < 40
    assert np.array_equal(there, np.isfinite(truth["frame_time"]))
    assert np.array_equal(there, np.sort(there, axis=1)[:, ::-1])
    steps = np.diff(record.times, axis=1) * 5000
    whole = np.rint(steps[np.isfinite(steps)])
    assert np.nanmax(np.abs(steps - np.rint(steps))) < 0.01
    assert (whole > 1).sum() > 4


def test_the_uncertainty_of_a_summed_record_is_the_fisher_bound() -> None:
    """Fisher information of x and y of a rendered ball, at known radius and blur, plus 10 %.

    The noise is that of each pixel, along and across the motion blur.
    """
    spec = replace(spec_of("camera-backlit"), ball=PLAIN)
    camera = camera_of(spec, QUIET)
    record, truth = camera.watch(course_of(), QUIET, "c", np.arange(SHOTS), RecordDetail.SUMMED)
    radius, blur = truth["frame_radius"][0, 0], truth["frame_blur"][0, 0]
    behind, white = background(spec)[400, 640], spec.light.ball * spec.electrons_per_rate

    def image(x: float, y: float) -> np.ndarray:
        middle = np.array([50 + x, 50 + y])
        path = [[middle - blur / 2, middle + blur / 2]]
        ball = render_balls(path, radius, [[0, 0]], (100, 100), sigma=spec.blur, look=PLAIN)
        return ball.over(behind, white)[0].astype(float)

    step = 0.05
    slopes = [
        (image(step, 0) - image(-step, 0)) / (2 * step),
        (image(0, step) - image(0, -step)) / (2 * step),
    ]
    variance = image(0, 0) + spec.sensor.read_noise**2
    bounds = [1 / np.sqrt((slope**2 / variance).sum()) for slope in slopes]
    mean = float(np.sqrt(np.mean(np.square(bounds))))
    assert record.u[0, 0] == pytest.approx(1.1 * mean, rel=0.1)
    noisy, truth = camera.watch(course_of(), Streams(4), "c", np.arange(SHOTS), RecordDetail.SUMMED)
    pulls = (np.stack([noisy.x, noisy.y], axis=-1) - truth["frame_outline"]) / noisy.u[..., None]
    pulls = pulls[np.isfinite(pulls)]
    assert pulls.std() == pytest.approx(1, abs=4 / np.sqrt(2 * pulls.size))


def test_a_turned_bat_is_drawn_at_its_angle() -> None:
    """Width and position of the bar agree with its projected edges to 0.01 px."""
    spec = spec_of("camera-backlit").ideal()
    camera = camera_of(replace(spec, light=replace(spec.light, bat=0.0)), QUIET)
    bat = bat_of(course_of())
    frame = np.full((1, 800, 1280), 1000, np.float32)
    camera.put(bat, np.array([0.05]), np.zeros((1, 2), np.int64), frame)
    cover = 1 - frame[0].astype(float) / 1000
    near, far = (edge[0] for edge in bat.edges(np.array([0.05]), camera.lens))
    for row in (250, 400, 700):
        left, right = (np.interp(-row, -edge[:, 1], edge[:, 0]) for edge in (near, far))
        assert cover[row].sum() == pytest.approx(right - left, abs=0.01)
        middle = cover[row] @ np.arange(1280) / cover[row].sum()
        assert middle == pytest.approx((left + right) / 2, abs=0.01)
    # end of the bat: 0.15 m beyond the impact position
    tip = camera.lens.to_pixels(camera.lens.to_camera([0.0695 + 0.75 * np.sin(0.05), 0.15, 0.0]))
    assert np.flatnonzero(cover.sum(axis=1) > 1)[0] == pytest.approx(tip[1], abs=4)


def test_the_same_seed_is_the_same_clip_and_another_is_not() -> None:
    """Windows and background have the same bits; joined records follow each other."""
    camera = camera_of(spec_of("camera-side-lit"), Streams(1))
    course = course_of()
    one, two, other = (
        camera.watch(course, Streams(seed), "c", np.arange(SHOTS), bat=bat_of(course))[0]
        for seed in (7, 7, 8)
    )
    assert np.array_equal(one.pixels, two.pixels)
    assert np.array_equal(one.background, two.background)
    assert not np.array_equal(one.pixels, other.pixels)
    both = join([one, other])
    assert both.pixels.shape[0] == 6
    assert np.array_equal(both.pixels[3:], other.pixels)
    assert np.array_equal(both.left[:3], one.left, equal_nan=True)


def test_calibration_and_errors_have_the_same_constants() -> None:
    """True constants lie within 5 u of the certificate; an ideal camera has those of its sheet."""
    spec = spec_of("camera-overhead")
    camera = camera_of(spec, Streams(9))
    calibration = camera.calibration()
    for key, value in camera.errors().items():
        # tolerance: the true position also turns with the tilt, 2 m away
        tolerance = 5 * calibration[key].u + 5e-3 * key.startswith("translation")
        assert abs(value - calibration[key].value) <= tolerance, key
    ideal = camera_of(spec.ideal(), QUIET)
    for key, value in ideal.errors().items():
        assert value == pytest.approx(ideal.calibration()[key].value, abs=1e-9), key
