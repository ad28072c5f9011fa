"""The pages are right: their code runs, their commands exist, their tables match stored files."""

from __future__ import annotations

import csv
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import pytest
from scipy.stats import binomtest

from virtual_lab import catalog
from virtual_lab.cli import cli
from virtual_lab.errors import VERSION
from virtual_lab.lab.measurand import STANDARD_BALL

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text("utf-8")
STUDIES = "\n".join(
    path.read_text("utf-8")
    for path in sorted((ROOT / "virtual_lab" / "docs" / "studies").glob("*.md"))
)
FIDELITY = (ROOT / "virtual_lab" / "fidelity" / "README.md").read_text("utf-8")
BENCHMARKS = (ROOT / "tests" / "benchmarks" / "README.md").read_text("utf-8")
WAYS = ("first", "draws")  # methods of evaluation: first order, and draws
PAGES = sorted(
    path for path in (ROOT / name for name in ("README.md", "CONTRIBUTING.md")) if path.exists()
) + sorted(
    path
    for top in ("virtual_lab", "data", "tests")
    for path in (ROOT / top).rglob("*.md")
    if "generated" not in path.parts  # written by the build of the site
)


def test_the_python_example_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(block, "README.md", "exec"), names)
    assert (tmp_path / "out" / "mine" / "certificate.html").exists()
    # picture at the top: of the same certificate
    metric = names["certificate"].certification.metric
    half = (metric.interval_95[1] - metric.interval_95[0]) / 2
    assert names["certificate"].verdict == "PASS"
    assert f"verdict PASS, BPF {metric.value:.3f} ± {half:.3f}" in README


def test_the_first_command_and_the_common_jobs_run_in_turn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """All run in one folder, and none obstructs another."""
    monkeypatch.chdir(tmp_path)
    (first,) = re.findall(r"virtual-lab (certify .*)", README.split("## Five jobs")[0])
    jobs = README.split("## Five jobs")[1].split("```")[1]
    words = [line.split("#")[0].split() for line in jobs.strip().splitlines()]
    assert [each[1] for each in words] == ["certify", "score", "reduce", "profile", "coverage"]
    for each in [["virtual-lab", *first.split()], *words]:
        assert cli.main(each[1:], standalone_mode=False) in (None, 0), each
    assert (tmp_path / "out" / "r161-astm-f1881" / "certificate.html").exists()


def test_the_readme_is_short_and_begins_with_a_certificate() -> None:
    assert len(README.splitlines()) <= 90
    assert README.index("data/figures/certificate.png") < README.index("```")
    for name, most in (("certificate", 150_000), ("rehearse", 180_000)):
        assert (ROOT / "data" / "figures" / f"{name}.png").stat().st_size <= most


