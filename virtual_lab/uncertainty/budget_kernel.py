"""Compiled weighted sums of hits, their scatter, and sums of budgets, for each laboratory.

Each sum adds the hits of one laboratory in order, so its last bits do not depend on the other
laboratories. A hit of weight 0 is left out, even if its value is NaN.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import INNER, KERNEL, Array

Whole = NDArray[np.int64]


@njit(**KERNEL, error_model="numpy")
def weigh(hits: Array, weights: Array, out: Array) -> None:
    """Fill `out`, (laboratory, set), with the weighted sum of the hits for each set of constants.

    Each set has a value of every calibration constant and reading. `hits` has the values of the
    hits, (laboratory, set, hit). `weights` is (laboratory, hit). A hit of weight 0 is left out even
    if it is NaN.
    """
    for laboratory in range(len(hits)):
        for k in range(hits.shape[1]):
            total = 0.0
            for hit in range(hits.shape[2]):
                weight = weights[laboratory, hit]
                if weight != 0.0:
                    total += weight * hits[laboratory, k, hit]
            out[laboratory, k] = total


@njit(**KERNEL, error_model="numpy")
def scatter_u(hits: Array, weights: Array, places: Array, effects: Array, out: Array) -> None:
    """Fill `out`, (6, laboratory), with the scatter of weighted sums of hits.

    The variance of a hit is computed within each impact position, and then averaged over the
    positions with weights. A part of it is explained by the uncertainties of the calibration
    constants. A hit of weight 0 is left out. For a laboratory without hits, the variances are NaN.
    The six rows are:

    * u of the sum, caused by the scatter of the hits;
    * degrees of freedom of this u;
    * sum of the squared weights;
    * variance of a hit;
    * variance of a hit minus the explained part, which can be negative;
    * degrees of freedom of the variance of a hit.

    Parameters
    ----------
    hits, weights, places
        Values, weights and impact positions, (laboratory, hit).
    effects
        Effect of one standard uncertainty of each constant on each hit, (laboratory, constant,
        hit).
    out
        Result, (6, laboratory).
    """
    count = hits.shape[1]
    order, begin = np.empty(count, np.int64), np.empty(count + 1, np.int64)
    observed, explained, squares = np.empty((3, count))
    for laboratory in range(len(hits)):
        weight = weights[laboratory]
        many = _group_hits(weight, places[laboratory], order, begin)
        observed[:many], explained[:many] = 0.0, 0.0
        _add_variance(hits[laboratory], order, begin[: many + 1], squares, observed)
        for constant in range(effects.shape[1]):
            effect = effects[laboratory, constant]
            _add_variance(effect, order, begin[: many + 1], squares, explained)
        total, uncertain, weighing, all_variance, unexplained, hits_free = (
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )
        for at in range(many):
            square = 0.0
            for hit in order[begin[at] : begin[at + 1]]:
                square += weight[hit] ** 2
            total += square * max(observed[at] - explained[at], 0.0)
            weighing += square
            all_variance += square * observed[at]
            unexplained += square * (observed[at] - explained[at])
            # The subtraction of a known part does not change the uncertainty of a variance.
            freedom = begin[at + 1] - begin[at] - 1
            hits_free += freedom
            if freedom > 0:
                uncertain += (square * observed[at]) ** 2 / freedom
        out[0, laboratory] = sqrt(total)
        out[1, laboratory] = total**2 / uncertain if total > 0 and uncertain > 0 else inf
        out[2, laboratory] = weighing
        out[3, laboratory] = all_variance / weighing
        out[4, laboratory] = unexplained / weighing
        out[5, laboratory] = all_variance**2 / uncertain if uncertain > 0 else hits_free


@njit(**INNER, error_model="numpy")
def _group_hits(weight: Array, places: Array, order: Whole, begin: Whole) -> int:
    """Fill in the indices of the used hits, sorted by position, and the start of each position.

    Return the number of positions.
    """
    positions, hits = 0, 0
    for hit in range(weight.size):
        done = weight[hit] == 0.0
        for i in range(hits):
            done |= places[order[i]] == places[hit]
        if done:
            continue
        begin[positions] = hits
        for later in range(hit, weight.size):
            if weight[later] != 0.0 and places[later] == places[hit]:
                order[hits] = later
                hits += 1
        positions += 1
    begin[positions] = hits
    return positions


@njit(**INNER, error_model="numpy")
def _add_variance(values: Array, order: Whole, begin: Whole, squares: Array, out: Array) -> None:
    """Add the variance of the values within each position to `out`.

    A position with a single hit gets the pooled variance of the others. `squares` is overwritten.
    """
    pooled, freedom = 0.0, 0
    for at in range(begin.size - 1):
        mean, square, many = 0.0, 0.0, begin[at + 1] - begin[at]
        for i in range(begin[at], begin[at + 1]):
            mean += values[order[i]]
        mean /= many
        for i in range(begin[at], begin[at + 1]):
            square += (values[order[i]] - mean) ** 2
        squares[at] = square
        pooled += square
        freedom += many - 1
    pooled /= max(freedom, 1)
    for at in range(begin.size - 1):
        many = begin[at + 1] - begin[at]
        out[at] += squares[at] / (many - 1) if many > 1 else pooled


@njit(**KERNEL, error_model="numpy")
def add_lines(effect: Array, dof: Array, line: Whole, square: Array, freedom: Array) -> None:
    """Add up the variances of the sources in each line of a budget, and fill in degrees of freedom.

    Parameters
    ----------
    effect, dof
        Effect of one standard uncertainty of each source, and its degrees of freedom, (laboratory,
        source).
    line
        Index of the budget line of each source, (source,).
    square
        Variances, (laboratory, line). The squared effects are added to the numbers already in it.
    freedom
        Overwritten with the degrees of freedom of the first source in each line, (laboratory,
        line).
    """
    for laboratory in range(len(effect)):
        for source in range(line.size - 1, -1, -1):
            row = line[source]
            freedom[laboratory, row] = dof[laboratory, source]
            square[laboratory, row] += effect[laboratory, source] ** 2


@njit(**KERNEL, error_model="numpy")
def welch_satterthwaite(square: Array, freedom: Array, u: Array, dof: Array) -> None:
    """Fill `u` and `dof`, (laboratory,), with the combined uncertainty and degrees of freedom.

    The equation is GUM G.2b. `square` are the variances of the budget lines, and `freedom` their
    degrees of freedom, both (laboratory, line). u is the root of the sum of the variances. A u of 0
    has inf degrees of freedom.
    """
    for laboratory in range(len(square)):
        variance, fourth = 0.0, 0.0
        for line in range(square.shape[1]):
            variance += square[laboratory, line]
            fourth += square[laboratory, line] ** 2 / freedom[laboratory, line]
        u[laboratory] = sqrt(variance)
        dof[laboratory] = variance**2 / fourth if fourth > 0 else inf
