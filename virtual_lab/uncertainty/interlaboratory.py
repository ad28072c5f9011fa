"""Laboratories compared: nested analysis of variance, and tests of consistency.

Every laboratory measures the same item with several lots, and repeats the test with each lot.
Variances and tests follow ISO 5725-2 and ISO 5725-3; the statistics h and k follow ASTM E691.
Leading axes of all results are data sets.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.errors import InputError
from virtual_lab.units import Array

STRAGGLER, OUTLIER = 0.05, 0.01  # significance levels of Cochran's and Grubbs's tests (ISO 5725-2)
CONSISTENCY = 0.005  # significance level of h and k (ASTM E691)


@dataclass(frozen=True, slots=True, kw_only=True)
class NestedStudy:
    """Variances and consistency of laboratories, arrays (...,) with one entry per data set.

    Variances are unbiased, so they can be negative. Standard deviations are 0 in that case.
    """

    laboratories: int
    lots: int  # lots per laboratory
    repeats: int  # repeats per lot
    mean: Array
    repeat_variance: Array
    lot_variance: Array  # NaN with one lot per laboratory; laboratory_variance then includes it
    laboratory_variance: Array
    repeat_mean_square: Array
    lot_mean_square: Array  # mean square of the repeats if there is only one lot
    laboratory_mean_square: Array
    h: Array  # deviation of each laboratory's mean, in standard deviations, (..., laboratory)
    k: Array  # scatter of each laboratory's repeats, in units of s_r, (..., laboratory)
    cochran: Array  # largest variance of repeats of a laboratory over the sum of these variances

    @property
    def repeatability(self) -> Array:
        """s_r: standard deviation of repeats in one laboratory with one lot."""
        return np.sqrt(self.repeat_variance)

    @property
    def lot_sd(self) -> Array:
        """s_lot: standard deviation between the lots of one laboratory."""
        return np.sqrt(np.maximum(self.lot_variance, 0.0))

    @property
    def laboratory_sd(self) -> Array:
        """s_L: standard deviation between laboratories."""
        return np.sqrt(np.maximum(self.laboratory_variance, 0.0))

    @property
    def reproducibility(self) -> Array:
        """s_R: standard deviation of single tests in different laboratories."""
        return np.sqrt(self.repeat_variance + self.laboratory_sd**2 + np.nan_to_num(self.lot_sd**2))

    @property
    def reproducibility_u(self) -> Array:
        """Standard uncertainty of s_R, from unbiased variances of the mean squares."""
        p, q, n = self.laboratories, self.lots, self.repeats
        lines = (
            (self.laboratory_mean_square / (q * n), p - 1),
            (self.lot_mean_square * (q - 1) / (q * n), p * max(q - 1, 1)),
            (self.repeat_mean_square * (n - 1) / n, p * q * (n - 1)),
        )
        # 2 MS²/(dof + 2) is unbiased for the variance of a mean square
        variance = sum((2 * part**2 / (dof + 2) for part, dof in lines), np.zeros(self.mean.shape))
        return np.asarray(np.sqrt(variance) / (2 * self.reproducibility))

    @property
    def grubbs(self) -> Array:
        """Grubbs's statistic of the most extreme mean of a laboratory: the largest |h|."""
        return np.asarray(np.abs(self.h).max(axis=-1))

    def cochran_limit(self, level: float = STRAGGLER) -> float:
        """Return the critical value of `cochran`, dimensionless, for a significance level."""
        return cochran_limit(self.laboratories, self.lots * (self.repeats - 1), level)

    def grubbs_limit(self, level: float = STRAGGLER) -> float:
        """Return the critical value of `grubbs`, dimensionless; NaN for two laboratories."""
        return grubbs_limit(self.laboratories, level)

    def h_limit(self, level: float = CONSISTENCY) -> float:
        """Return the critical value of |h|, dimensionless; NaN for two laboratories."""
        return h_limit(self.laboratories, level)

    def k_limit(self, level: float = CONSISTENCY) -> float:
        """Return the critical value of k, dimensionless, for a significance level."""
        return k_limit(self.laboratories, self.lots * (self.repeats - 1), level)


