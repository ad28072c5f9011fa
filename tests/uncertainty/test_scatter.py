"""Scatter of hits joined with that of earlier tests: by hand, and by simulation with numpy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from virtual_lab.uncertainty.budget import Variants, means_of_hits
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.uncertainty.scatter import (
    HitVariance,
    Scatter,
    bartlett_p,
    has_larger_scatter,
)

HITS = 6


def variance(unexplained: float, total: float, dof: float) -> HitVariance:
    return HitVariance(
        unexplained=np.array([unexplained]), total=np.array([total]), dof=np.array([dof])
    )


def of_six(today: HitVariance, u: float, dof: float) -> Scatter:
    """Return the scatter of the mean of six hits."""
    return Scatter(
        u=np.array([u]), dof=np.array([dof]), weighing=np.array([1 / HITS]), variance=today
    )


def scatter_of(hits: np.ndarray, effects: np.ndarray | None = None) -> Scatter:
    """Return the scatter of tests (test, 6) at one position, with effects (constant, 6) on hits."""
    effects = np.zeros((0, HITS)) if effects is None else effects
    each = np.broadcast_to(effects, (len(hits), *effects.shape))
    return Scatter.of_hits(hits, np.full(hits.shape, 1 / HITS), np.zeros(hits.shape), each)


def numbers(each: HitVariance) -> list[float]:
    return [float(part[0]) for part in (each.unexplained, each.total, each.dof)]


def test_variances_join_by_degrees_of_freedom() -> None:
    """The variance of a hit is (5 · 2 + 50 · 4) / 55, less the .5 that a constant explains."""
    joined = of_six(variance(1.5, 2.0, 5.0), 0.5, 5.0).pool_with(variance(3.5, 4.0, 50.0))
    unexplained, all_seen = (5 * 1.5 + 50 * 3.5) / 55, (5 * 2 + 50 * 4) / 55
    assert joined.u**2 == pytest.approx(unexplained / HITS)
    assert joined.dof == pytest.approx(55 * (unexplained / all_seen) ** 2)


def test_the_variance_of_a_hit_agrees_with_numpy() -> None:
    """At one position it is s² with 5 dof; a constant that moves hits reduces it, also below 0."""
    hits = np.array([[1.0, 2.0, 4.0, 4.0, 7.0, 9.0]])
    s2 = hits.var(ddof=1)
    assert numbers(scatter_of(hits).variance) == pytest.approx([s2, s2, 5])
    assert numbers(scatter_of(hits, 3 * hits).variance) == pytest.approx([s2 - 9 * s2, s2, 5])


def test_equal_hits_without_scatter_stay_alone() -> None:
    """No scatter today and earlier: u is 0, and its degrees of freedom are those of today."""
    joined = of_six(variance(0.0, 0.0, 5.0), 0.0, 5.0).pool_with(variance(0.0, 0.0, 50.0))
    assert (float(joined.u[0]), float(joined.dof[0])) == (0, 5)


@pytest.mark.parametrize("sizes", [(2, 2, 2), (2, 3, 4), (5, 8, 12), (3, 2)])
def test_bartletts_test_agrees_with_scipy(sizes: tuple[int, ...]) -> None:
    """With 1 to 3 degrees of freedom the correction is .4, so a wrong one shows."""
    rng = np.random.default_rng(3)
    samples = [rng.normal(scale=1 + at, size=size) for at, size in enumerate(sizes)]
    variances = np.array([each.var(ddof=1) for each in samples])
    expected = stats.bartlett(*samples).pvalue
    assert bartlett_p(variances, np.array(sizes) - 1.0) == pytest.approx(expected)


def test_pooled_tests_omit_the_invalid() -> None:
    tests = [variance(v, v, dof) for v, dof in ((1.0, 5.0), (3.0, 15.0), (1e9, 0.0))]
    pooled = HitVariance.pool(tests)
    assert numbers(pooled) == pytest.approx([2.5, 2.5, 20])
    assert numbers(HitVariance.of(pooled.as_estimates("3 tests"))) == pytest.approx(numbers(pooled))


def test_a_larger_scatter_today_counts_alone() -> None:
    """A one-sided F test with 1 %: the table's F(5, 50; .99) is 3.41."""
    assert stats.f.ppf(0.99, 5, 50) == pytest.approx(3.41, abs=5e-3)
    for ratio, alone in ((3.40, False), (3.42, True)):
        six_hits = of_six(variance(ratio, ratio, 5.0), float(np.sqrt(ratio / HITS)), 5.0)
        assert (float(six_hits.pool_with(variance(1.0, 1.0, 50.0)).dof[0]) == 5.0) == alone
        today, earlier = (
            Estimate(value=v, u=v * float(np.sqrt(2 / dof)), dof=dof)
            for v, dof in ((ratio, 5.0), (1.0, 50.0))
        )
        assert has_larger_scatter(today, earlier) == alone


def test_the_f_test_compares_observed_variances() -> None:
    """Constants explain a part of each variance; the remaining part has no F distribution."""
    assert variance(1.0, 4.0, 5.0).larger(variance(1.0, 1.0, 50.0))[0]
    assert not variance(3.0, 3.0, 5.0).larger(variance(0.5, 1.0, 50.0))[0]


def test_a_fully_explained_scatter_keeps_its_degrees_of_freedom() -> None:
    """Instead of u = 0 with ν = ∞, the Welch-Satterthwaite term is that of the seen variance."""
    joined = of_six(variance(-0.5, 1.0, 5.0), 0.0, np.inf).pool_with(variance(-0.1, 1.0, 50.0))
    assert 0 < joined.u[0] < 0.02
    assert joined.u[0] ** 4 / joined.dof[0] == pytest.approx((1 / HITS) ** 2 / 55)


def test_a_history_covers_the_tests_with_a_small_u_as_well() -> None:
    """The simulation has 20 000 laboratories with six normal hits and ten earlier tests.

    The tenth with the smallest u covers the truth in 90 % with the history (u with 55 dof spreads
    by a tenth), in three of four without; all together cover it in 95 %, within four standard
    errors.
    """
    rng, count = np.random.default_rng(11), 20_000
    tests = rng.standard_normal((11, count, HITS))
    earlier = HitVariance.pool([scatter_of(each).variance for each in tests[1:]])
    today, one = np.repeat(tests[0][:, None], 3, axis=1), np.ones(count)
    constants = Variants.of({"without effect": Estimates(value=one, u=one, dof=one)})
    even, place = np.full((count, HITS), 1 / HITS), np.zeros((count, HITS))
    for history, least, most in ((None, 0.65, 0.8), (earlier, 0.88, 0.93)):
        result = means_of_hits(constants, today, even, place, even, history)
        held = np.abs(result.value) <= stats.t.ppf(0.975, result.dof) * result.u
        assert held.mean() == pytest.approx(0.95, abs=4 * 0.0016)
        assert least < held[np.argsort(result.u)[: count // 10]].mean() < most
