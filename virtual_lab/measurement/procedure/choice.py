"""Correction of a scan for the possibility that a neighbor of the chosen position is better.

The measurand is the largest value over the positions. The final hits measure the value at the
chosen position, which on average is lower. The result is corrected by the mean of this shortfall,
and its remaining variation is a component of the uncertainty.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.procedure.schedule import scan_rules, sort_by_laboratory
from virtual_lab.uncertainty.budget import Budgets, combine_components, type_a_component
from virtual_lab.units import Array, Mask

CHOICE = "choice of the place"  # name of the component in a budget


class Shortfalls(NamedTuple):
    """Expected shortfall of the chosen position, in the metric's unit, (laboratory,)."""

    mean: Array
    rms: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties after the correction by the mean."""
        return np.sqrt(np.maximum(self.rms**2 - self.mean**2, 0.0))


def shortfalls(
    procedure: Procedure,
    laboratories: int,
    owner: NDArray[np.intp],
    position: Array,
    valid: Mask,
    metric: Array,
) -> Shortfalls:
    """Return the mean and the rms value of the shortfall of each scan, (laboratory,).

    Both are in the unit of the metric. A scan chooses the impact position with the best measured
    value. The shortfall is the amount by which an adjacent position is truly better than the chosen
    one. If the adjacent position is not better, the shortfall is 0.

    The true difference of two positions is unknown. It is assumed to be normally distributed. The
    center of this distribution is the measured difference. Its standard deviation follows from the
    scatter of the hits at each position. The mean and the mean square of the shortfall are computed
    for this distribution, and added for the two adjacent positions.

    The result is 0 in three cases:

    * no position was chosen;
    * the hits do not scatter;
    * the procedure does not average final hits at one position.

    The parameters are described in `hit_weights_of`.
    """
    scan, mean, square = procedure.scan, *np.zeros((2, laboratories))
    if scan is not None and scan.final_hits:
        from virtual_lab.measurement.procedure.scan_kernel import shortfalls_of_block

        order, starts = sort_by_laboratory(owner, laboratories)
        columns = position[order], valid[order], metric[order]
        shortfalls_of_block(starts, *columns, scan_rules(procedure, scan), mean, square)
    return Shortfalls(mean, np.sqrt(square))


def add_shortfall(metric: Budgets, shortfall: Shortfalls) -> Budgets:
    """Return the budgets of a block, with the mean shortfall of each laboratory added to its value.

    The procedure chooses the impact position with the best measured metric. A neighboring position
    may truly be better. The shortfall is the amount by which it is better, in the unit of the
    metric, or 0. `shortfall` holds the mean and the uncertainty of each shortfall, see
    `shortfalls`. This standard uncertainty becomes the component `CHOICE` of each budget. If all
    shortfalls are 0, the budgets are returned unchanged.
    """
    if not (shortfall.rms > 0).any():
        return metric
    components = metric.components + type_a_component(CHOICE, shortfall.mean, shortfall.u)
    return replace(
        combine_components(metric.value + shortfall.mean, components), scatter=metric.scatter
    )


def variances_within(
    owner: NDArray[np.intp], position: Array, metric: Array, laboratories: int
) -> tuple[Array, Array]:
    """Return the variance of hits at the same impact position, and its freedom, (laboratory,).

    The deviation of a hit is taken from the mean of the hits at its position. The variance is
    pooled over all positions of a laboratory. It has the unit of `metric`, squared. `owner`,
    `position` and `metric` are the laboratory, the position [m] and the value of each hit, (hit,).
    The variance is NaN, and its degrees of freedom are 0, if no position of a laboratory has two
    hits.
    """
    of, inverse = np.unique(owner + 1j * np.round(position, 6), return_inverse=True)
    counts = np.bincount(inverse)
    deviation = metric - (np.bincount(inverse, metric) / counts)[inverse]
    whose = of.real.astype(np.intp)
    freedom = np.asarray(np.bincount(whose, counts - 1, laboratories), dtype=float)
    square = np.bincount(owner, deviation**2, laboratories)
    variance = square / np.where(freedom > 0, freedom, np.nan)
    return np.asarray(variance), freedom
