"""`virtual-lab track` on a clip of a known ball: files, JSON, errors of one line."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from tests.video.scenes import Film, write_video
from virtual_lab.cli import cli
from virtual_lab.errors import InputError

FILM = Film()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("track")
    write_video(at / "clip.mp4", list(FILM.frames()), 5000)
    (at / "cal.toml").write_text("frames_per_second = 5000\nexposure_s = 2e-5\n")
    return at


def test_everything_a_user_gets(folder: Path) -> None:
    out = folder / "found"
    arguments = ["track", str(folder / "clip.mp4"), "--calibration", str(folder / "cal.toml")]
    done = CliRunner().invoke(
        cli, [*arguments, "--ball", "28mm±0.1mm", "--out", str(out), "--json"]
    )
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told == json.loads((out / "result.json").read_text())
    speed, true = told["speed_in_mps"], np.hypot(*FILM.velocity_in) * 5.0
    assert speed.keys() == {"value", "u"}
    assert abs(speed["value"] - true) < 2 * speed["u"] < 0.02 * true
    assert told["speed_out_mps"].keys() == told["restitution"].keys() == {"value", "u"}
    assert told["flags"] == []
    assert told["warnings"] == []
    assert told["counts"] == {
        "frames": 44, "with_ball": 44, "in": 19, "out": 25, "in_contact": 0, "lost": 0,
    }  # fmt: skip
    assert sorted(path.name for path in out.iterdir()) == [
        "result.json", "sheet.png", "track.csv", "track.png", "track.webp",
    ]  # fmt: skip
    rows = list(csv.DictReader((out / "track.csv").read_text().splitlines()))
    assert len(rows) == 44
    x, _ = FILM.places()
    np.testing.assert_allclose([float(row["x_px"]) for row in rows], x, atol=0.05)
    assert {row["flight"] for row in rows} == {"in", "out"}
    for name, least in (("track.png", 600), ("sheet.png", 1200)):
        picture = cv2.imread(str(out / name))
        assert picture is not None
        assert picture.shape[1] > least
        assert picture.std() > 10
    _, film = cv2.imreadanimation(str(out / "track.webp"))
    assert len(film.frames) == 44


def test_a_clip_without_a_calibration_file_warns(folder: Path) -> None:
    out = folder / "bare"
    arguments = ["track", str(folder / "clip.mp4"), "--ball", "2.8 cm"]
    done = CliRunner().invoke(cli, [*arguments, "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "the frame rate is the file's own" in done.stdout
    assert "0.28 mm was assumed" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["clip.mp4"], "no length is known"),
        (["clip.mp4", "--ball", "73"], "a length with its unit"),
        (["clip.mp4", "--ball", "73 furlongs"], "a length with its unit"),
        (["clip.mp4", "--ball", "0mm"], "0.001 to 1 m"),
        (["clip.mp4", "--ball", "28mm", "--calibration", "none.toml"], "none.toml"),
        (["cal.toml", "--ball", "28mm"], "cannot be opened"),
        (["none.mp4", "--ball", "28mm"], "no such file"),
    ],
)
def test_bad_input_leaves_nothing_behind(folder: Path, arguments: list[str], words: str) -> None:
    at = [str(folder / each) if "." in each and "mm" not in each else each for each in arguments]
    before = set(folder.iterdir())
    done = CliRunner().invoke(cli, ["track", *at])
    assert isinstance(done.exception, InputError)
    assert words in str(done.exception)
    assert set(folder.iterdir()) == before


def test_two_balls_are_said(folder: Path) -> None:
    """Alike and at the same time: a clip was read, so there is a result, and it says so."""
    other = replace(FILM, contact=(240.0, 30.0), noise=0.0, velocity_in=(9.3, -1.0))
    both = [np.maximum(a, b) for a, b in zip(FILM.frames(), other.frames(), strict=True)]
    np.save(folder / "two.npy", np.stack(both))
    arguments = ["--ball", "28mm", "--fps", "5000", "--json"]
    done = CliRunner().invoke(cli, ["track", str(folder / "two.npy"), *arguments])
    assert done.exit_code == 0, done.output
    assert "SECOND_BALL" in json.loads(done.stdout)["flags"]
