"""Correction for the choice of a scan's place, if a neighbour is in fact better.

The measurand is the greatest value over the places. Fresh hits give the value of the chosen
place, which is lower on average. The result is corrected by the mean shortfall; the rest is a
component of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.outcome import complete_places, neighbours
from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.procedure.schedule import best_place, same_place, scan_hits
from virtual_lab.uncertainty.budget import Budgets, combined, types_a
from virtual_lab.units import Array, Mask

CHOICE = "choice of the place"  # its line in a budget


class Shortfall(NamedTuple):
    """Shortfall of the chosen place against the best one, in the unit of the metric."""

    mean: float
    rms: float

    @property
    def u(self) -> float:
        """Standard uncertainty after correction for the mean."""
        return sqrt(max(self.rms**2 - self.mean**2, 0.0))


def shortfall(procedure: Procedure, place: Array, valid: Mask, metric: Array) -> Shortfall:
    """Return the expected shortfall of the place chosen by a scan, from its hits.

    The true difference to each neighbour is taken as normal about the difference of the means,
    with the scatter within the places; its positive part is the shortfall. 0 if no place was
    chosen, or if the result is no mean at one place. Parameters as `outcome_of`.
    """
    from scipy.special import ndtr  # half a second to load, that a page must not wait for

    scan = procedure.scan
    if scan is None or not scan.final_hits:
        return Shortfall(0.0, 0.0)
    complete = complete_places(procedure, place, valid)
    counted = scan_hits(procedure, place, valid) & np.isin(np.round(place, 6), complete)
    best = best_place(procedure, complete, place, valid, metric)
    u = sqrt(2 * variance_within(place[counted], metric[counted]) / procedure.valid_hits)
    if not u > 0:
        return Shortfall(0.0, 0.0)
    here = metric[counted & same_place(place, best)].mean()
    means, squares = [], []
    for other in neighbours(scan, complete, best):
        behind = (metric[counted & same_place(place, other)].mean() - here) / u
        density = np.exp(-(behind**2) / 2) / sqrt(2 * np.pi)
        means.append(u * (behind * ndtr(behind) + density))
        squares.append(u**2 * ((1 + behind**2) * ndtr(behind) + behind * density))
    return Shortfall(float(sum(means)), sqrt(float(sum(squares))))


def with_choice(metric: Budgets, lost: Sequence[Shortfall]) -> Budgets:
    """Return the results of a block corrected for their shortfalls, unchanged if there is none."""
    if not any(each.rms > 0 for each in lost):
        return metric
    mean, u = np.array([(each.mean, each.u) for each in lost]).T
    return combined(metric.value + mean, metric.components + types_a(CHOICE, mean, u))


def variance_within(place: Array, metric: Array) -> float:
    """Return the variance of hits about the mean of their place, pooled; NaN of single hits."""
    alone = np.zeros(place.size, dtype=np.intp)
    return float(variances_within(alone, place, metric, 1)[0])


def variances_within(
    owner: NDArray[np.intp], place: Array, metric: Array, laboratories: int
) -> Array:
    """Return the same of each laboratory, (laboratory,); `owner` says whose each hit is."""
    of, back = np.unique(np.stack([owner, np.round(place, 6)]), axis=1, return_inverse=True)
    many = np.bincount(back)
    off = metric - (np.bincount(back, metric) / many)[back]
    whose = of[0].astype(np.intp)
    freedom = np.bincount(whose, many - 1, laboratories)
    square = np.bincount(owner, off**2, laboratories)
    return np.where(freedom > 0, square / np.where(freedom > 0, freedom, 1.0), np.nan)
