"""The maps of disturbances of a picture: their states and files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from virtual_lab.cli import cli
from virtual_lab.fidelity import camera_stability as maps
from virtual_lab.fidelity.camera_drops import dropped_frames
from virtual_lab.fidelity.camera_estimators import EDGE
from virtual_lab.fidelity.drawing import PictureState

Row = dict[str, Any]
ENDS = {
    "contrast / noise": (5, 96),
    "share of the ball outside the frame": (0.25,),
    "share of the ball behind the bat": (0.25,),
    "exposure / correct exposure": (2,),
    "number of hot pixels": (100,),
}


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    axes = {name: (maps.AXES[name][0], ENDS[name]) for name in ENDS}
    pictures = maps.picture_cells(axes=axes, balls={"plain": maps.BALLS["plain"]})
    return pictures + dropped_frames(counts=(0, 3), flights=2)


def state(rows: list[Row], axis: str, value: float, method: str = EDGE) -> str:
    wanted = {"map": axis, "value": value, "method": method}
    (cell,) = [row for row in rows if all(row[name] == v for name, v in wanted.items())]
    return str(cell["state"])


def test_the_fit_is_good_or_flagged(rows: list[Row]) -> None:
    assert state(rows, "contrast / noise", 5) == PictureState.GOOD
    assert state(rows, "contrast / noise", 96) == PictureState.GOOD
    assert state(rows, "number of hot pixels", 100) == PictureState.GOOD
    for axis, value in (
        ("share of the ball outside the frame", 0.25),
        ("share of the ball behind the bat", 0.25),
        ("exposure / correct exposure", 2),
    ):
        assert state(rows, axis, value) == PictureState.FLAGGED
    assert maps.unsaid_share(rows, EDGE) == 0


def test_dropped_frames_are_detected(rows: list[Row]) -> None:
    part_rows = {(row["ball"], row["value"]): row for row in rows if row["method"] == "followed"}
    assert len(part_rows) == 2 * 4
    for (ball, count), row in part_rows.items():
        assert row["unsaid"] == 0
        if ball == "error of positions 0.02 px":
            assert row["state"] == PictureState.GOOD
            assert row["flagged"] == (2 if count else 0)
        assert (row["rms_unflagged"] is None) is (row["flagged"] == row["pictures"])


def test_the_text_and_the_files_have_every_row(rows: list[Row], tmp_path: Path) -> None:
    text = maps._maps(rows).text
    assert all(axis in text for axis in ENDS)
    assert "over all maps" in text
    json.dumps(rows, allow_nan=False)
    maps._maps(rows).save(tmp_path / "maps")
    assert (tmp_path / "maps" / "stability.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "maps" / "stability.csv").read_text().splitlines()) == len(rows) + 1


@pytest.mark.parametrize("name", ["stability", "chart"])
def test_the_commands_refuse_a_folder_that_is_not_empty(name: str, tmp_path: Path) -> None:
    from click.testing import CliRunner

    (tmp_path / "kept").write_text("")
    done = CliRunner().invoke(cli, ["model", name, "camera", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "not empty" in str(done.exception)
