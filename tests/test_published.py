"""Published random figures agree with their second runs, and the pages with the table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests import published
from tests.published import ROOT, STUDIES, Row, Run, faults, read_rows, write_rows

ROWS = read_rows()
FIRST = Run(size=100, seed=1, value=0.5, error=0.01)
ROW = Row(
    study="s", figure="f", command="c", pages=(), form=".1%", alone=True, runs=(FIRST, FIRST, FIRST)
)


def row(z: float, third: float | None = None) -> Row:
    """Return a row whose second run is z standard errors away, and the third one, if any."""
    runs = [Run(size=100, seed=k, value=0.5 + x * 0.01 * 2**0.5, error=0.01) for k, x in ((2, z),)]
    last = Run(size=100, seed=3)
    if third is not None:
        last = replace(last, value=0.5 + third * 0.01 * 2**0.5, error=0.01)
    return replace(ROW, runs=(FIRST, *runs, last))


def test_stored_figures_agree_with_their_second_runs() -> None:
    assert faults(ROWS) == []


def test_every_row_can_be_run_and_has_three_seeds() -> None:
    """All rows of a study have its seeds; no two studies share their later seeds."""
    assert {each.study for each in ROWS} == set(STUDIES)
    assert len({(each.study, each.figure) for each in ROWS}) == len(ROWS)
    seeds = {each.study: tuple(run.seed for run in each.runs) for each in ROWS}
    assert all(tuple(run.seed for run in each.runs) == seeds[each.study] for each in ROWS)
    later = [seed for of_study in seeds.values() for seed in of_study[1:]]
    assert len(set(later)) == len(later)
    assert all(each.command and each.runs[0].error for each in ROWS)


@pytest.mark.parametrize("name", [name for name in STUDIES if name.startswith("coverage")])
def test_figures_of_a_stored_table_are_those_of_its_file(name: str) -> None:
    """After a new table of coverage: `python -m tests.published renew "NAME OF THE STUDY"`."""
    of_file = STUDIES[name](1, 0)
    for each in (each for each in ROWS if each.study == name):
        numbers = (each.runs[0].value, each.runs[0].error)
        assert numbers == pytest.approx(of_file[each.figure], rel=1e-5), (
            name,
            "is outdated: renew",
        )


@pytest.mark.parametrize("each", [row for row in ROWS if row.pages], ids=lambda row: row.figure)
def test_pages_state_the_figures_of_the_table(each: Row) -> None:
    for page in each.pages:
        text = " ".join((ROOT / page).read_text("utf-8").split())
        assert each.printed in text, (page, each.printed)


@pytest.mark.parametrize(
    ("rows", "fault"),
    [
        ([row(1.0)], None),
        ([row(2.9), *[row(1.3)] * 9], "sum of z²"),
        ([row(0.01)] * 8, "sum of z²"),  # too good: not independent, or errors too large
        ([row(3.1), *[row(0.7)] * 9], "the third run is missing"),
        ([row(3.1, 0.5), *[row(0.7)] * 9], None),
        ([row(3.1, 3.2), *[row(0.7)] * 9], "the third run is +3.2"),
        ([row(-4.1, 0.0), *[row(0.7)] * 9], "the second run is -4.1"),
        ([replace(ROW, runs=(FIRST, Run(size=1, seed=2), Run(size=1, seed=3)))], None),
    ],
)
def test_the_check_can_fail(rows: list[Row], fault: str | None) -> None:
    """By hand: z of each row, and the chi-square range of their sum (10 figures: 3.2 to 20.5)."""
    found = faults(rows)
    if fault is None:
        assert found == []
    else:
        assert any(fault in each for each in found), found


def test_a_percentage_and_a_number_are_printed_with_half_their_interval() -> None:
    assert replace(ROW, form=".1%").printed == "50.0 ± 2.0 %"
    assert replace(ROW, form=".3f").printed == "0.500 ± 0.020"


def test_renewing_replaces_figures_in_table_and_pages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second run is removed, and its new seed is larger than all seeds before."""
    monkeypatch.setattr(published, "ROOT", tmp_path)
    monkeypatch.setattr(published, "TABLE", tmp_path / "table.csv")
    monkeypatch.setattr(
        published, "write_rows", lambda rows: write_rows(rows, tmp_path / "table.csv")
    )
    monkeypatch.setattr(published, "read_rows", lambda: read_rows(tmp_path / "table.csv"))
    monkeypatch.setitem(STUDIES, "s", lambda seed, size: {"f": (0.4 + seed / 100, 1 / size)})
    (tmp_path / "page.md").write_text("passes with 50.0 ± 2.0 % of all")
    write_rows([replace(row(1.5, 0.2), pages=("page.md",))], tmp_path / "table.csv")
    published.renew([])
    assert (tmp_path / "page.md").read_text() == "passes with 41.0 ± 2.0 % of all"
    (renewed,) = read_rows(tmp_path / "table.csv")
    assert [run.seed for run in renewed.runs] == [1, 4, 5]
    assert [run.value for run in renewed.runs] == [pytest.approx(0.41), None, None]


def test_shares_have_the_scatter_of_their_standard_error() -> None:
    rng = np.random.default_rng(1)
    for p in (0.5, 0.02):
        counts = rng.binomial(400, p, 4000)
        values, errors = np.transpose([published.share(float(count), 400) for count in counts])
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(values.std(), rel=0.06)
