"""The README is true: its code runs, its commands exist, its tables are those on file."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import click
import pytest

from virtual_lab import catalog
from virtual_lab.cli import cli

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def test_the_python_example_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    assert (tmp_path / "out" / "mine" / "certificate.html").exists()


def test_the_first_command_and_the_common_jobs_run_in_turn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In one folder, none in the way of another; `critique`, a study, takes minutes."""
    monkeypatch.chdir(tmp_path)
    (first,) = re.findall(r"virtual-lab (certify .*)", README.split("## Five common jobs")[0])
    jobs = README.split("## Five common jobs")[1].split("```")[1]
    words = [line.split("#")[0].split() for line in jobs.strip().splitlines()]
    assert [each[:2] for each in words][1:3] == [
        ["virtual-lab", "score"],
        ["virtual-lab", "reduce"],
    ]
    assert len(words) == 5
    for each in [["virtual-lab", *first.split()], *words]:
        if each[1] != "critique":
            assert cli.main(each[1:], standalone_mode=False) in (None, 0), each


def test_every_command_named_exists() -> None:
    named = set(re.findall(r"virtual-lab ([a-z-]+)", README))
    assert {"certify", "score", "reduce", "critique", "show", "coverage"} <= named
    context = click.Context(cli)
    for command in named:
        assert cli.get_command(context, command), command


def test_every_file_named_exists() -> None:
    for name in re.findall(r"\]\(([^)#:]+)\)", README) + re.findall(
        r"`((?:data|tests|rigs)/\S+?)`", README
    ):
        assert (ROOT / name.rstrip("/")).exists(), name


def test_every_place_in_the_house_exists() -> None:
    house = (ROOT / "virtual_lab" / "README.md").read_text("utf-8")
    named = [name for name in re.findall(r"`([\w./-]+/[\w./-]*)`", house) if "NAME" not in name]
    assert len(named) > 15
    for name in named:
        assert any((top / name).exists() for top in (ROOT, ROOT / "virtual_lab")), name


def test_the_coverage_table_is_the_one_on_file() -> None:
    """Every row in print; each 95 % interval held the truth in 94 % of the laboratories or so."""
    (path,) = (ROOT / "tests" / "studies").glob("coverage-*.csv")
    assert path.stem.removeprefix("coverage-") in README
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    assert {row["procedure"] for row in rows} == set(catalog.names("procedures"))
    for row in rows:
        held, low, high = (f"{100 * float(row[key]):.1f}" for key in ("coverage", "low", "high"))
        assert float(row["high"]) >= 0.94, row
        if row["quantity"] in ("metric", "collision_efficiency"):
            assert f"| {held} % ({low} to {high}) |" in README
            assert f"| {row['laboratories']} |" in README


def test_the_table_of_faults_is_the_one_on_file() -> None:
    """As many are caught as the README says, and as many sound laboratories flagged."""
    (path,) = (ROOT / "tests" / "studies").glob("faults-*.csv")
    assert f"`tests/studies/{path.name}`" in README
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    played = [row for row in rows if row["fault"] != "none"]
    caught = [row for row in played if float(row["caught"]) >= 0.95]
    by_rig = {
        procedure: sum(row["procedure"] == procedure for row in caught)
        for procedure in ("astm-f1881", "bbcor")
    }
    assert f"{by_rig['astm-f1881']} are caught" in README
    assert f"at the ball cannon {by_rig['bbcor']};" in README
    sound = [row for row in rows if row["fault"] == "none"]
    flagged = sum(round(float(row["caught"]) * int(row["laboratories"])) for row in sound)
    total = sum(int(row["laboratories"]) for row in sound)
    assert f"of {total} sound laboratories {flagged} was flagged" in " ".join(README.split())


def test_the_table_of_clips_is_the_one_on_file() -> None:
    """Every interval of the table holds in some 94 % of the clips, as far as so many tell."""
    (path,) = (ROOT / "tests" / "studies").glob("clips-*.csv")
    assert f"`tests/studies/{path.name}`" in README
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    assert [row["quantity"] for row in rows] == ["v_in", "v_out", "e_A"]
    for row in rows:
        held, low, high = (f"{100 * float(row[key]):.1f}" for key in ("coverage", "low", "high"))
        assert float(row["high"]) >= 0.94, row
        start = f"| {row['quantity']} | {row['clips']} | {held} % ({low} to {high}) |"
        assert start in README, start


def test_the_chart_table_is_the_one_on_file() -> None:
    """Eleven of the picture's points, rounded to one digit of error and two of time."""
    with (ROOT / "data" / "figures" / "collision.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    points = set()
    for row in rows:
        time = float(f"{float(row['us_a_shot']):.2g}")
        points.add(f"{float(row['worst_error']):.0e} | {time:g}")
    table = README.split("worst error | µs |\n|---|---|---|\n")[1].split("\n\n")[0].splitlines()
    assert len(table) == 11
    for line in table:
        assert line.split(" | ", 1)[1].removesuffix(" |") in points, line


def test_the_benchmark_table_is_the_one_on_file() -> None:
    (path,) = (ROOT / "tests" / "benchmarks").glob("collision-*.txt")
    assert f"`tests/benchmarks/{path.name}`" in README
    lines = [line.split() for line in path.read_text().splitlines()]
    table = README.split(path.name)[1].split("|---|---|\n")[1].split("\n\n")[0].splitlines()
    assert len(table) > 8
    for row in table:
        what, value = (cell.split() for cell in row.strip("| ").split(" | "))
        found = [line[len(what) :] for line in lines if line[: len(what)] == what]
        assert any(rest[: len(value)] == value for rest in found), row
