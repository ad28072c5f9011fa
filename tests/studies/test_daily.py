"""Mornings of a laboratory: results of the check ball, and detection of a loose wall."""

from __future__ import annotations

import csv
import json
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.studies.daily import daily

HIT = 0.0037 / sqrt(10)  # standard deviation of the mean of ten hits, data/balls/check-ball.toml


def test_days_in_control_scatter_as_ten_hits_do() -> None:
    """300 days: the mean is within 5 standard deviations of the drawn ball (0.004 of 0.55)."""
    played = daily(days=300, baseline=299)
    assert abs(played.values.mean() - 0.55) < 5 * 0.004
    assert 0.85 * HIT < played.values.std(ddof=1) < 1.25 * HIT
    assert played.charted.baseline.sigma == pytest.approx(played.values.std(ddof=1), rel=0.15)
    neighbours = np.corrcoef(played.values[1:], played.values[:-1])[0, 1]
    assert abs(neighbours) < 4 / sqrt(300)


def test_a_wall_that_gives_way_lowers_e0_by_its_restitution() -> None:
    """The same laboratory at both walls: the ratio is that of the walls, to the timer's steps."""
    fast, loose = (daily(days=40, step=step, since=31) for step in (0.0, 0.1))
    assert np.array_equal(loose.values[:30], fast.values[:30])
    assert loose.values[30:] / fast.values[30:] == pytest.approx(0.9, rel=1e-3)
    assert loose.wall.tolist() == [1.0] * 30 + [0.9] * 10


def test_a_drift_grows_from_day_to_day() -> None:
    """From day 31 the drift is 0.001 per day: 0.01 after ten days."""
    played = daily(days=40, drift=0.001, since=31)
    assert played.wall[[29, 30, 39]] == pytest.approx([1, 0.999, 0.99], rel=1e-12)


def test_a_large_step_is_detected_after_the_length_of_each_pattern() -> None:
    """For a step beyond ten standard deviations, the delay is the length of each pattern."""
    played = daily(step=0.03, seed=3)
    assert played.since == 26
    rows = {row.rule: row for row in played.alarms}
    assert {name: row.delay_days for name, row in rows.items()} == {
        "1 day beyond 3 sigma": 0,
        "2 of 3 days beyond 2 sigma": 1,
        "4 of 5 days beyond 1 sigma": 3,
        "8 days on one side": 7,
        "moving range": 0,
        "moving average (EWMA)": 0,
        "cumulative sum (CUSUM)": 0,
    }
    assert rows["8 days on one side"].first_alarm_day == 33
    assert rows["8 days on one side"].earlier_alarms == 0


def test_alarms_before_the_change_are_counted_apart() -> None:
    """If the change is on the last day, all other days precede it."""
    late = daily(step=0.03, since=60, seed=3)
    rows = {row.rule: row for row in late.alarms}
    flags = late.charted.alarms["1 day beyond 3 sigma"]
    assert rows["1 day beyond 3 sigma"].delay_days == 0
    assert rows["1 day beyond 3 sigma"].earlier_alarms == int(flags.sum()) - 1
    assert rows["moving range"].delay_days == 0
    assert rows["8 days on one side"].delay_days is None


def test_the_e0_of_a_check_ball_falls_by_its_daily_loss() -> None:
    """Ten hits per day with the loss of the sheet; the recovering share is back by morning."""
    ageing = catalog.load("balls", "softball-slowpitch", BallSpec).spec.ageing
    daily_loss = 10 * ageing.loss * (1 - ageing.recovering)
    played = daily(ball="softball-slowpitch", days=101, baseline=100)
    slope = np.polyfit(np.arange(101), played.values, 1)[0]
    assert slope == pytest.approx(-daily_loss, rel=0.05)  # standard error 0.7 %


def test_the_first_days_do_not_depend_on_the_number_of_days() -> None:
    """The first days do not depend on the number of days, but on the seed."""
    short, long = daily(days=30), daily(days=60)
    assert np.array_equal(short.values, long.values[:30])
    assert len(set(long.values)) == 60
    assert not set(daily(days=30, seed=2).values) & set(short.values)


def test_the_study_saves_table_and_charts(tmp_path: Path) -> None:
    """The study writes days as CSV, charts as PNG, and one JSON document."""
    played = daily(drift=0.001)
    played.save(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "daily.csv",
        "daily.png",
        "cylinder.png",
    }
    for name in ("daily.png", "cylinder.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "out" / "daily.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["day"]) for row in rows] == list(range(1, 61))
    assert [row["ewma"] == "" for row in rows] == [True] * 25 + [False] * 35
    document = json.loads(json.dumps(played.document, allow_nan=False))
    assert len(document["alarms"]) == 7
    for rule in document["alarms"]:
        flagged = [day["day"] for day in document["days"] if rule["rule"] in day["alarms"]]
        assert rule["first_alarm_day"] == (flagged[0] if flagged else None)


def test_a_calm_laboratory_is_drawn_too(tmp_path: Path) -> None:
    played = daily(days=26)
    assert played.since is None
    assert [row.first_alarm_day for row in played.alarms] == [None] * 7
    played.save(tmp_path / "out")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"days": 5}, "days = 5; allowed: one whole number from 6 to"),
        ({"days": 60, "baseline": 60}, "baseline = 60; allowed: 5 to 59, fewer than the days"),
        ({"hits": 1}, "hits = 1; allowed: one whole number from 2 to"),
        ({"since": 61}, "since = 61; allowed: 1 to 60"),
        ({"step": -0.1}, "step = -0.1; allowed: a number, at least 0 and below 1"),
        ({"drift": float("nan")}, "drift = nan; allowed: a number, at least 0"),
        ({"drift": 0.05}, "all 60 days"),
        ({"step": 0.9}, "day = 26; the gates did not detect"),
        ({"ball": "check-bal"}, "did you mean check-ball"),
    ],
)
def test_impossible_options_are_refused(asked: dict, said: str) -> None:
    with pytest.raises(InputError) as caught:
        vl.daily(**asked)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
