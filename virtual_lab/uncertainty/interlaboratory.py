"""Laboratories compared: nested analysis of variance, and tests of consistency.

Every laboratory measures the same item with several lots, and repeats the test with each lot.
Variances and tests follow ISO 5725-2 and ISO 5725-3; the statistics h and k follow ASTM E691.
Numbers of lots and repeats may differ. Leading axes of all results are data sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array, Mask

STRAGGLER, OUTLIER = 0.05, 0.01  # significance levels of Cochran's and Grubbs's tests (ISO 5725-2)
CONSISTENCY = 0.005  # significance level of h and k (ASTM E691)


@dataclass(frozen=True, slots=True, kw_only=True)
class NestedStudy:
    """Variances and consistency of laboratories, arrays (...,) with one entry per data set.

    Variances are unbiased, so they can be negative. Standard deviations are 0 in that case.
    """

    # number of repeats, (laboratory, lot); 0 for a lot that a laboratory lacks
    counts: NDArray[np.int_]
    mean: Array  # mean of all results
    repeat_variance: Array
    lot_variance: Array  # NaN with one lot per laboratory; laboratory_variance then includes it
    laboratory_variance: Array
    repeat_mean_square: Array
    lot_mean_square: Array  # mean square of the repeats if there is only one lot
    laboratory_mean_square: Array
    h: Array  # deviation of each laboratory's mean, in standard deviations, (..., laboratory)
    # scatter of each laboratory's repeats, in units of s_r, (..., laboratory); NaN without repeats
    k: Array
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
        lot_dof, repeat_dof = _freedom(self.counts)
        in_lot, in_lots, in_laboratory = _numbers(self.counts)
        laboratory, lot = 1 / in_laboratory, (1 - in_lots / in_laboratory) / in_lot
        lines = (
            (self.laboratory_mean_square * laboratory, len(self.counts) - 1),
            (self.lot_mean_square * lot, max(lot_dof.sum(), 1)),
            (self.repeat_mean_square * (1 - laboratory - lot), repeat_dof.sum()),
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
        return cochran_limit(len(self.counts), self._usual_dof, level)

    def grubbs_limit(self, level: float = STRAGGLER) -> float:
        """Return the critical value of `grubbs`, dimensionless; NaN for two laboratories."""
        return grubbs_limit(len(self.counts), level)

    def h_limit(self, level: float = CONSISTENCY) -> float:
        """Return the critical value of |h|, dimensionless; NaN for two laboratories."""
        return h_limit(len(self.counts), level)

    def k_limit(self, level: float = CONSISTENCY) -> float:
        """Return the critical value of k, dimensionless, for a significance level."""
        return k_limit(len(self.counts), self._usual_dof, level)

    @property
    def _usual_dof(self) -> int:
        """Degrees of freedom of the repeats of most laboratories, as ISO 5725-2 uses them."""
        return int(np.bincount(_freedom(self.counts)[1]).argmax())


def nested_study(
    values: ArrayLike,
    laboratories: Sequence[Any] | None = None,
    lots: Sequence[Any] | None = None,
) -> NestedStudy:
    """Return variances within and between laboratories, and statistics of their consistency.

    The variances are unbiased estimates, also with unequal numbers of lots or repeats (analysis of
    variance of a nested design). The variances between laboratories and between lots can therefore
    be negative; their standard deviations are then 0. With one lot per laboratory, `lot_variance`
    is NaN, and the other results are those of ISO 5725-2 and ASTM E691. With unequal numbers, the
    uncertainty of s_R is approximate, and the limits of Cochran's test and of k are those of the
    number of repeats that most laboratories have.

    The results are arrays (...), one entry per data set. Means and standard deviations are in the
    unit of the values, and variances in its square. Cochran's statistic and the statistics h and k
    are dimensionless; h and k have the shape (..., laboratory).

    Parameters
    ----------
    values
        Results of the tests in any one unit, with the shape (..., laboratory, lot, repeat). Leading
        axes are data sets. Or nested lists of unequal lengths, for one data set. Or the shape (n,),
        if `laboratories` is given.
    laboratories
        Label of the laboratory of each result, length n. Laboratories keep the order of their first
        labels.
    lots
        Label of the lot of each result, length n. Equal labels in two laboratories are two lots. By
        default each laboratory has one lot.

    Raises
    ------
    InputError
        The shape is not allowed, the number of labels differs from the number of results, there are
        fewer than two laboratories, no laboratory has two repeats with a lot, a value is not
        finite, or all values of a data set are equal.
    """
    results, present = _table(values, laboratories, lots)
    counts = present.sum(axis=-1)
    for key, count in (("laboratories", len(counts)), ("repeats", counts.max())):
        if count < 2:
            raise InputError("", key, int(count), "allowed: at least 2")
    rows = results[..., present]
    if not np.isfinite(rows).all():
        raise InputError("", "values", None, "allowed: finite numbers")
    first = rows[..., :1]
    if (rows == first).all(axis=-1).any():
        allowed = "all results are equal, so their scatter is unknown; allowed: results that differ"
        raise InputError("", "values", float(first.flat[0]), allowed)
    # the squares of a large mean would hide the scatter
    results = np.where(present, results - first[..., None, None], 0.0)
    tests, (lot_dof, repeat_dof) = counts.sum(axis=-1), _freedom(counts)
    in_lot, in_lots, in_laboratory = _numbers(counts)
    cells = results.sum(axis=-1) / np.maximum(counts, 1)
    means = results.sum(axis=(-2, -1)) / tests
    grand, deviation = means @ tests / tests.sum(), means - means.mean(axis=-1, keepdims=True)
    within = np.sum(present * (results - cells[..., None]) ** 2, axis=(-2, -1))
    repeat = lot = within.sum(axis=-1) / repeat_dof.sum()
    if lot_dof.any():
        lot = np.sum(counts * (cells - means[..., None]) ** 2, axis=(-2, -1)) / lot_dof.sum()
    lot_variance = (lot - repeat) / in_lot
    laboratory = (means - grand[..., None]) ** 2 @ tests / (len(tests) - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        variances = within / repeat_dof
        return NestedStudy(
            counts=counts,
            mean=first[..., 0] + grand,
            repeat_variance=repeat,
            lot_variance=lot_variance if lot_dof.any() else np.full(grand.shape, np.nan),
            laboratory_variance=(laboratory - repeat - in_lots * lot_variance) / in_laboratory,
            repeat_mean_square=repeat,
            lot_mean_square=lot,
            laboratory_mean_square=laboratory,
            h=deviation / deviation.std(axis=-1, ddof=1, keepdims=True),
            k=np.sqrt(variances / repeat[..., None]),
            cochran=np.nanmax(variances, axis=-1) / np.nansum(variances, axis=-1),
        )


def _table(
    values: Any, laboratories: Sequence[Any] | None, lots: Sequence[Any] | None
) -> tuple[Array, Mask]:
    """Return results, (..., laboratory, lot, repeat), and a mask of the last three axes.

    The mask is False where a laboratory has fewer lots than others, or a lot fewer repeats.
    """
    allowed = "allowed: (..., laboratory, lot, repeat), or (n,) with n labels"
    if laboratories is None and _has_equal_lengths(values):
        results = np.asarray(values, float)
        if results.ndim < 3 or 0 in results.shape:
            raise InputError("", "shape of the values", results.shape, allowed)
        return results, np.ones(results.shape[-3:], bool)
    cells: dict[tuple[Any, Any], list[float]] = {}
    try:
        if laboratories is None:
            of_lots = ((i, j, lot) for i, each in enumerate(values) for j, lot in enumerate(each))
            tests = [(i, j, value) for i, j, lot in of_lots for value in lot]
        else:
            lots = [""] * len(values) if lots is None else lots
            tests = list(zip(laboratories, lots, values, strict=True))
        for laboratory, lot, value in tests:
            cells.setdefault((laboratory, lot), []).append(float(value))
        rows, columns = (list(dict.fromkeys(labels)) for labels in zip(*cells, strict=True))
        shape = len(rows), len(columns), max(map(len, cells.values()))
        results, present = np.zeros(shape), np.zeros(shape, bool)
        for (row, column), cell in cells.items():
            at = rows.index(row), columns.index(column), slice(len(cell))
            results[at], present[at] = cell, True
    except (TypeError, ValueError) as fault:
        raise InputError("", "values", None, allowed) from fault
    return results, present


def _has_equal_lengths(values: Any) -> bool:
    try:
        np.asarray(values, float)
    except ValueError:
        return False
    return True


def _freedom(counts: NDArray[np.int_]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return the degrees of freedom of lots and of repeats, each (laboratory,)."""
    lots = np.sum(counts > 0, axis=-1)
    return lots - 1, counts.sum(axis=-1) - lots


