"""Forty kills lose nothing; other tests of the suite kill fewer processes."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import virtual_lab as vl
from tests.campaigns.kills import KILLS, STUDY, killed

TABLE = Path(__file__).parent / "kills-2026-11-25.csv"


@pytest.mark.long
@pytest.mark.parametrize("kind", KILLS)
def test_kills_lose_nothing(kind: str, tmp_path: Path) -> None:
    vl.campaign(STUDY, tmp_path / "whole")
    row = killed(kind, KILLS[kind], tmp_path / "whole", tmp_path / "killed")
    assert (row.equal_parts, row.other_parts) == (STUDY["repeats"], 0)
    assert (row.strays, row.orphans) == (0, 0)


def test_the_table_on_file_is_of_forty_kills() -> None:
    rows = list(csv.DictReader(TABLE.read_text("utf-8").splitlines()))
    assert {row["kind"]: int(row["kills"]) for row in rows} == KILLS
    for row in rows:
        assert row["equal_parts"] == str(STUDY["repeats"])
        assert (row["other_parts"], row["strays"], row["orphans"]) == ("0", "0", "0")
