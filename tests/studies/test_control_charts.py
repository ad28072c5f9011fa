"""Control charts: run lengths against Markov chains, and the chains against published ones."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from virtual_lab.streams import Streams
from virtual_lab.studies.control_charts import (
    CUSUM_LIMIT,
    EWMA_LIMIT,
    RANGE_LIMIT,
    RULES,
    Baseline,
    breaks,
    control_chart,
    cusum,
    ewma,
    moving_range,
)

Array = NDArray[np.float64]
RUNS, DAYS = 6000, 500
PATTERNS = {2: (2, 3, 2.0), 3: (4, 5, 1.0)}  # rules of the Western Electric handbook


class Chain:
    """Transitions of days without an alarm; the missing part of a row is the alarm."""

    def __init__(self, matrix: Array, start: int) -> None:
        self.matrix, self.start = matrix, start

    def mean(self) -> float:
        """Return the mean number of days to the alarm."""
        n = len(self.matrix)
        return float(np.linalg.solve(np.eye(n) - self.matrix, np.ones(n))[self.start])

    def mean_within(self, days: int) -> float:
        """Return the mean of the days to the alarm, or `days` without an alarm."""
        quiet = np.eye(len(self.matrix))[self.start]
        total = 0.0
        for _ in range(days):
            total += quiet.sum()
            quiet = quiet @ self.matrix
        return float(total)


def pattern_chain(rule: int, shift: float = 0.0, *, with_rule_1: bool = False) -> Chain:
    """Return the chain of the last days' sides: `k` of `n` on one side are the alarm."""
    edge = 3.0 if with_rule_1 else np.inf
    if rule == 1:
        return Chain(np.array([[norm.cdf(3 - shift) - norm.cdf(-3 - shift)]]), 0)
    need, of, beyond = PATTERNS[rule]
    chance = {
        1: norm.cdf(edge - shift) - norm.cdf(beyond - shift),
        -1: norm.cdf(-beyond - shift) - norm.cdf(-edge - shift),
        0: norm.cdf(beyond - shift) - norm.cdf(-beyond - shift),
    }
    states = {past: i for i, past in enumerate(product((0, 1, -1), repeat=of - 1))}
    matrix = np.zeros((len(states), len(states)))
    for past, i in states.items():
        for side, p in chance.items():
            if side == 0 or (*past, side).count(side) < need:
                matrix[i, states[*past[1:], side]] += p
    return Chain(matrix, states[(0,) * (of - 1)])


def eight_chain() -> Chain:
    """Return the chain of the number of days in a row on one side, in control."""
    matrix = np.zeros((8, 8))
    matrix[0, 1] = 1.0
    matrix[1:, 1] = 0.5
    matrix[range(1, 7), range(2, 8)] += 0.5
    return Chain(matrix, 0)


def cusum_chain(shift: float = 0.0, cells: int = 500) -> Chain:
    """Return the one-sided chain with slack 0.5 and limit 5 (Brook and Evans 1972): 0 and cells."""
    edges = np.linspace(0, 5, cells + 1)
    middle = np.concatenate([[0], (edges[1:] + edges[:-1]) / 2])
    reach = norm.cdf(edges + 0.5 - shift - middle[:, None])
    return Chain(np.column_stack([reach[:, 0], np.diff(reach, axis=1)]), 0)