def _numbers(counts: NDArray[np.int_]) -> tuple[float, float, float]:
    """Return the factors of the variances in the expected mean squares, for unequal `counts`.

    The mean square of lots contains the variance of lots multiplied by the first factor. That of
    laboratories contains the variance of lots multiplied by the second factor, and that of
    laboratories by the third one. With equal counts the first two are the number of repeats per
    lot, and the third one is the number per laboratory. Without lots the first factor is 1.
    """
    tests, dof, lot_dof = counts.sum(axis=-1), len(counts) - 1, _freedom(counts)[0].sum()
    per_lot = float(np.sum(counts**2 / tests[:, None]))
    return (
        (float(tests.sum()) - per_lot) / lot_dof if lot_dof else 1.0,
        (per_lot - np.sum(counts**2) / tests.sum()) / dof,
        (tests.sum() - np.sum(tests**2) / tests.sum()) / dof,
    )


def cochran_limit(groups: int, dof: int, level: float) -> float:
    """Return the critical value of Cochran's test (ISO 5725-2), dimensionless.

    The statistic is the largest of `groups` variances divided by their sum. Each variance has `dof`
    degrees of freedom. By chance, the statistic exceeds the limit with a probability of `level`.
    The limit is NaN for a single group.
    """
    from scipy.special import fdtri  # scipy.stats would take another half second to load

    return float(1 / (1 + (groups - 1) / fdtri(dof, dof * (groups - 1), 1 - level / groups)))


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
    from scipy.special import stdtrit

    if groups < 3:
        return np.nan
    square = float(stdtrit(groups - 2, level / 2)) ** 2
    return (groups - 1) * sqrt(square / (groups * (groups - 2 + square)))


def k_limit(groups: int, dof: int, level: float) -> float:
    """Return the critical value of k for one of `groups` groups (ASTM E691), dimensionless.

    The statistic k is the standard deviation within a group, divided by the pooled standard
    deviation of all groups. Each group has `dof` degrees of freedom. By chance, k exceeds the limit
    with a probability of `level`. The limit is NaN for a single group.
    """
    from scipy.special import fdtri

    return sqrt(groups / (1 + (groups - 1) / fdtri(dof, dof * (groups - 1), 1 - level)))