def test_citations_and_changelog_name_this_version() -> None:
    for page in ("README.md", "virtual_lab/docs/index.md"):
        assert f"version = {{{VERSION}}}" in (ROOT / page).read_text("utf-8"), page
    assert f"## [{VERSION}] - " in (ROOT / "CHANGELOG.md").read_text("utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_and_option_named_exists(page: Path) -> None:
    context = click.Context(cli)
    text = page.read_text("utf-8")
    for words in re.findall(r"(?:`(?:uv run )?|^)virtual-lab ([a-z][^`\n]*)", text, re.MULTILINE):
        named, *rest = words.split("#")[0].split()
        command = cli.get_command(context, named)
        assert command, (page, words)
        if isinstance(command, click.Group) and rest and not rest[0].startswith("--"):
            command = command.get_command(context, rest[0])
            assert command, (page, words)
        options = {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
        assert {each for each in rest if each.startswith("--")} <= options, (page, words)


def test_every_command_is_named_in_some_page() -> None:
    """A new user who reads the pages finds each command."""
    text = "\n".join(page.read_text("utf-8") for page in PAGES)
    for name in cli.commands:
        assert re.search(rf"virtual-lab {name}\b|`{name}`", text), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_file_named_exists(page: Path) -> None:
    text = page.read_text("utf-8")
    for name in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        assert (page.parent / name.rstrip("/")).exists(), (page, name)
    for name in re.findall(r"`((?:data|tests|rigs)/[^\s`]+?)`", text):
        assert "NAME" in name or list(ROOT.glob(name.rstrip("/"))), (page, name)


def test_every_path_in_the_overview_exists() -> None:
    house = (ROOT / "virtual_lab" / "README.md").read_text("utf-8")
    named = [name for name in re.findall(r"`([\w./-]+/[\w./-]*)`", house) if "NAME" not in name]
    assert len(named) > 15
    for name in named:
        assert any((top / name).exists() for top in (ROOT, ROOT / "virtual_lab")), name


def test_the_coverage_table_matches_its_file() -> None:
    """Every row is printed; each 95 % interval contains the truth in about 94 % or more."""
    (path,) = (ROOT / "tests" / "studies").glob("coverage-*.csv")
    assert path.stem.removeprefix("coverage-") in STUDIES
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    # procedures with such a row: listed in the page; a user's own procedure needs none
    listed = re.findall(r"^\| ([\w-]+) \| (?:100000|99\d\d\d|20000) \|", STUDIES, re.MULTILINE)
    assert {row["procedure"] for row in rows} == set(listed)
    assert set(listed) <= set(catalog.names("procedures"))
    assert len(listed) >= 6
    ends = ("coverage", "coverage_low", "coverage_high")
    for row in rows:
        held, low, high = (f"{100 * float(row[key]):.1f}" for key in ends)
        # the result with the standard ball has the error of the formula, which u does not contain
        assert float(row["coverage_high"]) >= 0.94 or row["quantity"] == STANDARD_BALL, row
        if row["quantity"] in ("metric", "collision_efficiency"):
            assert f"| {held} % ({low} to {high}) |" in STUDIES
            assert f"| {row['laboratories']} |" in STUDIES


def test_the_tenths_match_their_file() -> None:
    """Single tests and tests with a history, in which no tenth of 1000 tests is below 90 %."""
    for kind, words in (("coverage", "alone"), ("history", "history")):
        (path,) = (ROOT / "tests" / "studies").glob(f"{kind}-*.csv")
        assert f"`tests/studies/{path.name}`" in STUDIES
        with path.open() as lines:
            rows = [row for row in csv.DictReader(lines) if row["quantity"] == "metric"]
        for row in (each for each in rows if each["coverage_by_u_1"]):
            by_u, by_dof = (
                [100 * float(row[f"coverage_by_{key}_{tenth}"]) for tenth in range(1, 11)]
                for key in ("u", "dof")
            )
            printed = [", ".join(f"{x:.0f}" for x in tenths) for tenths in (by_u, by_dof[::-1])]
            held = f"{100 * float(row['coverage']):.1f} %"
            start = f"| {row['procedure']}, {words} | {row['laboratories']} | {held} |"
            assert f"{start} {printed[0]} | {printed[1]} |" in STUDIES
            if kind == "history" and int(row["laboratories"]) > 10_000:
                assert min(by_u + by_dof) >= 90


def test_the_stated_standard_errors_are_those_of_the_tables() -> None:
    """Tenths of 100 000 and 20 000 laboratories, and the standard deviations of laboratories."""
    words = " ".join(STUDIES.split())
    worst = {}
    for kind in ("coverage", "history"):
        (path,) = (ROOT / "tests" / "studies").glob(f"{kind}-*.csv")
        with path.open() as lines:
            rows = [row for row in csv.DictReader(lines) if row["quantity"] == "metric"]
        variances = [
            float(row[key]) * (1 - float(row[key])) / (int(row["laboratories"]) / 10)
            for row in rows
            for key in row
            if key.startswith("coverage_by") and int(row["laboratories"]) > 10_000
        ]
        worst[kind] = f"{100 * max(variances) ** 0.5:.1f}".removeprefix("0")
    assert f"at most {worst['coverage']} % alone, and {worst['history']} % with a history" in words
    (path,) = (ROOT / "tests" / "studies").glob("interlab-2*.csv")
    with path.open() as lines:
        rows = [row for row in csv.DictReader(lines) if row["term"].startswith("s_")]
    s_R = {
        (row["bat"], row["procedure"], row["result"]): float(row["simulated"])
        for row in rows
        if row["term"] == "s_R"
    }
    shares: dict[str, list[float]] = {}
    for row in (each for each in rows if each["simulated_se"]):
        error, total = float(row["simulated_se"]), s_R[row["bat"], row["procedure"], row["result"]]
        own = row["term"] in ("s_r", "s_R")
        share = 100 * error / (float(row["simulated"]) if own else total)
        shares.setdefault("own" if own else row["term"], []).append(share)
    own, lot, laboratory = (max(shares[key]) for key in ("own", "s_lot", "s_L"))
    said = f"at most {own:.1f} % of the number, that of s_lot is at most {lot:.1f} % of s_R"
    assert f"{said} and that of s_L {laboratory:.1f} %" in words


def test_the_table_of_faults_matches_its_file() -> None:
    """The page states the number of detected faults and of flagged sound laboratories."""
    (path,) = (ROOT / "tests" / "studies").glob("faults-*.csv")
    assert f"`tests/studies/{path.name}`" in STUDIES
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    played = [row for row in rows if row["fault"] != "none"]
    caught = [row for row in played if float(row["detected"]) >= 0.95]
    by_rig = {
        procedure: sum(row["procedure"] == procedure for row in caught)
        for procedure in ("astm-f1881", "bbcor")
    }
    assert f"{by_rig['astm-f1881']} are caught" in STUDIES
    assert f"at the ball cannon {by_rig['bbcor']};" in STUDIES
    sound = [row for row in rows if row["fault"] == "none"]
    flagged = sum(round(float(row["detected"]) * int(row["laboratories"])) for row in sound)
    total = sum(int(row["laboratories"]) for row in sound)
    high = 100 * binomtest(flagged, total).proportion_ci().high
    words = f"of {total} sound laboratories {flagged} was flagged, .8 % (95 % interval 0 to"
    assert f"{words} {high:.1f} %" in " ".join(STUDIES.split())


def test_the_table_of_clips_matches_its_file() -> None:
    """Every interval contains the truth in about 94 % of the clips, within the sampling error."""
    (path,) = (ROOT / "tests" / "studies").glob("clips-*.csv")
    assert f"`tests/studies/{path.name}`" in STUDIES
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    assert [row["quantity"] for row in rows] == ["v_in", "v_out", "e_A"]
    ends = ("coverage", "coverage_low", "coverage_high")
    for row in rows:
        held, low, high = (f"{100 * float(row[key]):.1f}" for key in ends)
        assert float(row["coverage_high"]) >= 0.94, row
        start = f"| {row['quantity']} | {row['clips']} | {held} % ({low} to {high}) |"
        assert start in STUDIES, start


def test_the_table_of_draws_matches_its_file() -> None:
    (path,) = (ROOT / "tests" / "studies").glob("distributions-*.csv")
    assert f"`tests/studies/{path.name}`" in STUDIES
    with path.open() as lines:
        rows = list(csv.DictReader(lines))
    for row in rows:
        ends = ([float(row[f"{way}_{x}"]) for x in ("held", "low", "high")] for way in WAYS)
        held = " | ".join(f"{100 * a:.1f} % ({100 * b:.1f} to {100 * c:.1f})" for a, b, c in ends)
        apart = f"{row['only_first']}, {row['only_draws']} | {row['not_drawn']}"
        length = f"{float(row['length_ratio']):.2f}"
        line = f"| {row['procedure']} | {row['tests']} | {held} | {apart} | {length} |"
        assert line in STUDIES, line


def test_the_chart_table_matches_its_file() -> None:
    """The table has eleven points of the picture: errors to one digit, times to two."""
    with (ROOT / "data" / "figures" / "collision.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    points = set()
    for row in rows:
        time = float(f"{float(row['us_a_shot']):.2g}")
        points.add(f"{float(row['worst_error']):.0e} | {time:g}")
    table = FIDELITY.split("largest error | µs |\n|---|---|---|\n")[1].split("\n\n")[0].splitlines()
    assert len(table) == 11
    for line in table:
        assert line.split(" | ", 1)[1].removesuffix(" |") in points, line


def test_the_benchmark_table_matches_its_file() -> None:
    (path,) = (ROOT / "tests" / "benchmarks").glob("collision-*.txt")
    assert f"`tests/benchmarks/{path.name}`" in BENCHMARKS
    lines = [line.split() for line in path.read_text().splitlines()]
    table = BENCHMARKS.split(path.name)[1].split("|---|---|\n")[1].split("\n\n")[0].splitlines()
    assert len(table) > 8
    for row in table:
        what, value = (cell.split() for cell in row.strip("| ").split(" | "))
        matches = [line[len(what) :] for line in lines if line[: len(what)] == what]
        assert any(rest[: len(value)] == value for rest in matches), row


def cells(page: str, head: str) -> list[list[str]]:
    """Return the rows of the table below a header, without blanks between digits."""
    table = page.split(head)[1].partition("\n\n")[0].splitlines()[2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    return [[re.sub(r"(?<=\d) (?=\d)", "", cell) for cell in row] for row in rows]


def file_named_in(page: str, pattern: str) -> str:
    """Return the text of the only benchmark file of a pattern, which the page names."""
    (path,) = (ROOT / "tests" / "benchmarks").glob(pattern)
    assert f"`tests/benchmarks/{path.name}`" in page
    return path.read_text("utf-8")


def test_the_shots_per_second_match_their_file() -> None:
    lines = re.findall(
        r"  ([\w-]+), (.*?) +(\d+) (\S+).*", file_named_in(BENCHMARKS, "throughput-*")
    )
    stored = {(name, what): value for name, what, value, _ in lines}
    for name, summed, full in cells(BENCHMARKS, "| shots per second |"):
        assert (stored[name, "summed"], stored[name, "full"]) == (summed, full)
    a_second = dict(
        re.findall(
            r"  ([\w-]+), a certificate.* (\d+) a second", file_named_in(BENCHMARKS, "throughput-*")
        )
    )
    for name, normals, certificates in cells(BENCHMARKS, "| | random numbers per certificate |"):
        assert (stored[name, "a certificate, summed"], a_second[name]) == (normals, certificates)


def test_the_errors_of_located_balls_match_their_file() -> None:
    shots = re.findall(
        r"  (\w+): (.*?), e_A of a shot +([\d.]+) %", file_named_in(BENCHMARKS, "locating-*")
    )
    stored = {(light, method): float(error) for light, method, error in shots}
    for name, edge, _, hull in cells(BENCHMARKS, "| stitched ball, "):
        light = name.split()[0]
        for method, cell in (("edge fit", edge), ("convex hull", hull)):
            assert f"{stored[light, method]:.2g}" == f"{float(cell.rstrip(' %')):.2g}", name


def test_the_times_of_propagation_match_their_file() -> None:
    rows = list(csv.DictReader(file_named_in(BENCHMARKS, "uncertainty-*").splitlines()))
    stored = {row["what"]: row for row in rows}
    for name, first_order, draws, *errors in cells(BENCHMARKS, "| | first order, µs |"):
        program = (
            name.rpartition(" ")[0].replace("virtual lab", "ours").replace("OpenTURNS", "openturns")
        )
        if first_order:
            assert f"{float(stored[f'first order: {program}']['value']):.0f}" == first_order
        if draws:
            row = stored[f"2^20 draws of 11 inputs: {program}"]
            assert f"{float(row['value']):.3f}" == draws
            assert re.findall(r"[+-][\d.]+\d", row["note"])[:3] == errors
    for tolerance, *stein_and_gum in cells(BENCHMARKS, "| tolerance / u |"):
        for rule, met, draws in zip(
            ("stein", "7.9"), stein_and_gum[::2], stein_and_gum[1::2], strict=True
        ):
            row = stored[f"all met, tolerance {tolerance} u: {rule}"]
            assert (row["value"], float(row["note"].split()[0])) == (met, float(draws))


def test_the_times_of_the_rehearsal_bench_match_their_file() -> None:
    """Median and worst time of a row are adjacent in a line of the file."""
    lines = [line.split() for line in file_named_in(BENCHMARKS, "rehearsal-*").splitlines()]
    pairs = {pair for line in lines for pair in pairwise(line)}
    for name, median, worst, _ in cells(BENCHMARKS, "| ms | median |"):
        if "key" not in name and median:
            assert (median, worst) in pairs, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_states_a_ratio_of_speeds_in_a_sentence(page: Path) -> None:
    """Tables of speeds are compared with files; a ratio in a sentence would become outdated."""
    text = " ".join(page.read_text("utf-8").split())
    assert not re.findall(r"times (?:as (?:fast|slow)|faster|slower)", text)
