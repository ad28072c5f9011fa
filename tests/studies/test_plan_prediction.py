"""Predicted u of plans beside simulated tests, and the choice among plans."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.procedure import CHOICE, Procedure
from virtual_lab.measurement.reduction.observations import REPEATABILITY, SLOPE_REPEATABILITY
from virtual_lab.sheets import Sheet
from virtual_lab.studies.plan.choosing import cheapest, cheapest_single_change, irreducible
from virtual_lab.studies.plan.prediction import Counts, Exchanged, Forecast
from virtual_lab.studies.plan.sample import SampledTests, _dealt, median_of

TESTS = 800


@pytest.fixture(scope="module")
def laboratories():
    return RoundRobin.of("softball-34", "asa")


@pytest.fixture(scope="module")
def forecast(laboratories):
    sample = SampledTests.of(laboratories, TESTS, 3)
    return Forecast(rules=laboratories.setup.rules.spec, sample=sample)


def _simulated(laboratories, **changes):
    sheet = Sheet.of("procedures", "asa").with_(changes)
    rules = catalog.read(sheet.text, sheet.name, Procedure)
    return SampledTests.of(
        replace(laboratories, setup=replace(laboratories.setup, rules=rules)), TESTS, 4
    )


def test_a_forecast_starts_at_the_counts_of_the_procedure(forecast):
    assert forecast.present == Counts(hits=6, final_hits=0, balls=12, wall_hits=4)
    grid = forecast.present.grid
    assert grid.hits.shape == (9, 1, 9, 8)
    assert (grid.hits[0, 0, 0, 0], grid.hits[-1, 0, 0, 0], grid.final_hits.max()) == (6, 24, 0)


@pytest.mark.parametrize(
    "counts",
    [
        Counts(hits=6, final_hits=0, balls=12, wall_hits=4),
        Counts(hits=24, final_hits=0, balls=12, wall_hits=4),
        Counts(hits=9, final_hits=0, balls=30, wall_hits=12),
    ],
)
def test_the_predicted_u_agrees_with_simulated_tests(laboratories, forecast, counts):
    changes = {"valid_hits": counts.hits, "balls": counts.balls, "wall_hits": counts.wall_hits}
    simulated = _simulated(laboratories, attempts=2 * counts.hits, **changes)
    value, error = simulated.median_u
    assert forecast.u(counts)[0] == pytest.approx(value, rel=0.03)
    assert error < 0.01 * value
    assert forecast.shots(counts) == pytest.approx(simulated.shots.mean(), rel=0.02)


def test_exchanges_multiply_the_terms_of_their_instruments(forecast):
    sample, names = forecast.sample, forecast.names
    halves = []
    for name, scatter in (("bench.stand.offset", False), ("impact.cannon.along", True)):
        squares = sample.squares.copy()
        squares[:, names.index(name)] /= 4
        squares[:, names.index("hits")] /= 2  # by chance, without another scatter
        halves.append(Exchanged(replace(sample, squares=squares), scatter))
    both = replace(forecast, exchanged=halves)
    none, stand, cannon, together = both.u(both.present) ** 2
    assert none == pytest.approx(forecast.u(forecast.present)[0] ** 2)
    assert none - together == pytest.approx((none - stand) + (none - cannon))
    mean = dict(zip(names, sample.squares.mean(axis=0), strict=True))
    assert none - stand == pytest.approx(0.75 * mean["bench.stand.offset"])
    hits = both.contributions(both.present, 0)["hits"] ** 2
    assert none - cannon == pytest.approx(0.75 * mean["impact.cannon.along"] + 0.5 * hits)
    largest = next(iter(both.contributions(both.present, 3)))
    assert largest == "hits"


def test_terms_follow_the_counts(forecast):
    """By hand: the powers of the counts that each term follows to first order."""
    names = (*forecast.names, SLOPE_REPEATABILITY)
    squares = np.c_[forecast.sample.squares, np.full(TESTS, 5.0)]
    squares[:, names.index(CHOICE)] = 4.0
    known = replace(forecast, sample=replace(forecast.sample, names=names, squares=squares))
    present = known.present

    def variance(name, counts, of=known):
        return of.contributions(counts, 0)[name] ** 2

    more = replace(present, wall_hits=12, balls=24)
    assert variance(SLOPE_REPEATABILITY, more) == pytest.approx(5 / (3 * 2))
    twice = replace(present, hits=12)
    assert variance(CHOICE, twice) == pytest.approx(4 / 2)
    fewer = replace(known.sample, squares=squares / 4)
    doubled = replace(known, doubled=fewer)
    assert variance(CHOICE, twice, doubled) == pytest.approx(4 / 4)
    assert variance(CHOICE, replace(present, hits=24), doubled) == pytest.approx(4 / 16)
    final = replace(present, final_hits=12)
    assert variance("hits", final) == pytest.approx(variance("hits", twice))
    # twice the hits with twice the balls: each ball has the same hits, and errors average
    few, many = replace(present, hits=12, balls=6), replace(present, hits=24, balls=12)
    assert variance(REPEATABILITY, few) > 0
    assert variance(REPEATABILITY, many) == pytest.approx(variance(REPEATABILITY, few) / 2)


def test_error_of_the_median_by_repetition():
    rng = np.random.default_rng(1)
    medians, errors = [], []
    for _ in range(400):
        u = rng.gamma(4.0, size=500)
        value, error = median_of(u)
        medians.append(value)
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.std(medians), rel=0.12)


def test_shares_of_balls_that_are_fired_in_turn():
    weights = np.array([[0.5, 0.5, 0.0], [1.0, -1.0, 1.0]])
    assert _dealt(weights, 1).tolist() == [1.0, 1.0]
    assert _dealt(weights, 2).tolist() == [0.5, 5.0]
    assert _dealt(weights, 7).tolist() == [0.5, 3.0]


def test_mean_wait_for_consecutive_hits():
    rules = catalog.load("procedures", "bbcor", Procedure).spec
    rng, waits = np.random.default_rng(2), []
    for _ in range(4000):
        run = shots = 0
        while run < 6:
            shots += 1
            run = run + 1 if rng.random() < 0.8 else 0
        waits.append(shots)
    predicted = Forecast(rules=rules, sample=None)._final_shots(6, 0.8)
    assert predicted == pytest.approx(np.mean(waits), rel=0.04)


def _brute(u, cost, target):
    """Return the irreducible plans by comparison with every plan that is nowhere more."""
    kept = []
    for plan in product(*map(range, u.shape)):
        if u[plan] > target:
            continue
        smaller = (
            other
            for other in product(*map(range, u.shape))
            if other != plan
            and other[0] & plan[0] == other[0]
            and all(a <= b for a, b in zip(other[1:], plan[1:], strict=True))
        )
        if not any(u[other] <= target for other in smaller):
            kept.append(plan)
    return sorted(kept, key=lambda plan: (cost[plan], plan[0].bit_count(), u[plan]))


def test_cheapest_plans_by_brute_force():
    sets, hits, balls = np.meshgrid(np.arange(4), np.arange(5), np.arange(3), indexing="ij")
    u = 1 / (1 + hits + 0.4 * balls + 0.7 * (sets & 1) + 0.9 * (sets >> 1))
    cost = 1.0 + 2 * hits + balls
    for target in (1.0, 0.5, 0.25, 0.155, 0.01):
        expected = _brute(u, cost, target)
        assert cheapest(u, cost, target, 100) == expected
        assert irreducible(u <= target).sum() == len(expected)
    assert cheapest(u, cost, 0.5, 2) == _brute(u, cost, 0.5)[:2]


def test_plans_of_equal_cost_are_sorted_by_exchanges_then_by_u():
    """Three instruments of different worth, none of which costs anything."""
    sets, hits, balls = np.meshgrid(np.arange(8), np.arange(5), np.arange(4), indexing="ij")
    bits = (sets & 1, sets >> 1 & 1, sets >> 2 & 1)
    cost = 1.0 + hits + balls
    for worth in ((0.7, 0.9, 1.1), (0.2, 0.5, 1.4)):
        gain = sum(each * bit for each, bit in zip(worth, bits, strict=True))
        u = 1 / (1 + 0.6 * hits + 0.4 * balls + gain)
        for target in (0.55, 0.4, 0.3, 0.25):
            assert cheapest(u, cost, target, 100) == _brute(u, cost, target)


def test_cheapest_single_change():
    u = np.array([[[4.0, 3.0], [2.0, 1.0]], [[3.5, 2.5], [1.5, 0.5]]])
    cost = np.array([[[0, 5], [3, 8]], [[4, 9], [7, 12]]])
    assert cheapest_single_change(u, cost, 2.0) == (0, 1, 0)
    assert cheapest_single_change(u, cost, 3.0) == (0, 1, 0)
    cost[0, 1] += 9
    assert cheapest_single_change(u, cost, 3.0) == (0, 0, 1)
    assert cheapest_single_change(u, cost, 3.5) == (1, 0, 0)
    assert cheapest_single_change(u, cost, 1.5) is None
    both = np.array([4.0, 3.0, 3.0, 2.0]).reshape(4, 1)  # sets of two instruments
    assert cheapest_single_change(both, np.zeros((4, 1)), 2.5) is None
    assert cheapest_single_change(both, np.array([[0], [5], [4], [0]]), 3.5) == (2, 0)
