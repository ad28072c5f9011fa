"""Control charts of a check standard: limits from a baseline, and the days beyond them.

The charts are Shewhart's chart of individual values with the Western Electric rules, its moving
range, the exponentially weighted moving average (EWMA) and the cumulative sum (CUSUM); see
Montgomery, Introduction to Statistical Quality Control. Each chart takes values in standard
deviations from the center, shape ``(..., day)``, and runs along the last axis, so that many
laboratories can be charted at once.

Mean number of days to the first false alarm, if center and standard deviation are known exactly:
370 for rule 1 (225, 166 and 153 together with rule 2, 3 or 4, and 92 with all), 500 for the EWMA,
465 for the CUSUM, and 119 for the moving range. After a short baseline these numbers vary widely
from laboratory to laboratory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from virtual_lab.units import Array, Mask

RANGE_MEAN = 2 / sqrt(pi)  # d2: mean range of two values [standard deviations]
RANGE_LIMIT = RANGE_MEAN + 3 * sqrt(2 - RANGE_MEAN**2)  # d2 + 3 d3: limit of the range
WEIGHT, CUSUM_LIMIT, CUSUM_SLACK = 0.2, 5.0, 0.5
EWMA_LIMIT = 2.962 * sqrt(WEIGHT / (2 - WEIGHT))


class Run(NamedTuple):
    """Pattern: `need` of `of` consecutive days deviate by over `beyond` sigma to the same side."""

    need: int
    of: int
    beyond: float
    words: str


RULES: Mapping[int, Run] = {
    1: Run(1, 1, 3.0, "1 day beyond 3 sigma"),
    2: Run(2, 3, 2.0, "2 of 3 days beyond 2 sigma"),
    3: Run(4, 5, 1.0, "4 of 5 days beyond 1 sigma"),
    4: Run(8, 8, 0.0, "8 days on one side"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """Center and standard deviation of a check standard in control, in the unit of its values."""

    centre: float
    sigma: float

    @classmethod
    def of(cls, values: ArrayLike) -> Baseline:
        """Return the baseline of days in control, shape (day,).

        The standard deviation is the mean moving range divided by d2.

        Raises
        ------
        ValueError
            There are fewer than 2 days, or all values are equal.
        """
        days = np.asarray(values, dtype=float)
        if days.ndim != 1 or days.size < 2:
            raise ValueError(f"a baseline needs at least 2 days, not {days.size}")
        sigma = float(np.abs(np.diff(days)).mean()) / RANGE_MEAN
        if not sigma > 0:
            raise ValueError("a baseline of equal values has no limits")
        return cls(centre=float(days.mean()), sigma=sigma)

    def standardise(self, values: ArrayLike) -> Array:
        """Return values in standard deviations from the center."""
        return (np.asarray(values, dtype=float) - self.centre) / self.sigma


def breaks(x: Array, rule: int) -> Mask:
    """Return a mask of the days that complete a pattern of Western Electric rule 1, 2, 3 or 4.

    `x` are deviations from the center in standard deviations, (…, day), and the mask has their
    shape. All deviations of a pattern are on the same side of the center. A pattern cannot begin
    before the first day of `x`. Raises `KeyError` for another rule.
    """
    run = RULES[rule]
    pattern_days = np.zeros(x.shape, dtype=bool)
    for side in (x, -x):
        beyond = side > run.beyond
        count = np.concatenate(
            [np.zeros((*x.shape[:-1], 1), dtype=int), beyond.cumsum(axis=-1)], -1
        )
        before = np.maximum(np.arange(1, x.shape[-1] + 1) - run.of, 0)
        pattern_days |= beyond & (count[..., 1:] - count[..., before] >= run.need)
    return pattern_days


def moving_range(x: Array) -> Array:
    """Return the absolute change of each day's value from the previous day, NaN on the first day.

    The last axis of `x` is the day. The result has the shape and the unit of `x`.
    """
    return np.abs(np.diff(x, axis=-1, prepend=np.nan))


def ewma(x: Array) -> Array:
    """Return the exponentially weighted moving average of each day, in the shape of `x`, (…, day).

    `x` are deviations from the center in standard deviations, and the average has the same unit.
    The newest day has the weight 0.2, and the average starts at 0 before the first day.
    """
    return np.asarray(lfilter([WEIGHT], [1.0, WEIGHT - 1.0], x, axis=-1))


def cusum(x: Array) -> tuple[Array, Array]:
    """Return two cumulative sums of deviations: above the center and below it, both ≥ 0.

    `x` are deviations in standard deviations, (…, day). Both sums have the shape and unit of `x`.
    The sum above the center is S = max(0, S₋ + x - 0.5), and the sum below it is S = max(0, S₋ - x
    - 0.5). S₋ is the sum of the previous day, and 0 on the first day.
    """
    up, down = (_above(side - CUSUM_SLACK) for side in (x, -x))
    return up, down


def _above(steps: Array) -> Array:
    total = steps.cumsum(axis=-1)
    return total - np.minimum(np.minimum.accumulate(total, axis=-1), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DayCharts:
    """Charts of the days after a baseline; arrays of shape (day,), in standard deviations."""

    baseline: Baseline
    baseline_days: int
    standardised: Array
    ranges: Array
    average: Array
    sum_up: Array
    sum_down: Array
    alarms: Mapping[str, Mask]  # days with an alarm, by rule or chart


def control_chart(values: ArrayLike, baseline_days: int) -> DayCharts:
    """Return the charts of daily values with limits from the first `baseline_days` values.

    The result has one element per day after the baseline. It has the values themselves, their
    moving range, their moving average (EWMA) and their cumulative sums (CUSUM), all in standard
    deviations of the baseline. EWMA and CUSUM start at 0. The first moving range is the change from
    the last day of the baseline.

    The result also has a mask of the days with an alarm for each Western Electric rule, and for the
    limits of range, EWMA and CUSUM. The Western Electric rules ignore the days of the baseline.

    Parameters
    ----------
    values
        One value per day, in any unit, shape (day,).
    baseline_days
        Number of days of the baseline, at least 2.

    Raises
    ------
    ValueError
        The baseline is too short or has equal values, or no day follows it.
    """
    days = np.asarray(values, dtype=float)
    baseline = Baseline.of(days[:baseline_days])
    if not days.size > baseline_days:
        raise ValueError(f"{days.size} days leave none after a baseline of {baseline_days}")
    every = baseline.standardise(days)
    x, ranges = every[baseline_days:], moving_range(every)[baseline_days:]
    average, (up, down) = ewma(x), cusum(x)
    alarms = {RULES[rule].words: breaks(x, rule) for rule in RULES}
    alarms["moving range"] = ranges > RANGE_LIMIT
    alarms["moving average (EWMA)"] = np.abs(average) > EWMA_LIMIT
    alarms["cumulative sum (CUSUM)"] = np.maximum(up, down) > CUSUM_LIMIT
    return DayCharts(
        baseline=baseline,
        baseline_days=baseline_days,
        standardised=x,
        ranges=ranges,
        average=average,
        sum_up=up,
        sum_down=down,
        alarms=alarms,
    )
