"""Rankings of the paper's bats by procedures (its Sec. V), and their probability by hand."""

from math import erf, nan, sqrt
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import virtual_lab as vl
from virtual_lab.errors import InputError
from virtual_lab.studies import critique as study
from virtual_lab.studies.critique import Critique, Pair, ProcedureResults, critique, misranking

BATS = ("r161", "ea70", "barrel-loaded", "knob-loaded")


@pytest.fixture(scope="module")
def paper() -> Critique:
    return critique(
        BATS, procedures=("astm-f1881", "ncaa-modified", "proposed"), laboratories=2, seed=11
    )


def row(found: Critique, first: str, second: str, n: float, procedure: str) -> Pair:
    """Return the row of a pair."""
    asked = (first, second, n, procedure)
    keys = ("bat", "against", "swing_exponent", "procedure")
    return next(each for each in found.pairs if tuple(getattr(each, key) for key in keys) == asked)


def made_up(*measured: tuple[float, float], field: float = 3.0) -> Critique:
    """Return a critique of two invented bats by one procedure."""
    return Critique(
        bats=("a", "b"),
        swings=(0.0,),
        balls={"a": "ball", "b": "ball"},
        field=np.array([[100.0 + field, 100.0]]),
        ranked=(
            ProcedureResults(
                procedure="p",
                ball="ball",
                metric="v_f",
                unit="mph",
                swing_exponent=None,
                exact=np.array([90.0, 91.0]),
                measured=np.array(measured),
            ),
        ),
    )


@pytest.mark.parametrize("n", [0.0, 0.3, 0.5])
def test_the_pivot_test_prefers_the_bat_that_loses_in_the_field(paper: Critique, n: float) -> None:
    """Sec. IV: nearly equal BPF, yet the barrel-loaded bat is the better for all n < 0.5.

    At n = .5 both are equal within .1 mph.
    """
    found = row(paper, "barrel-loaded", "knob-loaded", n, "astm-f1881")
    assert found.batted_speed_difference_mph > (-0.1 if n == 0.5 else 0.2)
    assert -0.015 < found.error_free_difference < 0


def test_a_test_at_one_bat_speed_prefers_wood(paper: Critique) -> None:
    """Sec. IV: at n = 0 one "would incorrectly conclude that" wood outperforms aluminum."""
    for n, least in ((0.3, 3), (0.5, 5)):
        found = row(paper, "r161", "ea70", n, "ncaa-modified")
        assert found.batted_speed_difference_mph < -least
        assert found.error_free_difference > 0


def test_the_proposal_ranks_as_the_field_of_its_own_exponent(paper: Critique) -> None:
    """Sec. V A: every pair is right for n = 0.3, without errors and in every laboratory."""
    own = [
        each for each in paper.pairs if (each.procedure, each.swing_exponent) == ("proposed", 0.3)
    ]
    assert len(own) == 6
    for each in own:
        assert each.procedure_swing_exponent == 0.3
        assert each.error_free_difference * each.batted_speed_difference_mph > 0
        assert each.ranking.opposite == 0


def test_the_proposed_metric_agrees_with_the_field(paper: Critique) -> None:
    """The proposal's v_f equals the field's within 0.1 mph and four u, 0.16 mph."""
    for each in paper.metrics:
        if each.procedure == "proposed":
            peak = each.batted_speeds["batted_speed_n0.3_mph"]
            assert each.error_free == pytest.approx(peak, abs=0.1 + 4 * 0.16 / sqrt(2))
        assert each.laboratories == 2


def test_only_procedures_of_the_same_sport_are_compared() -> None:
    assert study._of_this_game({"baseball"}) == [
        "astm-f1881",
        "bbcor",
        "ncaa-besr",
        "ncaa-modified",
        "proposed",
    ]
    assert study._of_this_game({"softball"}) == ["asa"]
    assert len(study._of_this_game({"baseball", "softball"})) == 6
    assert len(study._of_this_game({None})) == 6


def test_probability_is_the_normal_laws() -> None:
    """Differences 1, 2, 3 have mean 2 and s 1; the field ranks them below 0, so P = Φ(2)."""
    found = misranking(-4.0, np.array([1.0, 2.0, 3.0]))
    assert found.opposite_probability == pytest.approx((1 + erf(2 / sqrt(2))) / 2, rel=1e-12)
    assert (found.mean_difference, found.sd_difference, found.opposite) == pytest.approx((2, 1, 3))
    assert found.ranking == "opposite order"
    assert misranking(4.0, np.array([1.0, 2.0, 3.0])).ranking == "same order"


def test_counted_share_is_clopper_and_pearsons() -> None:
    """None of 20: 1 - 0.025^(1/20). Differences without a result are not counted."""
    found = misranking(1.0, np.append(np.linspace(1, 2, 20), nan))
    assert found.laboratories == 20
    assert (found.opposite, found.opposite_low) == (0, 0)
    assert found.opposite_high == pytest.approx(1 - 0.025 ** (1 / 20), rel=1e-9)


@pytest.mark.parametrize(
    ("field", "differences", "ranking"),
    [
        (1.0, [-1.0, 1.0, 0.5], "by chance"),
        (0.09, [1.0, 1.1, 1.2], "tie"),
        (-0.09, [1.0, 1.1, 1.2], "tie"),
        (0.11, [1.0, 1.1, 1.2], "same order"),
        (1.0, [1.0, nan, nan], "no result"),
        (1.0, [2.0, 2.0], "same order"),
        (1.0, [-2.0, -2.0], "opposite order"),
    ],
)
def test_the_verdict_on_a_ranking_follows_its_differences(
    field: float, differences: list[float], ranking: str
) -> None:
    assert misranking(field, np.array(differences)).ranking == ranking


def test_a_procedure_without_a_result_is_said_to_have_none(tmp_path: Path) -> None:
    found = made_up((nan, 1.0), (nan, 2.0))
    said = found.text
    assert "no result" in said
    found.save(tmp_path / "out")
    pairs = pd.read_csv(tmp_path / "out" / "pairs.csv")
    assert pairs["ranking"].tolist() == ["no result"]


def test_the_text_ranks_from_the_greatest_down() -> None:
    found = made_up((90.0, 91.0), (90.1, 91.3))
    said = found.text
    assert "103.0 (46.0): 1" in said
    assert "v_f 90.00 mph (40.23 m/s): 2" in said
    assert "+3.00 mph (+1.34 m/s)" in said
    assert "opposite order 100.0% (15.8% to 100.0%)" in said  # 2 of 2: from .025^(1/2)


def test_the_folder_holds_tables_and_picture(paper: Critique, tmp_path: Path) -> None:
    paper.save(tmp_path / "out")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["critique.png", "metrics.csv", "pairs.csv"]
    assert len(pd.read_csv(tmp_path / "out" / "pairs.csv")) == 6 * 3 * 3
    assert (tmp_path / "out" / "critique.png").read_bytes().startswith(b"\x89PNG")


def test_one_laboratory_has_no_scatter() -> None:
    with pytest.raises(InputError, match="from 2"):
        vl.critique(BATS, laboratories=1)


def test_mean_and_scatter_of_a_bat_are_those_of_a_sample() -> None:
    """Results 90 and 92, with a test without a result between them: mean 91, s = √2."""
    row, _ = made_up((90.0, 91.0), (nan, 91.2), (92.0, 91.4)).metrics
    assert (row.laboratories, row.mean) == (2, 91)
    assert row.sd == pytest.approx(sqrt(2))
