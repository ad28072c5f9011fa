"""Studies that read the truth: coverage in many laboratories, and the bias of the method."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

import virtual_lab as vl
from tests.studies.effects import effects
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.studies.bias import bias
from virtual_lab.studies.coverage import coverage
from virtual_lab.studies.place_slope import slope
from virtual_lab.studies.score import score
from virtual_lab.units import INCH

LABORATORIES = 30
BASEBALL_BATS = tuple(
    name for name in catalog.names("bats") if catalog.load_bat(name).spec.sport == "baseball"
)


@pytest.mark.parametrize(
    ("bat", "procedure"),
    [("r161", "astm-f1881"), ("r161", "ncaa-besr"), ("r161", "bbcor"), ("softball-34", "asa")],
)
def test_intervals_contain_the_truth_in_95_percent_of_tests(bat: str, procedure: str) -> None:
    """A short version of ``virtual-lab coverage r161 --summed`` (table beside this).

    Of 30 intervals of 95 % at least 25 hold the truth with probability 0.997; the mean error in
    standard uncertainties lies within 4/sqrt(30), and the bias within 4 standard errors of the
    expected one. Only six new hits give the scatter of bbcor: a t of 5 degrees has s = 1.3.
    """
    rows = coverage(bat, procedure=procedure, laboratories=LABORATORIES, seed=50_000, summed=True)
    for row in rows:
        print(row)
        assert row.laboratories + row.invalid == LABORATORIES
        assert row.coverage >= 25 / 30
        assert abs(row.mean_z) < 4 * 1.3 / sqrt(LABORATORIES)
        assert 0.65 < row.sd_z < 1.35 * (1.3 if procedure == "bbcor" else 1.0)
        assert row.coverage_low < row.coverage < row.coverage_high or row.coverage == 1
        assert row.coverage + row.above + row.below == pytest.approx(1)
        many = np.array([len(part) for part in np.array_split(np.arange(row.laboratories), 10)])
        for parts in (row.coverage_by_u.values(), row.coverage_by_dof.values()):
            assert many @ [*parts] / many.sum() == pytest.approx(row.coverage)
        assert abs(row.bias - row.expected_bias) < 4 * row.bias_se


def test_the_effect_of_every_term_agrees_with_its_stated_value() -> None:
    """A short version of the study of `asa` with softball-34.

    Each effect is within 4.5 standard errors of the stated one (30 terms of 100 dof: by chance 1 in
    1000), and the largest beyond 2 standard errors of zero, so that a lost sign would show.
    """
    rows = effects("softball-34", "asa", 130)
    terms = {row.component: row for row in rows}
    for name, row in terms.items():
        print(name, row.stated_effect, row.real_effect, row.real_effect_se)
        assert row.real_effect is not None, name
        # the sheet's slope is that of all softball bats: the effect of the aim may differ by its u
        stated = terms["procedure.place_slope_error"].stated_effect
        slack = 2 * abs(stated) if name == "impact.cannon.along" else 0.0
        if name != "procedure.place_slope_error":
            assert abs(row.real_effect - row.stated_effect) < 4.5 * row.real_effect_se + slack, name
    assert [abs(row.stated_effect) for row in rows] == sorted(
        (abs(row.stated_effect) for row in rows), reverse=True
    )
    for name in ("bench.stand.offset", "bat.balance", "hall.air.drag_coefficient"):
        assert abs(terms[name].real_effect) > 2 * terms[name].real_effect_se
    assert (
        terms["balls.repeatability"].real_effect > 2 * terms["balls.repeatability"].real_effect_se
    )


def test_effects_need_laboratories() -> None:
    with pytest.raises(ValueError, match="5 with a result, 128 are needed"):
        effects("r161", "astm-f1881", 5)


@pytest.mark.parametrize(
    ("procedure", "bats"),
    [("astm-f1881", BASEBALL_BATS), ("asa", ("softball-34", "softball-wood-34"))],
)
def test_the_slope_agrees_with_the_sheet_of_its_procedure(
    procedure: str, bats: tuple[str, ...]
) -> None:
    """The slope is that of ``virtual-lab slope``, rounded as on the sheet; u is at least its u."""
    *_, mean, deviation = slope(bats, procedure=procedure)
    sheet = catalog.load("procedures", procedure, Procedure).spec
    assert sheet.place_slope * INCH == pytest.approx(mean.slope_per_in, abs=6e-4)
    assert sheet.place_slope_u * INCH == pytest.approx(deviation.slope_per_in, abs=6e-4)


def test_a_slope_needs_bats_and_positions() -> None:
    with pytest.raises(InputError, match="2 or more"):
        slope(("r161",), procedure="astm-f1881")
    with pytest.raises(InputError, match="at one impact position"):
        slope(procedure="bbcor")


def test_coverage_with_complete_records_is_sufficient() -> None:
    """Laboratories with individual bats and complete records."""
    for row in coverage("r161", laboratories=12, seed=50_000):
        assert row.coverage >= 9 / 12  # fewer: by chance 1 in 5000


def test_the_bias_without_noise_is_below_1e_3() -> None:
    """The bias is below 1e-3 in e_A for every bat, with ring, counts, friction and drag.

    The heavy check cylinder turns so slowly that one count of the encoder shows, and without
    noise all shots round equally: from -.0003 to .0028 for ball speeds of 58.7 to 61.3 mph.
    """
    rows = bias()
    assert [row["bat"] for row in rows] == list(catalog.names("bats"))
    for row in rows:
        print(row)
        limit = 4e-3 if row["bat"] == "check-cylinder" else 1e-3
        assert abs(row["collision_efficiency_bias"]) < limit
        assert abs(row["ball_restitution_bias"]) < 1e-5
    e_A = [row["collision_efficiency_bias"] for row in rows]
    line = f"collision efficiency bias: {min(e_A):+.1e} to {max(e_A):+.1e} over all bats"
    assert line in rows.text.splitlines()


def test_a_known_error_is_scored_in_units_of_u() -> None:
    names = ("collision_efficiency", "restitution", "recoil_factor", "ball_restitution")
    metric = {"name": "bat_performance_factor", "value": 1.0, "u": 0.01}
    certificate = {"metric": metric | {"interval_95": [0.975, 1.025]}}
    certificate |= {name: {"value": 0.25, "u": 0.0} for name in names}
    true = dict.fromkeys(names, 0.25) | {"metric": 0.98, "metric_with_standard_ball": 0.97}
    rows = score(certificate, true)
    assert rows["metric"].error == pytest.approx(0.02)
    assert rows["metric"].z == pytest.approx(2.0)
    assert rows["restitution"].z is None
    assert rows["metric_with_standard_ball"].z == pytest.approx(3.0)
    held = [rows[name].held for name in ("metric", "metric_with_standard_ball", "restitution")]
    assert held == [True, False, None]


def test_one_laboratory_is_too_few_for_coverage() -> None:
    with pytest.raises(InputError, match="from 2"):
        vl.coverage("r161", laboratories=1)
