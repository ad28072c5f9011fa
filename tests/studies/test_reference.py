"""Published numbers: one test each, and the rules by which a row agrees."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest

from tests.studies.reference import results
from tests.studies.reference.comparing import FINDERS, compare_number
from tests.studies.reference.published import Published, read_published
from virtual_lab.errors import InputError

SLOW = ("hoop_trend", "length_trend", "best_wood")  # about a second each
ROOT = Path(__file__).parents[2]
REPRESENTED = [row for row in read_published() if row.role != "none"]


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, id=row.quantity, marks=[pytest.mark.long] * row.find.startswith(SLOW))
        for row in REPRESENTED
    ],
)
def test_the_row_agrees_or_its_disagreement_is_known(row: Published) -> None:
    ours = compare_number(row)
    allowed = ("too wide to decide",) if row.role == "wide" else ("agrees", "known disagreement")
    assert ours.agreement in allowed, ours


def test_enough_rows_are_represented_and_few_are_inputs_of_a_fit() -> None:
    roles = Counter(row.role for row in read_published())
    assert len(REPRESENTED) >= 60
    assert roles["fit"] <= 33
    assert roles["prediction"] >= 29
    assert len(read_published()) == 144
    assert len({(row.quantity, row.value) for row in read_published()}) == 144


def test_a_prediction_with_a_range_of_our_own_could_have_failed() -> None:
    """Half of a range that we set ourselves is below 40 % of the published number.

    Exempt are words, upper limits, and standard deviations with their 95 % interval.
    """
    for row in REPRESENTED:
        upper_limit = row.quantity.endswith("less than")
        if row.role != "prediction" or row.u is not None or upper_limit or row.known is not None:
            continue
        published, half = max(map(abs, row.ends)), (row.high - row.low) / 2
        assert half < 0.4 * published or "95 % interval of a standard dev" in row.why, row.quantity


def test_what_a_constant_was_fitted_to_is_no_prediction() -> None:
    """The standard ball, the stiffness of the balls, and the hoop mode of EA70."""
    roles = {row.quantity: row.role for row in read_published()}
    assert roles["BBCOR limit, compared with wood bat R161"] == "fit"
    assert roles["BBCOR wood RW01 unmodified"] == "fit"
    assert roles["batted-ball speed, aluminum bats before 2001 minus wood"] == "fit"
    for quantity in ("contact time", "e_A, many bats", "e_A of many bats at the speeds of tests"):
        assert roles[quantity] == "wide"


def test_few_published_measurements_with_u_disagree() -> None:
    with_u = [row for row in REPRESENTED if row.u is not None]
    assert len(with_u) == 7
    assert sum(row.known is not None for row in with_u) <= 5


def test_every_row_says_what_it_is() -> None:
    used = {row.find.split()[0] for row in REPRESENTED}
    assert used == set(FINDERS)
    for row in read_published():
        assert bool(row.find) == (row.role != "none"), row.quantity
        assert row.why or row.role == "data", row.quantity
        assert row.low < row.high or row.role == "none", row.quantity
        assert row.source
        assert row.reading


def test_the_page_has_the_counts_and_every_known_disagreement() -> None:
    page = (ROOT / "virtual_lab" / "docs" / "studies" / "published.md").read_text("utf-8")
    section = page.partition("# Published measurements")[2].partition("\n## ")[0]
    words = " ".join(section.split())
    roles = Counter(row.role for row in read_published())
    assert f"{len(REPRESENTED)} are represented: {roles['prediction']} are predicted" in words
    assert f"{roles['wide']} have a range too wide to decide" in words
    assert f"{roles['data']} are numbers of our data files" in words
    assert f"to {roles['fit']} a constant was fitted" in words
    rows = re.findall(r"^\| (?!known|-)", section, flags=re.MULTILINE)
    assert len(rows) == sum(row.known is not None for row in read_published())


MEASURED = Published(
    quantity="mass",
    value="10",
    unit="oz",
    u=0.5,
    conditions="",
    source="made up",
    address="",
    reading="",
    role="prediction",
    find="result",
    low=9.0,
    high=11.0,
    known=None,
    why="",
)
RANGE = replace(MEASURED, value="8 to 12", u=None, low=8.0, high=12.0)


@pytest.mark.parametrize(
    ("row", "result", "difference", "in_u", "verdict"),
    [
        (MEASURED, 10.9, 0.9, 1.8, "agrees"),
        (MEASURED, 11.1, 1.1, 2.2, "DISAGREES"),
        (MEASURED, nan, nan, nan, "DISAGREES"),
        (replace(MEASURED, known=1.2), 11.1, 1.1, 2.2, "known disagreement"),
        (replace(MEASURED, known=1.6), 11.1, 1.1, 2.2, "DISAGREES"),  # it has changed
        (replace(MEASURED, known=-1.1), 11.1, 1.1, 2.2, "DISAGREES"),  # to the other side
        (replace(MEASURED, known=1.0), 10.9, 0.9, 1.8, "DISAGREES"),  # it has gone
        (replace(MEASURED, known=1.0), nan, nan, nan, "DISAGREES"),
        (RANGE, 9.0, 0.0, None, "agrees"),
        (RANGE, 7.5, -0.5, None, "DISAGREES"),
        (RANGE, 12.5, 0.5, None, "DISAGREES"),
        (replace(RANGE, value="less", low=-inf), -1e9, 0.0, None, "agrees"),
        (replace(RANGE, role="wide"), 9.0, 0.0, None, "too wide to decide"),
        (replace(RANGE, role="wide"), 7.5, -0.5, None, "DISAGREES"),
    ],
)
def test_a_result_outside_its_range_disagrees_unless_the_size_is_known(
    row: Published,
    result: float,
    difference: float,
    in_u: float | None,
    verdict: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(FINDERS, "result", lambda: result)
    ours = compare_number(row)
    assert ours.difference == pytest.approx(difference, nan_ok=True)
    assert ours.difference_in_u == (None if in_u is None else pytest.approx(in_u, nan_ok=True))
    assert ours.agreement == verdict


def test_the_range_of_a_row_follows_from_u_range_or_file() -> None:
    rows = {row.quantity: row for row in read_published()}
    bbcor = rows["BBCOR wood RW01 unmodified"]
    assert (bbcor.low, bbcor.high) == pytest.approx((0.4898 - 0.0042, 0.4898 + 0.0042))
    places = rows["BBCOR: places near the maximum of most bats"]
    assert (places.low, places.high) == (6.0, 6.5)
    capability = rows["BBCOR: cannon capability"]
    assert (capability.low, capability.high) == (150.0, inf)
    assert rows["Russell's bat 1: weight"].high == pytest.approx(31.2 * 1.001)


def test_inertia_and_speeds_by_hand() -> None:
    """R161 by Table I of the paper, 2539 oz in^2 and 31 oz 11.3 in from the tip; a wall in ft/s."""
    pivot, knob = (2539 + 31 * (34 - axis - 11.3) ** 2 for axis in (6, 0))
    assert results.pivot_inertia("r161") == pytest.approx(pivot, rel=2e-3)
    assert results.inertia_ratio("r161") == pytest.approx(knob / pivot, rel=2e-3)
    assert results.restitution_on_wall("baseball-2003", 85) == pytest.approx(
        0.55 - 0.001 * (85 * 0.3048 / 0.44704 - 60)
    )
    assert results.limit_in_feet_per_second("asa") == pytest.approx(85 * 5280 / 3600)
    # swing by n = 0: the same angular speed, so that the metal bat is slower by its length
    assert results.cage_speed(0.0) == pytest.approx(67.9 * (33 - 7) / (34 - 7))


def test_the_nearest_of_three_gates() -> None:
    """As surveyed: 0.5002, 0.3499 and 0.2001 m."""
    assert results.nearest_gate("light-boards") == pytest.approx(0.2001 / 0.3048)


@pytest.mark.parametrize("mode", [-1, 0, 99])
def test_a_mode_that_the_model_does_not_have_is_refused(mode: int) -> None:
    for find in (results.frequency, results.node):
        with pytest.raises(InputError, match=f"mode = {mode}; allowed: 1 to"):
            find("r161", mode)


def test_above_4_khz_the_peak_no_longer_follows_the_hoop_frequency() -> None:
    """It falls up to 4 kHz and then rises by .006 at most, as the page on limits states."""
    bat = results.body("ea70")
    assert bat.hoop is not None
    tops = [
        results._restitution_peak(replace(bat, hoop=replace(bat.hoop, frequency=hertz)), 136).value
        for hertz in np.arange(1000.0, 7001.0, 250.0)
    ]
    steps = np.diff(tops)
    assert (steps[:12] < 0).all()
    assert max(tops[12:]) - tops[12] == pytest.approx(0.006, abs=0.0015)
