"""The maps of pymunk's steps: their states and files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from virtual_lab.cli import cli
from virtual_lab.fidelity import motion_stability as maps
from virtual_lab.fidelity.drawing import State
from virtual_lab.fidelity.results import StabilityMap

Row = dict[str, Any]


@pytest.fixture(scope="module")
def found() -> StabilityMap:
    ends = {axis: (values[0], values[-1]) for axis, values in maps.AXES.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "AXES", ends)
        patch.setattr(maps, "STEPS", (1e-2, 1e-3, 1e-4))
        return maps.motion_stability()


@pytest.fixture(scope="module")
def rows(found: StabilityMap) -> list[Row]:
    return found.rows


def state(rows: list[Row], method: str, axis: str, step: float, value: float) -> str:
    wanted = {"method": method, "map": axis, "step": step, "value": value}
    (cell,) = [row for row in rows if all(row[name] == v for name, v in wanted.items())]
    return str(cell["state"])


def test_our_model_is_good_wherever_it_gives_a_result(rows: list[Row]) -> None:
    part_rows = [row for row in rows if row["method"] == maps.Carrier.OURS]
    assert {row["state"] for row in part_rows if not row["refused"]} == {State.GOOD}
    for row in part_rows:
        long = row["step"] == 1e-2 and not (
            row["map"] == maps.MotionAxis.SPEED and row["value"] == 10
        )
        long |= row["step"] == 1e-3 and row["map"] == maps.MotionAxis.SPEED and row["value"] == 200
        slop = row["map"] == maps.MotionAxis.SLOP and row["value"] == 0.1
        few = row["map"] == maps.MotionAxis.ITERATIONS and row["value"] == 1
        assert row["refused"] == (long or slop or few), row


def test_plain_pymunk_refuses_nothing_and_is_wrong_in_places(rows: list[Row]) -> None:
    """A flat hit is right until it is jumped; the tip, a round bat and one iteration are wrong."""
    assert not any(row["refused"] for row in rows if row["method"] == maps.Carrier.ALONE)
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.SPEED, 1e-2, 10) == State.GOOD
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.SPEED, 1e-3, 200) == State.UNSTABLE
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.SPEED, 1e-4, 200) == State.GOOD
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.PLACE, 1e-4, 0.2) == State.INACCURATE
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.PLACE, 1e-4, 20) == State.GOOD
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.ACROSS, 1e-4, 60) == State.INACCURATE
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.ITERATIONS, 1e-4, 1) == State.INACCURATE
    assert state(rows, maps.Carrier.ALONE, maps.MotionAxis.ITERATIONS, 1e-4, 50) == State.GOOD


def test_the_text_and_the_files_have_every_row(found: StabilityMap, tmp_path: Path) -> None:
    text, rows = found.text, found.rows
    assert text.count(maps.Carrier.OURS) == text.count(maps.Carrier.ALONE) == len(maps.AXES)
    assert "(.)" in text
    json.dumps(rows, allow_nan=False)
    found.save(tmp_path / "maps")
    assert (tmp_path / "maps" / "stability.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "maps" / "stability.csv").read_text().splitlines()) == len(rows) + 1


@pytest.mark.parametrize("words", [["stability", "motion"], ["chart", "motion"]])
def test_the_commands_refuse_a_folder_that_is_not_empty(words: list[str], tmp_path: Path) -> None:
    from click.testing import CliRunner

    (tmp_path / "kept").write_text("")
    done = CliRunner().invoke(cli, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "not empty" in str(done.exception)


def test_the_command_prints_its_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    monkeypatch.setattr(maps, "AXES", {maps.MotionAxis.SPEED: (60,)})
    monkeypatch.setattr(maps, "STEPS", (1e-3,))
    out = str(tmp_path / "maps")
    done = CliRunner().invoke(cli, ["stability", "motion", "--out", out, "--json"])
    assert done.exit_code == 0, done.output
    assert [row["state"] for row in json.loads(done.stdout)] == [State.GOOD, State.GOOD]
