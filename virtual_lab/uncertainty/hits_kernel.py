"""Weighted sums of hits and their scatter, laboratory by laboratory; compiled.

A sum goes over the hits of one laboratory in turn, so its bits do not depend on those of others
beside it. A hit of weight 0 is left out, whatever its value.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import Array

Whole = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def weigh(hits: Array, weights: Array, out: Array) -> None:
    """Fill in sums over the hits, (laboratory, k), of (laboratory, k, hit) by (laboratory, hit)."""
    for laboratory in range(len(hits)):
        for k in range(hits.shape[1]):
            total = 0.0
            for hit in range(hits.shape[2]):
                weight = weights[laboratory, hit]
                if weight != 0.0:
                    total += weight * hits[laboratory, k, hit]
            out[laboratory, k] = total


@njit(cache=True, error_model="numpy")
def scatter_u(
    hits: Array, weights: Array, places: Array, effects: Array, u: Array, dof: Array
) -> None:
    """Fill in u and degrees of freedom of weighted sums of hits, (laboratory,), see `scatter`.

    Parameters
    ----------
    hits, weights, places
        (laboratory, hit).
    effects
        Of one standard uncertainty of each constant, (laboratory, constant, hit).
    """
    count = hits.shape[1]
    place, many = np.empty(count, np.int64), np.empty(count, np.int64)
    seen, explained, one, square, means = np.empty((5, count))
    for laboratory in range(len(hits)):
        weight = weights[laboratory]
        places_hit = _grouped(weight, places[laboratory], place, many)
        square[:], explained[:] = 0.0, 0.0
        for hit in range(count):
            if weight[hit] != 0.0:
                square[place[hit]] += weight[hit] ** 2
        _variance(hits[laboratory], weight, place, many[:places_hit], means, seen)
        for constant in range(effects.shape[1]):
            _variance(effects[laboratory, constant], weight, place, many[:places_hit], means, one)
            for at in range(places_hit):
                explained[at] += one[at]
        total, uncertain = 0.0, 0.0
        for at in range(places_hit):
            total += square[at] * max(seen[at] - explained[at], 0.0)
            # a variance is as uncertain as before when a known part of it is taken off
            if many[at] > 1:
                uncertain += (square[at] * seen[at]) ** 2 / (many[at] - 1)
        u[laboratory] = sqrt(total)
        dof[laboratory] = total**2 / uncertain if total > 0 and uncertain > 0 else inf


@njit(cache=True, error_model="numpy")
def _grouped(weight: Array, places: Array, place: Whole, many: Whole) -> int:
    """Fill in the number of each hit's place, in the order of first hits; return how many."""
    found = 0
    for hit in range(weight.size):
        if weight[hit] == 0.0:
            continue
        place[hit] = found
        for other in range(hit):
            if weight[other] != 0.0 and places[other] == places[hit]:
                place[hit] = place[other]
                break
        if place[hit] == found:
            many[found] = 0
            found += 1
        many[place[hit]] += 1
    return found


@njit(cache=True, error_model="numpy")
def _variance(
    values: Array, weight: Array, place: Whole, many: Whole, means: Array, out: Array
) -> None:
    """Fill in the variance of values within each place; of a single one that of the others.

    `means` are overwritten.
    """
    means[: many.size] = 0.0
    for hit in range(values.size):
        if weight[hit] != 0.0:
            means[place[hit]] += values[hit]
    for at in range(many.size):
        means[at] /= many[at]
        out[at] = 0.0
    for hit in range(values.size):
        if weight[hit] != 0.0:
            out[place[hit]] += (values[hit] - means[place[hit]]) ** 2
    pooled, freedom = 0.0, 0
    for at in range(many.size):
        pooled += out[at]
        freedom += many[at] - 1
    pooled /= max(freedom, 1)
    for at in range(many.size):
        out[at] = out[at] / (many[at] - 1) if many[at] > 1 else pooled
