"""The camera's record of a flight, in each detail, against the true position of the ball."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.film import whole_frames, write_clip, write_preview
from virtual_lab.simulation.instruments.camera.shots import Course
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Streams

SPEC = catalog.load("instruments", "camera-backlit", CameraSpec).spec
SPEED_IN, SPEED_OUT, CONTACT = 60.0, 25.0, 0.02


def course(shots: int) -> Course:
    passage = Passage(
        speed_in=np.full(shots, SPEED_IN),
        speed_out=np.full(shots, SPEED_OUT),
        drag=np.full(shots, 0.007),
        radius=0.0365,
        gravity=9.80665,
    )
    contact = np.full(shots, CONTACT)
    still = np.zeros((shots, 3))
    return Course(
        passage=passage,
        contact=contact,
        leaving=contact + 7e-4,
        along=np.zeros(shots),
        spin_in=still,
        spin_out=still,
        stand=still,
    )


def camera(spec: CameraSpec = SPEC) -> Camera:
    return Camera.commission(spec, Streams(1), "camera")


def test_windows_show_the_ball_at_its_true_position() -> None:
    """The centroid of the hidden background lies at the true outline."""
    clip, truth = camera(SPEC.ideal()).watch(course(2), Streams(2), "clip", np.arange(2))
    assert isinstance(clip, ClipRecord)
    assert clip.pixels is not None
    assert clip.background is not None
    checked = 0
    for shot, frame in zip(*np.nonzero(np.isfinite(clip.left)), strict=True):
        left, top = int(clip.left[shot, frame]), int(clip.top[shot, frame])
        window = clip.pixels[shot, frame].astype(float)
        size = len(window)
        hidden = clip.background[top : top + size, left : left + size] - window
        x, y = truth["frame_outline"][shot, frame]
        margin = truth["frame_radius"][shot, frame] + 8
        if not (
            left + margin < x < left + size - margin and top + margin < y < top + size - margin
        ):
            continue
        rows, columns = np.mgrid[:size, :size]
        moment = hidden.sum()
        assert left + (hidden * columns).sum() / moment == pytest.approx(x, abs=0.25)
        assert top + (hidden * rows).sum() / moment == pytest.approx(y, abs=0.25)
        checked += 1
    assert checked > 5


def test_frames_come_at_the_cameras_rate_and_the_ball_at_its_speed() -> None:
    track, truth = camera(SPEC.ideal()).watch(
        course(3), Streams(3), "track", np.arange(3), RecordDetail.SUMMED
    )
    assert isinstance(track, TrackRecord)
    steps = np.diff(track.times, axis=1)
    assert steps[np.isfinite(steps)] == pytest.approx(1 / SPEC.clock.frame_rate, rel=1e-9)
    place, time = truth["frame_position"][..., 0], truth["frame_time"]
    before = (time < CONTACT).sum(axis=1)
    for shot, many in enumerate(before):
        speed = np.diff(place[shot, :many]) / np.diff(time[shot, :many])
        assert speed == pytest.approx(SPEED_IN, rel=0.01)  # drag: 0.7 % per meter
        assert (np.diff(speed) < 0).all()


def test_positions_scatter_by_the_stated_uncertainty() -> None:
    track, truth = camera().watch(
        course(200), Streams(4), "track", np.arange(200), RecordDetail.SUMMED
    )
    assert isinstance(track, TrackRecord)
    deviation = (track.x - truth["frame_outline"][..., 0]) / track.u
    deviation = deviation[np.isfinite(deviation)]
    assert abs(np.mean(deviation**2) - 1) < 5 * np.sqrt(2 / deviation.size)


def test_a_frame_lost_leaves_a_gap_in_the_time_stamps() -> None:
    leaky = replace(SPEC.ideal(), clock=replace(SPEC.clock.ideal(), drop_rate=0.2))
    track, _ = camera(leaky).watch(
        course(20), Streams(5), "track", np.arange(20), RecordDetail.SUMMED
    )
    steps = np.diff(track.times, axis=1) * SPEC.clock.frame_rate
    steps = steps[np.isfinite(steps)]
    assert steps == pytest.approx(np.rint(steps), abs=1e-6)
    assert set(np.rint(steps)) >= {1.0, 2.0}


def test_a_film_keeps_every_frame_and_its_time(tmp_path: Path) -> None:
    frames = list(islice(whole_frames(camera(), course(1), Streams(6), "film", np.arange(1)), 6))
    rate = SPEC.clock.frame_rate
    write_clip(tmp_path / "film.mp4", frames, rate)
    reader = cv2.VideoCapture(str(tmp_path / "film.mp4"), cv2.CAP_FFMPEG)
    reader.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    for _, frame in frames:
        good, picture = reader.read()
        assert good
        assert np.array_equal(np.squeeze(picture), frame)
    assert not reader.read()[0]


def test_a_preview_plays_every_frame_slowly(tmp_path: Path) -> None:
    """25 frames per second of the root of the gray values; the brightest are near 255."""
    ramp = np.linspace(0, 1000, 32)[None] * np.ones((20, 1))
    write_preview(tmp_path / "film.webp", [ramp * (k + 1) / 5 for k in range(5)], 4095)
    good, picture = cv2.imreadanimation(str(tmp_path / "film.webp"))
    assert good
    assert len(picture.frames) == 5
    assert set(np.ravel(picture.durations).tolist()) == {40}
    for k, frame in enumerate(picture.frames):
        assert frame.shape[:2] == (20, 32)
        expected = 255 * np.sqrt(ramp[0] / 1000 * (k + 1) / 5)
        assert np.abs(frame[..., 0].mean(axis=0) - expected).max() < 8
    with pytest.raises(InputError, match="a preview needs frames"):
        write_preview(tmp_path / "none.webp", [], 4095)
    with pytest.raises(InputError, match="a film needs frames"):
        write_clip(tmp_path / "none.mp4", [], 5000)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.webp"]
