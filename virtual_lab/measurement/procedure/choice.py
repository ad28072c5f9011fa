"""Correction for the choice of a scan's place, if a neighbour is in fact better.

The measurand is the greatest value over the places. Fresh hits give the value of the chosen
place, which is lower on average. The result is corrected by the mean shortfall; the rest is a
component of the uncertainty.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.procedure.schedule import in_turn_of, scan_rules
from virtual_lab.uncertainty.budget import Budgets, combined, types_a
from virtual_lab.units import Array, Mask

CHOICE = "choice of the place"  # its line in a budget


class Shortfalls(NamedTuple):
    """Shortfalls of chosen places against the best, in the unit of the metric, (laboratory,)."""

    mean: Array
    rms: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties after correction for the mean."""
        return np.sqrt(np.maximum(self.rms**2 - self.mean**2, 0.0))


def shortfalls(
    procedure: Procedure,
    laboratories: int,
    owner: NDArray[np.intp],
    place: Array,
    valid: Mask,
    metric: Array,
) -> Shortfalls:
    """Return the expected shortfalls of the places chosen by scans, from their hits.

    The true difference to each neighbour is taken as normal about the difference of the means,
    with the scatter within the places; its positive part is the shortfall. 0 if no place was
    chosen, or if the result is no mean at one place. Parameters as `outcomes_of`.
    """
    scan, mean, square = procedure.scan, *np.zeros((2, laboratories))
    if scan is not None and scan.final_hits:
        from virtual_lab.measurement.procedure.scan_kernel import shortfalls_of_block

        order, starts = in_turn_of(owner, laboratories)
        own = place[order], valid[order], metric[order]
        shortfalls_of_block(starts, *own, scan_rules(procedure, scan), mean, square)
    return Shortfalls(mean, np.sqrt(square))


def with_choice(metric: Budgets, lost: Shortfalls) -> Budgets:
    """Return the results of a block corrected for their shortfalls, unchanged if there is none."""
    if not (lost.rms > 0).any():
        return metric
    components = metric.components + types_a(CHOICE, lost.mean, lost.u)
    return replace(combined(metric.value + lost.mean, components), scatter=metric.scatter)


def variances_within(
    owner: NDArray[np.intp], place: Array, metric: Array, laboratories: int
) -> Array:
    """Return the variances of hits about the mean of their place, pooled, (laboratory,).

    `owner` is the laboratory of each hit. NaN where no place has several.
    """
    of, back = np.unique(owner + 1j * np.round(place, 6), return_inverse=True)
    many = np.bincount(back)
    off = metric - (np.bincount(back, metric) / many)[back]
    whose = of.real.astype(np.intp)
    freedom = np.bincount(whose, many - 1, laboratories)
    square = np.bincount(owner, off**2, laboratories)
    return np.where(freedom > 0, square / np.where(freedom > 0, freedom, 1.0), np.nan)
