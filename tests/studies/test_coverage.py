"""The statistics of the coverage study for laboratories made by hand."""

from __future__ import annotations

from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.procedure.model import QUANTITIES
from virtual_lab.output.result import Rows
from virtual_lab.records import AimMarks
from virtual_lab.studies import coverage as study
from virtual_lab.studies.coverage import Coverage, coverage
from virtual_lab.uncertainty.budget import combine_components, type_a_component

TRUE = 0.95  # true value of every quantity
PLACE, AIM = 0.16, 0.5e-3  # impact position [m], and known distance of the hits from it
BEND = -40.0  # d²/dz² of every quantity [1/m²]

Array = NDArray[np.float64]


def laboratory(
    errors: float,
    u: float = 0.01,
    *,
    dof: float = np.inf,
    stray: float = 0.0,
    valid: int = 6,
    verdict: str = "PASS",
    **others: Array,
) -> Any:
    """Return a block of one with six hits, whose results are `errors` above the truth.

    `others` are true values of the metric by another definition.
    `stray` [m] is the distance of the marks to either side of the mean aim.
    """
    value = np.array([TRUE + errors])
    budgets = combine_components(
        value, type_a_component("hits", value, np.array([u]), np.array([dof]))
    )
    names = ("metric", *QUANTITIES)
    aside = AIM + stray * np.array([1.0, -1.0] * 3)
    hits = np.arange(6) < valid
    return SimpleNamespace(
        certified=SimpleNamespace(
            invalid=np.array([verdict == "INVALID"]),
            hit_weights=SimpleNamespace(position=np.array([PLACE]), used=hits),
            results=dict.fromkeys(names, budgets),
            reduced=SimpleNamespace(
                owner=np.zeros(6, dtype=int),
                valid=hits,
                position=np.full(6, PLACE),
                shot_metric=np.full(6, value[0]),
            ),
            block=SimpleNamespace(
                impact={"aim": AimMarks(along=aside, across=aside)},
                calibration={"impact.cannon.along": SimpleNamespace(value=np.array([AIM]))},
            ),
        ),
        measurands=dict.fromkeys(names, np.array([TRUE])) | others,
    )


