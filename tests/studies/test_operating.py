"""The operating characteristic: counts of the same tests, and three tests of a laboratory."""

import csv
from pathlib import Path

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab.output.progress import quiet

LABORATORIES = 40
TIGHT = vl.procedure("astm-f1881").with_(attempts=6)  # one rejected hit makes a test INVALID


@pytest.fixture(scope="module")
def found() -> object:
    more = vl.procedure("astm-f1881").with_(valid_hits=24, attempts=72)
    return vl.operating(
        "r161", procedures=[TIGHT, more], laboratories=LABORATORIES, seed=3, progress=quiet
    )


def curve(found, best_of: int, procedure: str = TIGHT.name) -> list:
    return [row for row in found if (row.best_of, row.procedure) == (best_of, procedure)]


def test_one_test_is_a_count_of_a_sweep(found) -> None:
    """In the same laboratories, tests pass if their error is below the distance to the limit."""
    tests = vl.sweep("r161", procedures=[TIGHT], laboratories=LABORATORIES, seed=3, progress=quiet)
    valid = tests["verdict"] != "INVALID"
    rows = curve(found, 1)
    assert len(rows) == 21
    assert 0 < valid.sum() < LABORATORIES
    for row in rows:
        passed = (valid & (row.true + tests["error"] <= 1.2)).sum()
        assert row.pass_probability == pytest.approx(passed / LABORATORIES)
        assert row.pass_probability_if_valid == pytest.approx(passed / valid.sum())
        assert row.pass_probability_low <= row.pass_probability <= row.pass_probability_high
    chances = [row.pass_probability for row in rows]
    assert chances == sorted(chances, reverse=True)
    assert 1.2 - rows[0].true == pytest.approx(rows[-1].true - 1.2)


def test_the_text_answers_for_a_bat_at_the_limit(found) -> None:
    """The probabilities are those of the rows at 1.2; a stricter limit lets 5 % of tests pass."""
    answer = found.text.split("A bat at the limit of ")[1]
    one, best = (curve(found, n)[10] for n in (1, 3))
    assert one.true == best.true == 1.2
    assert answer.startswith(f"{TIGHT.name}, BPF 1.2, passes with a probability of")
    assert f"{one.pass_probability:.1%}  in one test\n" in answer
    assert f"{best.pass_probability:.1%}  in the best of three tests of one laboratory" in answer
    assert f"{1 - (1 - one.pass_probability) ** 3:.1%}  in the best of three laboratories" in answer
    strict, stricter = found.acceptance_limits[TIGHT.name]
    assert f"the limit of acceptance is {strict:.4f}" in answer
    assert f"if it is {stricter:.4f}" in answer
    assert stricter < strict < 1.2


def test_a_bat_at_the_limit_passes_the_stricter_limit_with_the_stated_risk() -> None:
    """Other laboratories accept such a bat with 5 %, and with 5 % if the best of three counts."""
    stated = vl.operating("r161", laboratories=400, seed=3, progress=quiet)
    tests = vl.sweep("r161", laboratories=1500, seed=4, progress=quiet)
    for limit, risk in zip(stated.acceptance_limits["astm-f1881"], (0.05, 0.017), strict=True):
        accepted = (1.2 + tests["error"] <= limit).mean()
        assert accepted == pytest.approx(risk, abs=0.4 * risk)


def test_the_best_of_three_passes_more(found) -> None:
    one, three = (np.array([row.pass_probability for row in curve(found, n)]) for n in (1, 3))
    assert np.all(three >= one)
    middle = slice(8, 12)
    assert np.all(three[middle] > one[middle] + 0.1)


def test_more_hits_make_the_curve_steeper(found) -> None:
    few, many = (curve(found, 1, name) for name in dict.fromkeys(row.procedure for row in found))
    width = [rows[-1].true - rows[0].true for rows in (few, many)]
    assert width[1] < 0.75 * width[0]
    assert "at least one of three tests" in found.text
    assert "joint" in found.text
    assert "conditional" in found.text


def test_picture_and_table_are_saved(found, tmp_path: Path) -> None:
    found.save(tmp_path / "out")
    assert (tmp_path / "out" / "operating.png").read_bytes().startswith(b"\x89PNG")
    assert len(found.table) == 84
    assert list(found.limits.values()) == [1.2, 1.2]


def test_a_procedure_without_a_limit_is_refused() -> None:
    with pytest.raises(vl.InputError, match="has no limit"):
        vl.operating("r161", procedures=["proposed"], laboratories=1, progress=quiet)
    with pytest.raises(vl.InputError, match="laboratories = 0"):
        vl.operating("r161", laboratories=0, progress=quiet)


def test_counted_bats_agree_with_their_predictions() -> None:
    """At least 17 of 20 predictions lie in the 95 % band of the counts."""
    (path,) = Path(__file__).parent.glob("operating-*.csv")
    rows = list(csv.DictReader(path.read_text("utf-8").splitlines()))
    inside = [float(row["low"]) <= float(row["predicted"]) <= float(row["high"]) for row in rows]
    assert len(rows) == 20
    assert sum(inside) >= 17


def test_the_limit_applies_to_an_exempt_bat_which_the_text_says() -> None:
    curves = vl.operating("r161", procedures="bbcor", laboratories=3, progress=quiet)
    assert "r161 by bbcor: no test required: one-piece wood" in curves.text
    assert {row.true > 0.5 for row in curves} == {True, False}