def ewma_chain(shift: float = 0.0, cells: int = 401) -> Chain:
    """Return the chain with weight 0.2 and width 2.962 (Lucas and Saccucci 1990)."""
    limit = 2.962 * sqrt(0.2 / 1.8)
    edges = np.linspace(-limit, limit, cells + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    reach = norm.cdf((edges - 0.8 * middle[:, None]) / 0.2 - shift)
    return Chain(np.diff(reach, axis=1), cells // 2)


@pytest.mark.parametrize(
    ("chain", "published", "digit"),
    [
        (pattern_chain(1), 370.40, 0.01),  # three run lengths of Champ and Woodall 1987
        (pattern_chain(2, with_rule_1=True), 225.44, 0.01),
        (pattern_chain(3, with_rule_1=True), 166.05, 0.01),
        (pattern_chain(1, shift=1.0), 43.9, 0.1),
        (
            eight_chain(),
            2**8 - 1,
            0.001,
        ),  # tosses of a coin until eight equal ones in a row, either side
        (ewma_chain(), 500, 1),
        (ewma_chain(shift=1.0), 10.5, 0.1),
    ],
)
def test_the_chains_give_the_published_run_lengths(
    chain: Chain, published: float, digit: float
) -> None:
    """Run lengths agree to the last published digit."""
    assert chain.mean() == pytest.approx(published, abs=digit / 2)


def test_the_cusums_chain_gives_the_published_run_length() -> None:
    """With k = 0.5, h = 5: 930 for one side, 465 for both (1/L = 1/L₊ + 1/L₋), 10.4 shifted 1."""
    assert cusum_chain().mean() / 2 == pytest.approx(465, abs=0.5)
    both = 1 / (1 / cusum_chain(1.0).mean() + 1 / cusum_chain(-1.0).mean())
    assert both == pytest.approx(10.4, abs=0.05)


@pytest.fixture(scope="module")
def days() -> Array:
    return Streams(20_26).normal("control", (RUNS, DAYS))


def within(flags: NDArray[np.bool_]) -> Array:
    """Return the days to each laboratory's first alarm, at most the number of days."""
    return np.where(flags.any(axis=-1), flags.argmax(axis=-1) + 1, flags.shape[-1])


def agrees(flags: NDArray[np.bool_], expected: float) -> None:
    """Return whether the mean of runs is within four standard errors (by chance 1 in 16 000)."""
    found = within(flags)
    error = found.std(ddof=1) / sqrt(found.size)
    print(f"{found.mean():.1f} ± {error:.1f}, expected {expected:.1f}")
    assert abs(found.mean() - expected) < 4 * error


@pytest.mark.parametrize("shift", [0.0, 1.0])
@pytest.mark.parametrize("rule", [1, 2, 3])
def test_run_lengths_of_the_rules_agree_with_their_chains(
    rule: int, shift: float, days: Array
) -> None:
    """In control, and shifted by one standard deviation from the first day."""
    agrees(breaks(days + shift, rule), pattern_chain(rule, shift).mean_within(DAYS))


def test_the_run_length_of_eight_on_one_side_agrees_with_its_chain(days: Array) -> None:
    agrees(breaks(days, 4), eight_chain().mean_within(DAYS))


@pytest.mark.parametrize(("rules", "published"), [((1, 4), 152.73), ((1, 2, 3, 4), 91.75)])
def test_run_lengths_of_combined_rules_agree_with_their_chain(
    rules: tuple[int, ...], published: float, days: Array
) -> None:
    """Champ and Woodall 1987; runs beyond 1 000 days are very rare."""
    days = days.reshape(-1, 2 * DAYS)
    agrees(np.logical_or.reduce([breaks(days, rule) for rule in rules]), published)


@pytest.mark.parametrize("shift", [0.0, 1.0, -2.0])
def test_run_lengths_of_the_moving_average_agree_with_its_chain(shift: float, days: Array) -> None:
    flags = np.abs(ewma(days + shift)) > EWMA_LIMIT
    agrees(flags, ewma_chain(shift).mean_within(DAYS))


@pytest.mark.parametrize("shift", [0.0, 1.0, -2.0])
def test_run_lengths_of_the_cumulative_sum_agree_with_its_chain(shift: float, days: Array) -> None:
    """The side of the shift has the chain's run length; the other side raises no alarm."""
    up, down = cusum(days + shift)
    to, off = (up, down) if shift >= 0 else (down, up)
    agrees(to > CUSUM_LIMIT, cusum_chain(abs(shift)).mean_within(DAYS))
    if shift == 0:
        agrees(off > CUSUM_LIMIT, cusum_chain().mean_within(DAYS))
    else:
        assert not (off > CUSUM_LIMIT).any()


def test_the_cumulative_sum_is_the_recursion(days: Array) -> None:
    """The oracle is C = max(0, C + x - k), day by day."""
    x = days[0, :200]
    up = down = 0.0
    for day, (high, low) in enumerate(zip(*cusum(x), strict=True)):
        up, down = max(0.0, up + x[day] - 0.5), max(0.0, down - x[day] - 0.5)
        assert (high, low) == pytest.approx((up, down), abs=1e-12)


def test_the_moving_range_alarms_as_often_as_it_should(days: Array) -> None:
    """The difference of two days is normal with √2 σ; the limit is D4 = 3.267 mean ranges."""
    assert pytest.approx(3.267, abs=5e-4) == RANGE_LIMIT * sqrt(np.pi) / 2
    broken = moving_range(days)[:, 1::2] > RANGE_LIMIT  # every second difference: independent ones
    expected = 2 * norm.sf(RANGE_LIMIT / sqrt(2))
    assert abs(broken.mean() - expected) < 4 * sqrt(expected / broken.size)
    assert np.isnan(moving_range(days)[:, 0]).all()


RULE_DAYS: list[tuple[int, list[float], list[int]]] = [
    (1, [0, 3.1, 0, -3.1, 2.9], [1, 3]),
    (2, [2.1, 0, 2.1, 0, 0, 2.1, -2.1, 2.1], [2, 7]),
    (2, [2.1, -2.1, 0, 2.1], []),
    (3, [1.1, 1.1, 0, 1.1, 1.1, 0.9], [4]),
    (4, [0.1] * 9 + [-0.1] * 8, [7, 8, 16]),
]


@pytest.mark.parametrize(("rule", "x", "flagged"), RULE_DAYS)
def test_rules_flag_the_days_counted_by_hand(rule: int, x: list[float], flagged: list[int]) -> None:
    """Counted by hand; a day within its limit completes no pattern."""
    assert np.flatnonzero(breaks(np.array(x), rule)).tolist() == flagged


def test_a_block_of_laboratories_equals_each_one_alone(days: Array) -> None:
    """The last axis is the days; leading axes are laboratories."""
    block = days[:6, :50].reshape(2, 3, 50)
    for operate in (ewma, moving_range, lambda x: cusum(x)[0], lambda x: breaks(x, 2)):
        together: Callable[[Array], Array] = operate
        assert np.array_equal(together(block)[1, 2], together(block[1, 2]), equal_nan=True)


def test_the_baseline_agrees_with_a_hand_calculation() -> None:
    """Ranges 2, 4, 2 have the mean 8/3; divided by d2 = 1.1284 it is 2.3633."""
    baseline = Baseline.of([5.0, 7.0, 3.0, 5.0])
    assert baseline.centre == 5.0
    assert baseline.sigma == pytest.approx(2.36327, rel=1e-5)
    assert baseline.standardise([5.0, 7.36327]).tolist() == pytest.approx([0, 1], abs=1e-5)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 1.0, 1.0]])
def test_a_useless_baseline_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError, match="baseline"):
        Baseline.of(values)


def test_a_chart_begins_after_its_baseline() -> None:
    """Four days of baseline, then two in control and one far from the mean."""
    charted = control_chart([-1, 1, -1, 1, 0.1, -0.1, 30.0], 4)
    sudden = {
        RULES[1].words,
        "moving range",
        "moving average (EWMA)",
        "cumulative sum (CUSUM)",
    }
    for name, flags in charted.alarms.items():
        assert flags.tolist() == [False, False, name in sudden], name
    assert charted.ranges * charted.baseline.sigma == pytest.approx([0.9, 0.2, 30.1])
    calm = control_chart([-1, 1, -1, 1, 0.1], 4)
    assert len(calm.alarms) == 7
    assert not any(flags.any() for flags in calm.alarms.values())
    with pytest.raises(ValueError, match="leave none"):
        control_chart([-1, 1, -1, 1], 4)