@pytest.fixture
def studied(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the study of tests made by hand for a bat with a parabolic curve."""

    def curve(_station: Any, _specimen: Any, _rules: Any, places: Array) -> Any:
        values = TRUE + BEND / 2 * (places - PLACE) ** 2
        return SimpleNamespace(quantities=dict.fromkeys(QUANTITIES, values), metric=lambda: values)

    opened = SimpleNamespace(
        impact=None, specimen=None, rules=SimpleNamespace(spec=SimpleNamespace(scan=None))
    )
    monkeypatch.setattr(study, "true_curve", curve)

    def run(tests: list[Any]) -> Rows[Coverage]:
        rules = SimpleNamespace(spec=SimpleNamespace(metric="bat_performance_factor"))
        shared = SimpleNamespace(
            setup=SimpleNamespace(rules=rules),
            laboratory=lambda _: opened,
            each_block=lambda take, *_: map(take, tests),
        )
        monkeypatch.setattr(study, "replace", lambda given, **_: given)
        monkeypatch.setattr(study, "RoundRobin", SimpleNamespace(of=lambda *_, **__: shared))
        return coverage("r161", laboratories=len(tests))

    return run


def test_a_truth_above_the_interval_is_counted_above(studied: Any) -> None:
    """With u .01 (1.96 u = .0196), two laboratories are .03 too low, one too high, seven right."""
    tests = [laboratory(error) for error in (-0.03, -0.03, 0.03, *[0.0] * 7)]
    for row in studied(tests):
        assert (row.coverage, row.above, row.below) == pytest.approx((0.7, 0.2, 0.1))


def test_a_metric_converted_by_a_formula_is_also_compared_with_the_standard_ball() -> None:
    """The true values differ by .02: one of four intervals (u .01) holds both."""
    true = {"metric_with_standard_ball": np.array([TRUE + 0.02])}
    errors = (-0.01, 0.015, 0.03, 0.05)
    parts = [study.sample(laboratory(error, **true)) for error in errors]
    rows = study.coverage_table(parts, "r161", "astm-f1881", 1)
    shares = {row.quantity: row.coverage for row in rows}
    assert shares.pop("metric_with_standard_ball") == 0.5
    assert set(shares.values()) == {0.5}
    assert [row.quantity for row in rows][:2] == ["metric", "metric_with_standard_ball"]
    assert "bat_performance_factor" not in shares  # the metric


def test_the_edge_of_an_interval_is_students(studied: Any) -> None:
    """An error of 1.95 u is held, 1.97 u is not, on either side."""
    tests = [laboratory(sign * off) for off in (0.0195, 0.0197) for sign in (1, -1)]
    assert all(row.coverage == 0.5 for row in studied(tests))
    assert all((row.above, row.below) == (0.25, 0.25) for row in studied(tests))


def test_bounds_are_clopper_and_pearsons_of_95_percent(studied: Any) -> None:
    """19 of 20: .7513 to .9987 (tables of exact binomial limits; beta quantiles .025 and .975)."""
    (row, *_) = studied([laboratory(0.1), *[laboratory(0.0)] * 19])
    assert (row.coverage_low, row.coverage_high) == pytest.approx((0.7513, 0.9987), abs=5e-5)


def test_the_title_answers_whether_the_intervals_hold(studied: Any) -> None:
    """Clopper-Pearson: 95 % of 499 decides nothing, of 500 agrees with 95 %; 93 and 97 % do not."""
    for missed, of, answer in (
        (25, 499, "of 499 laboratories, undecided with fewer than 500"),
        (25, 500, "in 95.0 % (92.7 to 96.7 %) of 500 laboratories, as stated"),
        (5, 20, "of 20 laboratories, less often than stated"),
        (50, 1000, "in 95.0 % (93.5 to 96.3 %) of 1000 laboratories, as stated"),
        (70, 1000, "laboratories, less often than stated"),
        (30, 1000, "laboratories, more often than stated"),
    ):
        tests = [*[laboratory(0.1)] * missed, *[laboratory(0.0)] * (of - missed)]
        assert studied(tests).title.endswith(answer)


def test_tenths_go_by_u_and_by_degrees_of_freedom(studied: Any) -> None:
    """Twenty laboratories with u .01 to .20: odd ones miss up to u .10, all miss beyond.

    Degrees of freedom fall with u, and the tests are in another order.
    """
    tests = []
    for k in (7 * at % 20 for at in range(20)):
        missed = k >= 10 or k % 2
        tests.append(laboratory(-9.0 if missed else 0.0, 0.01 * (k + 1), dof=40.0 - k))
    for row in studied(tests):
        assert [*row.coverage_by_u.values()] == [0.5] * 5 + [0.0] * 5
        assert [*row.coverage_by_dof.values()] == [0.0] * 5 + [0.5] * 5


def test_errors_and_z_agree_with_a_hand_calculation(studied: Any) -> None:
    """Errors 1, 2, 6 with u 1, 1, 2 [hundredths]: z = 1, 2, 3, mean 2, s 1, standard error 1/√3.

    rms error √(41/3), rms u √2, mean error 3 with s² = (4 + 1 + 9)/2 = 7.
    """
    tests = [laboratory(e / 100, u / 100) for e, u in ((1, 1), (2, 1), (6, 2))]
    (row, *_) = studied(tests)
    assert (row.mean_z, row.sd_z, row.mean_z_se) == pytest.approx((2, 1, 1 / sqrt(3)))
    assert (100 * row.rms_error, 100 * row.rms_u) == pytest.approx((sqrt(41 / 3), sqrt(2)))
    assert (100 * row.bias, 100 * row.bias_se) == pytest.approx((3, sqrt(7 / 3)))


def test_the_bias_expected_of_a_parabola_is_half_its_bend_times_the_scatter(studied: Any) -> None:
    """Positions ± 2 mm about the stated one: f''/2 · (2 mm)² = -20 · 4e-6 = -8e-5 (GUM F.2.4.4).

    Half of the laboratories hit one position, so the mean is half of that; the mean aim, which
    the laboratory knows, adds nothing.
    """
    tests = [laboratory(0.0, stray=stray) for stray in (2e-3, 0.0, 2e-3, 0.0)]
    for row in studied(tests):
        assert row.expected_bias == pytest.approx(-4e-5, rel=1e-6)
        assert row.expected_bias_se is None


def test_a_test_without_a_result_counts_apart_and_its_hits_count(studied: Any) -> None:
    """One of three tests is INVALID without a valid hit: 6 of 18 hits rejected, two results."""
    tests = [laboratory(0.0), laboratory(0.5, valid=0, verdict="INVALID"), laboratory(0.001)]
    for row in studied(tests):
        assert (row.laboratories, row.invalid, row.coverage) == (2, 1, 1.0)
        assert row.rejected == pytest.approx(1 / 3)


def test_individual_bats_count_where_instruments_write_sums() -> None:
    """The errors are those of laboratories with individual bats, one after another."""
    bias = {}
    for individual in (False, True):
        rows = coverage("r161", laboratories=2, summed=True, individual=individual)
        bias[individual] = rows[0].bias
    errors = [
        tested.certification.metric.value - tested.sealed.measurand["metric"]
        for tested in RoundRobin.of("r161", "astm-f1881", individual=True).run(2, seed=1)
        if tested.certification.metric is not None
    ]
    assert bias[True] == pytest.approx(np.mean(errors), rel=1e-9)
    assert bias[False] != pytest.approx(bias[True], rel=1e-6)
