"""Precision studies by analysis of variance: groups of readings (ISO 5725-2), gauges (AIAG).

The standard deviation of a component is 0 if the estimate of its variance is negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array

POOLED_ABOVE = 0.25  # p-value above which an interaction is pooled with repeatability (AIAG MSA)
DISTINCT = 1.41  # factor of the number of distinct categories (AIAG MSA)


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A source of variation: sum of squares and degrees of freedom."""

    ss: float
    dof: float

    @property
    def ms(self) -> float:
        return self.ss / self.dof


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupStudy:
    """Scatter of readings in groups, such as laboratories: within groups, between groups, total."""

    mean: float
    between: Line
    within: Line
    repeatability: float  # s_r, within a group
    between_sd: float  # s_L
    reproducibility: float  # s_R: √(s_r² + s_L²)

    @property
    def f(self) -> float:
        return self.between.ms / self.within.ms


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeStudy:
    """Parts measured by operators: sums of squares and standard deviations of all sources."""

    parts: Line
    operators: Line
    interaction: Line
    trials: Line
    pooled: bool  # whether the interaction is part of the repeatability
    repeatability: float  # EV
    operator_sd: float  # AV without interaction
    interaction_sd: float
    gauge: float  # GRR: repeatability, operators and interaction
    part_sd: float  # PV
    total: float  # TV

    @property
    def percent(self) -> float:
        """The gauge's part of the total standard deviation, in percent."""
        return 100 * self.gauge / self.total

    @property
    def categories(self) -> float:
        """Number of distinct categories of parts."""
        return DISTINCT * self.part_sd / self.gauge


def group_study(values: ArrayLike, groups: Sequence[Any]) -> GroupStudy:
    """Return repeatability and reproducibility of readings in groups (ISO 5725-2).

    Parameters
    ----------
    values
        Readings, shape (n,), in any one unit; the results have the same unit.
    groups
        Label of the group of each reading, length n, for example its laboratory. Groups may differ
        in size.

    Raises
    ------
    InputError
        There are fewer than two groups, no group has two readings, the number of labels differs
        from the number of readings, a reading is not finite, or all readings are equal.
    """
    readings, (which,) = _read(values, [groups])
    counts = np.bincount(which)
    if counts.size < 2 or readings.size <= counts.size:
        allowed = "allowed: at least 2 groups, and one of them with 2 readings"
        raise InputError("", "groups", counts.tolist(), allowed)
    # The offset is subtracted because the squares of a large offset would hide the scatter.
    offset, readings = readings[0], readings - readings[0]
    means = np.bincount(which, readings) / counts
    grand = float(readings.mean())
    between = Line(ss=float(counts @ (means - grand) ** 2), dof=counts.size - 1.0)
    residual = float(np.sum((readings - means[which]) ** 2))
    within = Line(ss=residual, dof=float(readings.size - counts.size))
    size = (readings.size - np.sum(counts**2) / readings.size) / between.dof
    group_sd = _root((between.ms - within.ms) / size)
    return GroupStudy(
        mean=float(offset) + grand,
        between=between,
        within=within,
        repeatability=sqrt(within.ms),
        between_sd=group_sd,
        reproducibility=sqrt(within.ms + group_sd**2),
    )


def gauge_study(values: ArrayLike, parts: Sequence[Any], operators: Sequence[Any]) -> GaugeStudy:
    """Return the gauge repeatability and reproducibility of readings (AIAG MSA, crossed design).

    Each operator measures each part equally often. The interaction of part and operator is pooled
    with the repeatability if its p-value is above 0.25.

    Parameters
    ----------
    values
        Readings, shape (n,), in any one unit; the results have the same unit.
    parts, operators
        Labels of the part and of the operator of each reading, each of length n.

    Raises
    ------
    InputError
        An operator did not measure a part as often as the others, there are fewer than two parts,
        operators or repeats, the number of labels differs from the number of readings, a reading is
        not finite, or all readings are equal.
    """
    from scipy.special import fdtrc

    readings, (part, operator) = _read(values, [parts, operators])
    p, o = part.max() + 1, operator.max() + 1
    counts = np.bincount(part * o + operator, minlength=p * o)
    n = int(counts[0])
    if p < 2 or o < 2 or n < 2 or np.any(counts != n):
        allowed = "allowed: every operator measures every part equally often, twice or more"
        raise InputError("", "readings of a part by an operator", sorted(set(counts)), allowed)
    table = (readings - readings[0])[np.lexsort((operator, part))].reshape(p, o, n)
    cells, grand = table.mean(axis=2), table.mean()
    of_part, of_operator = cells.mean(axis=1), cells.mean(axis=0)
    rest = cells - of_part[:, None] - of_operator + grand
    lines: dict[str, Any] = {
        "parts": Line(ss=float(o * n * np.sum((of_part - grand) ** 2)), dof=p - 1.0),
        "operators": Line(ss=float(p * n * np.sum((of_operator - grand) ** 2)), dof=o - 1.0),
        "interaction": Line(ss=float(n * np.sum(rest**2)), dof=(p - 1.0) * (o - 1)),
        "trials": Line(ss=float(np.sum((table - cells[:, :, None]) ** 2)), dof=p * o * (n - 1.0)),
    }
    both, trials = lines["interaction"], lines["trials"]
    f = both.ms / trials.ms if trials.ss else nan
    pooled = bool(fdtrc(both.dof, trials.dof, f) > POOLED_ABOVE)
    if pooled:
        trials = both = Line(ss=both.ss + trials.ss, dof=both.dof + trials.dof)
    squares = {
        "repeatability": trials.ms,
        "operator_sd": (lines["operators"].ms - both.ms) / (p * n),
        "interaction_sd": (both.ms - trials.ms) / n,
        "part_sd": (lines["parts"].ms - both.ms) / (o * n),
    }
    sds: dict[str, Any] = {name: _root(square) for name, square in squares.items()}
    gauge = sqrt(sum(sd**2 for name, sd in sds.items() if name != "part_sd"))
    total = sqrt(gauge**2 + sds["part_sd"] ** 2)
    return GaugeStudy(**lines, **sds, pooled=pooled, gauge=gauge, total=total)


def _read(
    values: ArrayLike, labels: Sequence[Sequence[Any]]
) -> tuple[Array, list[NDArray[np.int_]]]:
    """Return the readings and, for each row of labels, the index of each reading's label."""
    readings = np.asarray(values, float)
    if readings.ndim != 1 or not np.isfinite(readings).all() or readings.size == 0:
        raise InputError("", "values", f"shape {readings.shape}", "allowed: finite numbers (n,)")
    if np.ptp(readings) == 0:
        allowed = "all readings are equal, so their scatter is unknown; use a finer instrument"
        raise InputError("", "values", readings[0], allowed)
    numbers = []
    for row in labels:
        if len(row) != readings.size:
            raise InputError("", "labels", len(row), f"allowed: one per reading, {readings.size}")
        order = {label: at for at, label in enumerate(dict.fromkeys(row))}
        numbers.append(np.array([order[label] for label in row]))
    return readings, numbers


def _root(variance: float) -> float:
    return sqrt(max(variance, 0.0))
