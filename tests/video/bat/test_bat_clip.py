"""The bat in a clip with a ball: filmed, tracked, and its recoil beside the one that was played."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.simulation.instruments.camera.scenes import bat_of, camera_of, course_of
from tests.video.bat.test_bat import model_of
from tests.video.boards import small_camera
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.simulation.instruments.camera.film import whole_frames
from virtual_lab.streams import Streams
from virtual_lab.video.clips.calibration_file import read_calibration

RATE = 12.0  # rad/s


def calibration(camera, bat) -> str:
    """Return the file of a camera known exactly; its axes are under it, Y down."""
    model, place = model_of(camera), camera.lens.place
    axis, pivot = float(bat.pivot[0] - place[0]), float(place[1] - bat.pivot[1])
    return f"""
timestamps = "clip.csv"
exposure_s = 2.5e-5
ball_diameter_m = 0.073
[camera]
image_size = {list(model.image_size)}
matrix = {[list(map(float, row)) for row in model.matrix]}
distortion = {list(map(float, model.distortion))}
rotation = {list(map(float, model.rotation))}
translation_m = {list(map(float, model.translation_m))}
plane_height_m = {-camera.plane!r}
[bat]
pivot_m = [{axis}, {pivot}]
toward_m = [{axis}, 0.0]
widest_m = 0.055
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("bat")
    spec = replace(small_camera(3).spec, frames_in=14, frames_out=20)
    camera, course = camera_of(spec, Streams(3)), course_of()
    # so slow that the small picture still shows it when it has parted from the bat
    course = replace(course, passage=replace(course.passage, speed_out=np.full(3, 9.6)))
    bat = bat_of(course)
    assert set(bat.rate) == {RATE}
    frames = list(whole_frames(camera, course, Streams(4), "film", np.arange(3), bat))
    np.save(at / "clip.npy", np.stack([frame for _, frame in frames]))
    stamps = "".join(f"{stamp!r}\n" for stamp, _ in frames)
    (at / "clip.csv").write_text(f"time_s\n{stamps}")
    (at / "cal.toml").write_text(calibration(camera, bat))
    (at / "truth.json").write_text(json.dumps({"contact": float(course.contact[0])}))
    return at


def test_track_tells_how_the_bat_recoils(folder: Path) -> None:
    """Rate within 3 u, of 0.2 %; the turn begins when the ball touched; table."""
    out = folder / "found"
    words = [str(folder / "clip.npy"), "--calibration", str(folder / "cal.toml")]
    done = CliRunner().invoke(cli, ["track", *words, "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)["bat"]
    rate, begun = told["rate_rad_per_s"], told["turn_began_s"]
    # the axes' Y is down: clockwise as seen is from X toward Y
    assert abs(rate["value"] - RATE) < 3 * rate["u"] < 8e-3 * RATE
    contact = json.loads((folder / "truth.json").read_text())["contact"]
    assert abs(begun["value"] - contact) < 3 * begun["u"] < 3e-5
    rows = list(csv.DictReader((out / "bat.csv").read_text().splitlines()))
    assert len(rows) == told["frames"]["seen"] > 25
    angle, time = (np.array([float(row[key]) for row in rows]) for key in ("angle_rad", "time_s"))
    np.testing.assert_allclose(angle, RATE * np.maximum(time - contact, 0), atol=4e-4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("toward_m = [", "toward_m = [5.0, 0.0] # ", "its axis does not cross the picture"),
        ("widest_m = 0.055", "widest_m = -1.0", "bat.widest_m"),
        ("widest_m = 0.055", "wide_m = 0.055", "bat.wide"),
    ],
)
def test_a_bat_that_is_not_there(folder: Path, old: str, new: str, words: str) -> None:
    text = (folder / "cal.toml").read_text()
    assert old in text
    (folder / "wrong.toml").write_text(text.replace(old, new))
    words_in = ["--calibration", str(folder / "wrong.toml"), "--out", str(folder / "none")]
    done = CliRunner().invoke(cli, ["track", str(folder / "clip.npy"), *words_in])
    assert isinstance(done.exception, InputError)
    assert words in str(done.exception)
    assert not (folder / "none").exists()


def test_a_bat_needs_a_camera(folder: Path) -> None:
    text = (folder / "cal.toml").read_text()
    bare = text[: text.index("[camera]")] + text[text.index("[bat]") :]
    (folder / "bare.toml").write_text(bare)
    with pytest.raises(InputError, match="give that, too"):
        read_calibration(folder / "bare.toml")
