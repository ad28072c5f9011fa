"""`virtual-lab board` and `virtual-lab calibrate`: pictures, files, the drawing, and messages."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

import virtual_lab as vl
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import read_calibration

BOARD = ["--board", "charuco:9x6:60mm:44mm"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("calibrate")
    words = ["board", *BOARD, "--views", "4", "--seed", "3", "--out", str(at / "board")]
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.output
    assert done.stdout.strip() == str(at / "board/pictures")
    return at


def test_calibrate_finds_the_true_camera_of_rendered_pictures(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "board/pictures/Thumbs.db").write_bytes(b"litter")
    saved, save = list[vl.Calibration](), vl.Calibration.save
    monkeypatch.setattr(
        vl.Calibration,
        "save",
        lambda self, *path, **how: saved.append(self) or save(self, *path, **how),
    )
    out = folder / "cal.toml"
    words = ["calibrate", str(folder / "board/pictures"), *BOARD, "--out", str(out), "--json"]
    done = CliRunner().invoke(cli, [*words, "--height", "36.5mm", "--height-u", "1mm"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    camera = read_calibration(out).camera
    assert camera is not None
    assert camera.plane_height_m == -0.0365
    assert document["camera"]["matrix"] == [list(row) for row in camera.matrix]
    assert document["plane_view"].endswith("view-00.png")
    assert len(document["views"]) == 4
    truth = json.loads((folder / "board/truth/camera.json").read_text())["constants"]
    assert camera.fit is not None
    for index, key in enumerate(("centre_x", "centre_y")):
        assert abs(camera.matrix[index][2] - truth[key]) < 5 * camera.fit.centre_u_px[index]
        assert abs(camera.matrix[index][index] - truth["focal"]) < 5 * camera.fit.focal_u_px[index]
    drawing = cv2.imread(str(folder / "cal.png"))
    assert drawing.shape[1] > 1000
    assert drawing.std() > 10
    (found,) = saved
    assert found.camera.warnings[-1] == "ignored: Thumbs.db"
    figure = found.plot()
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert len(figure.axes[0].collections[0].get_offsets()) == len(found.camera.solved.places)
    again = CliRunner().invoke(cli, words)
    assert isinstance(again.exception, InputError)
    assert "exists already" in str(again.exception)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.png", *BOARD, "--out", "a.toml"], "no such file"),
        (["board", *BOARD, "--out", "a.toml"], "images = 0"),
        (["text.png", *BOARD, "--out", "a.toml"], "cannot be read"),
        (["blank.png", *BOARD, "--out", "a.toml"], "at least 3 pictures must show the board"),
        (["blank.png", *BOARD, "--out", "a.json"], "ends in .toml"),
        (["blank.png", "--board", "9x6", "--out", "a.toml"], "expected charuco:"),
        (["blank.png", *BOARD, "--height", "36", "--out", "a.toml"], "length with its unit"),
    ],
)
def test_bad_input_leaves_nothing_behind(
    words: list[str], said: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "text.png").write_text("no picture")
    cv2.imwrite(str(folder / "blank.png"), np.full((80, 120), 90, np.uint8))
    done = CliRunner().invoke(cli, ["calibrate", *words])
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)
    assert not list(folder.glob("a.*"))


def test_a_board_is_filmed_by_a_camera_only(tmp_path: Path) -> None:
    for words, said in (
        (["--camera", "pivot-gates"], "pivot-gates.toml"),
        (["--camera", "camera-overhed"], "camera-overhead"),
    ):
        done = CliRunner().invoke(cli, ["board", *BOARD, *words, "--out", str(tmp_path / "b")])
        assert isinstance(done.exception, InputError)
        assert said in str(done.exception)
        assert not list(tmp_path.iterdir())