def nested_study(values: ArrayLike) -> NestedStudy:
    """Return variances within and between laboratories, and statistics of their consistency.

    Every laboratory has the same number of lots, and repeats the test equally often with each lot.
    The variances are unbiased estimates. The variances between laboratories and between lots can
    therefore be negative; their standard deviations are then 0. With one lot per laboratory,
    `lot_variance` is NaN, and the other results are those of ISO 5725-2 and ASTM E691.

    The results are arrays (...), one entry per data set. Means and standard deviations are in the
    unit of the values, and variances in its square. Cochran's statistic and the statistics h and k
    are dimensionless; h and k have the shape (..., laboratory).

    Parameters
    ----------
    values
        Results of the tests, shape (..., laboratory, lot, repeat), in any one unit. Leading axes
        are data sets.

    Raises
    ------
    InputError
        The shape is not allowed, there are fewer than two laboratories or two repeats, a value is
        not finite, or all values of a data set are equal.
    """
    results = np.asarray(values, float)
    shape = results.shape
    if results.ndim < 3 or 0 in shape:
        allowed = "allowed: (..., laboratory, lot, repeat)"
        raise InputError("", "shape of the values", shape, allowed)
    p, q, n = shape[-3:]
    for key, count in (("laboratories", p), ("repeats", n)):
        if count < 2:
            raise InputError("", key, count, "allowed: at least 2")
    if not np.isfinite(results).all():
        raise InputError("", "values", None, "allowed: finite numbers")
    first = results[..., :1, :1, :1]
    if (results == first).all(axis=(-3, -2, -1)).any():
        allowed = "all results are equal, so their scatter is unknown; allowed: results that differ"
        raise InputError("", "values", float(first.flat[0]), allowed)
    results = results - first  # the squares of a large mean would hide the scatter
    lots = results.mean(axis=-1)
    means = lots.mean(axis=-1)
    grand = means.mean(axis=-1)
    within = np.sum((results - lots[..., None]) ** 2, axis=(-2, -1)) / (q * (n - 1))
    repeat = within.mean(axis=-1)
    scatter = np.sum((means - grand[..., None]) ** 2, axis=-1) / (p - 1)
    laboratory, lot = q * n * scatter, repeat
    if q > 1:
        lot = n * np.sum((lots - means[..., None]) ** 2, axis=(-2, -1)) / (p * (q - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return NestedStudy(
            laboratories=p,
            lots=q,
            repeats=n,
            mean=first[..., 0, 0, 0] + grand,
            repeat_variance=repeat,
            lot_variance=(lot - repeat) / n if q > 1 else np.full(grand.shape, np.nan),
            laboratory_variance=(laboratory - lot) / (q * n),
            repeat_mean_square=repeat,
            lot_mean_square=lot,
            laboratory_mean_square=laboratory,
            h=(means - grand[..., None]) / np.sqrt(scatter)[..., None],
            k=np.sqrt(within / repeat[..., None]),
            cochran=within.max(axis=-1) / within.sum(axis=-1),
        )


def cochran_limit(groups: int, dof: int, level: float) -> float:
    """Return the critical value of Cochran's test (ISO 5725-2), dimensionless.

    The statistic is the largest of `groups` variances divided by their sum. Each variance has `dof`
    degrees of freedom. By chance, the statistic exceeds the limit with a probability of `level`.
    The limit is NaN for a single group.
    """
    from scipy.stats import f

    return float(1 / (1 + (groups - 1) / f.isf(level / groups, dof, dof * (groups - 1))))


def grubbs_limit(groups: int, level: float) -> float:
    """Return the critical value of Grubbs's test of the most extreme mean, dimensionless.

    The statistic is the largest absolute deviation of one of `groups` means from the overall mean,
    divided by the standard deviation of the means. By chance, it exceeds the limit with a
    probability of `level`. The limit is NaN for fewer than three groups.
    """
    return h_limit(groups, level / groups)


def h_limit(groups: int, level: float) -> float:
    """Return the critical value of |h| for one of `groups` means (ASTM E691), dimensionless.

    The statistic h is the deviation of a mean from the overall mean, divided by the standard
    deviation of the means. By chance, |h| exceeds the limit with a probability of `level`. The
    limit is NaN for fewer than three groups.
    """
    from scipy.stats import t

    if groups < 3:
        return np.nan
    square = float(t.isf(level / 2, groups - 2)) ** 2
    return (groups - 1) * sqrt(square / (groups * (groups - 2 + square)))


def k_limit(groups: int, dof: int, level: float) -> float:
    """Return the critical value of k for one of `groups` groups (ASTM E691), dimensionless.

    The statistic k is the standard deviation within a group, divided by the pooled standard
    deviation of all groups. Each group has `dof` degrees of freedom. By chance, k exceeds the limit
    with a probability of `level`. The limit is NaN for a single group.
    """
    from scipy.stats import f

    return sqrt(groups / (1 + (groups - 1) / f.isf(level, dof, dof * (groups - 1))))
