"""Verdicts agree with the records: the stored tables, and some of their rows repeated."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import virtual_lab
from tests.laboratories import certified, certify
from tests.studies.verdicts import (
    BATS,
    ENOUGH,
    Fields,
    changed,
    late,
    reduced,
    row,
    sector,
    slip,
)
from virtual_lab import catalog
from virtual_lab.simulation.instruments import RecordDetail

HERE = Path(__file__).parent
BLOCKS = HERE / "verdicts-blocks-2026-11-26.csv"
WALL = HERE.parent / "foreign_laboratory" / "wall-2026-11-26.csv"
SOUND, CASES = (HERE / f"verdicts-{name}-2026-11-25.csv" for name in ("sound", "cases"))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_sound_laboratories_are_as_rarely_contradicted_as_chance_says() -> None:
    """For each procedure none is INVALID, and no pair's p-value is below .1 or .01 too often.

    The bound is exceeded by chance in one study of 1000.
    """
    table = rows(SOUND)
    assert {each["procedure"] for each in table} == BATS.keys()
    for each in table:
        n = int(each["laboratories"])
        assert int(each["INVALID"]) == 0
        for chance in (0.1, 0.01):
            assert int(each[f"below {chance:.2g}".replace("0.", ".")]) <= binom.ppf(
                ENOUGH, n, chance
            )


def test_blocks_of_sound_laboratories_are_invalid_no_more_often_than_one_of_ten_thousand() -> None:
    """For all checks together; the bound is exceeded by chance in one study of 1000.

    Less than one laboratory of a hundred has any flag.
    """
    table = [each for each in rows(BLOCKS) if each["check"] == "any"]
    assert {each["procedure"] for each in table} == BATS.keys()
    laboratories, flagged, invalid = (
        sum(int(each[name]) for each in table) for name in ("laboratories", "flagged", "INVALID")
    )
    assert invalid <= binom.ppf(ENOUGH, laboratories, 1e-4)
    assert flagged < 0.01 * laboratories


def test_another_laboratorys_wall_gives_the_e0_of_its_balls() -> None:
    """At least as many 95 % intervals hold the truth as in 999 of 1000 studies."""
    for each in rows(WALL):
        assert int(each["held"]) >= binom.ppf(1 - ENOUGH, int(each["laboratories"]), 0.95)


def test_no_verdict_stands_against_its_own_records() -> None:
    """If a difference exceeds 6 of its u, no verdict in the stored cases is wrong by 3 u."""
    for each in rows(CASES):
        assert each["contradicted"] == "0", each
        judged = int(each["INVALID"]) + int(each["remark"]) + int(each["silent"])
        assert judged == int(each["laboratories"])


@pytest.mark.parametrize("delay", [3, 5, 10, 20, -3, -5, -10, -20])
def test_separate_triggers_leave_no_verdict(delay: int) -> None:
    """In all stored cases: three milliseconds or more, early or late."""
    found = [each for each in rows(CASES) if each["case"] == f"trigger {delay:+g} ms"]
    assert found
    for each in found:
        assert each["INVALID"] == each["laboratories"]


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        (None, "PASS"),
        (partial(late, 5.0), "INVALID"),
        (partial(slip, 5, 30, 1.0), "INVALID"),
        (partial(sector, 10), "INVALID"),
    ],
)
def test_an_altered_record_is_flagged(change: partial[Fields] | None, verdict: str) -> None:
    test = certified("r161", procedure="astm-f1881", seed=300)
    session = test.certification.session
    if change:
        fields = change(session.records["impact"]["encoder"], np.random.default_rng(2))
        session = changed(session, "encoder", fields)
    found = row(reduced(session), test.sealed.measurand["metric"])
    assert found["verdict"] == verdict
    assert (found["flags"] == "" and found["misfits"] == 0) is (change is None)


def test_a_recorder_that_sums_up_stops_where_the_bat_does() -> None:
    """At 75 mph the bat turns 170 degrees in about 110 ms; the recorder fits 2.3 ms less.

    Its u is that of the slope of a cubic through n whole counts, a gap g before a span T: with
    Legendre's polynomials √(Σ (2k + 1) P_k'² / n / 12) 2/T at 1 + 2 g/T.
    """
    sheet = virtual_lab.procedure("asa").with_(ball_speed=75)
    with catalog.sheets_in_place({("procedures", sheet.name): sheet.text}):
        found = certify("softball-34", procedure=sheet.name, seed=1, detail=RecordDetail.SUMMED)
    record = found.certification.session.records["impact"]["encoder"]
    span = np.radians(170) / (2 * np.pi * record.rate / 10_000) - 2.3e-3
    assert np.all(span < 0.115)
    at = 1 + 2 * 2.3e-3 / span
    slopes = 3 * 1**2 + 5 * (3 * at) ** 2 + 7 * ((15 * at**2 - 3) / 2) ** 2
    u = np.sqrt(slopes / (span * 10_000) / 12) * 2 / span
    assert record.rate_u == pytest.approx(u, rel=2e-3)
