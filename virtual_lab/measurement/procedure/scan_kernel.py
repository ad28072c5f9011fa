"""Compiled logic of a scan: valid hits, best impact position, and next shots.

Arrays (shot,) hold the shots of one laboratory in the order fired. Functions of a block take the
shots of all laboratories one after another. Their argument `starts`, (laboratory + 1,), holds the
index of the first shot of each laboratory, and at its end the total number. A shot belongs to a
position if it is within half a setting step of it.
"""

from __future__ import annotations

from math import erfc, exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import INNER, Array, Mask

LEAST = 1e-9  # rounding [m]


class ScanRules(NamedTuple):
    """Rules of a scan, with lengths in meters."""

    low: float
    high: float
    coarse_step: float
    fine_step: float
    coarse_hits: int
    fit_half_width: float
    final_hits: int
    consecutive: bool
    valid_hits: int  # number of hits per position
    attempts: int
    tolerance: float  # half a setting step


@njit(**INNER)
def max_scan_shots(rules: ScanRules) -> int:
    """Return an upper limit for the number of shots that a scan can need in one round."""
    positions = int((rules.high - rules.low) / min(rules.coarse_step, rules.fine_step)) + 2
    return positions * max(rules.coarse_hits, rules.valid_hits) + rules.final_hits


@njit(**INNER)
def is_at(position: float, at: float, tolerance: float) -> bool:
    """Return whether a shot at `position` is at most `tolerance` away from the position `at` [m].

    The comparison allows for rounding errors. A distance of exactly `tolerance` gives True.
    """
    return bool(abs(position - at) < tolerance + LEAST)


@njit(**INNER)
def count_scan_hits(position: Array, valid: Mask, rules: ScanRules, counted: Mask) -> None:
    """Fill `counted` with a mask of the hits that count for a scan.

    These are the first `rules.valid_hits` valid hits at each position. All arrays are (shot,), for
    the shots of one laboratory in the order fired. Every value of `counted` is overwritten.
    """
    for shot in range(position.size):
        counted[shot] = False
        if valid[shot]:
            before = 0
            for earlier in range(shot):
                if valid[earlier] and is_at(position[earlier], position[shot], rules.tolerance):
                    before += 1
            counted[shot] = before < rules.valid_hits


@njit(**INNER)
def mean_at(
    at: float, most: int, position: Array, valid: Mask, objective: Array, tolerance: float
) -> tuple[int, float]:
    """Return the number of hits used at a position, and the mean of `objective` over these hits.

    `objective` is the quantity that the procedure maximizes. The used hits are valid and within
    `tolerance` [m] of the position `at` [m]. At most `most` hits are used, in the order of firing.
    Without hits the mean is 0. The arrays are (shot,).
    """
    count, total = 0, 0.0
    for shot in range(position.size):
        if count < most and valid[shot] and is_at(position[shot], at, tolerance):
            count += 1
            total += objective[shot]
    return count, total / max(count, 1)


@njit(**INNER)
def best_of(
    among: Array, most: int, position: Array, valid: Mask, objective: Array, rules: ScanRules
) -> int:
    """Return the index of the position in `among` with the largest mean objective.

    The mean is over the first `most` valid hits within `rules.tolerance` [m] of the position. A
    position without hits has the mean 0. The index is 0 if `among` is empty. All positions are
    distances from the barrel tip [m].

    Parameters
    ----------
    among
        Positions to compare.
    position
        Impact position of each hit, (shot,).
    valid
        Whether each hit is valid, (shot,).
    objective
        Quantity that the procedure maximizes, for each hit, (shot,).
    """
    best, top = 0, -np.inf
    for k in range(among.size):
        _, mean = mean_at(among[k], most, position, valid, objective, rules.tolerance)
        if mean > top:
            best, top = k, mean
    return best


@njit(cache=True)
def find_final_hits(
    best: float, position: Array, valid: Mask, rules: ScanRules, fresh: NDArray[np.int64]
) -> int:
    """Fill `fresh` with the indices of the final hits at `best` [m]. Return the number of hits.

    `best` is the position that the scan chose. The first `rules.valid_hits` valid hits at this
    position belong to the scan. All later valid hits at this position are final hits. If the
    procedure requires consecutive final hits, an invalid shot at the position discards the final
    hits before it. Elements of `fresh` beyond the returned number have no meaning. `fresh` must
    have at least as many elements as there are shots.
    """
    count, of_scan = 0, 0
    for shot in range(position.size):
        if not is_at(position[shot], best, rules.tolerance):
            continue
        if valid[shot] and of_scan < rules.valid_hits:
            of_scan += 1
        elif valid[shot]:
            fresh[count] = shot
            count += 1
        elif rules.consecutive:
            count = 0
    return count


@njit(**INNER)
def next_hits(position: Array, valid: Mask, objective: Array, rules: ScanRules, out: Array) -> int:
    """Fill `out` with the positions of the next shots of one laboratory [m]. Return their number.

    The number is 0 if the scan is complete. It is also 0 if at every position most balls did not
    rebound. The number is not limited by the attempts left. `out` must have at least as many
    elements as `max_scan_shots` returns. Elements beyond the number are not overwritten.
    """
    coarse = np.arange(rules.low, rules.high + LEAST, rules.coarse_step)
    coarse = _hopeful(coarse, rules.coarse_hits, position, objective, rules.tolerance)
    lacking: int = _lacking(coarse, rules.coarse_hits, position, valid, rules.tolerance, out)
    if lacking or not coarse.size:
        return lacking
    middle = coarse[best_of(coarse, rules.coarse_hits, position, valid, objective, rules)]
    below = int((middle - rules.low + LEAST) / rules.fine_step)
    above = int((rules.high - middle + LEAST) / rules.fine_step)
    fine = middle + rules.fine_step * np.arange(-below, above + 1)
    fine = _hopeful(fine, rules.valid_hits, position, objective, rules.tolerance)
    # The fit of a curve needs more positions than the two neighbors of the best one.
    rings = 1 if rules.final_hits else 2
    settled = False
    while not settled:
        for ring in range(rings):
            limit = rules.fine_step if ring == 0 else rules.fit_half_width
            around = fine[np.abs(fine - middle) < limit + LEAST]
            lacking = _lacking(around, rules.valid_hits, position, valid, rules.tolerance, out)
            if lacking:
                return lacking
            # The result refers to the best of all positions.
            complete = _complete(fine, position, valid, rules)
            if not complete.size:
                return 0
            best = complete[best_of(complete, rules.valid_hits, position, valid, objective, rules)]
            settled = best == middle
            if not settled:
                middle = best
                break
    fresh = np.empty(position.size, np.int64)
    more = max(rules.final_hits - find_final_hits(middle, position, valid, rules, fresh), 0)
    out[:more] = middle
    return more


@njit(cache=True)
def next_hits_of_block(
    starts: NDArray[np.int64],
    position: Array,
    valid: Mask,
    objective: Array,
    rules: ScanRules,
    number: NDArray[np.int64],
    out: Array,
) -> None:
    """Write the number and the positions of the next shots of each laboratory.

    Parameters
    ----------
    starts
        Index of the first shot of each laboratory, and at the end the total number of shots,
        (laboratory + 1,).
    position
        Impact position of each shot so far [m], (shot,).
    valid
        Whether each shot is a valid hit, (shot,).
    objective
        Value of the quantity that the scan maximizes, (shot,).
    rules
        Rules of the scan.
    number
        Result: number of next shots, (laboratory,). It is 0 in three cases: the scan is complete,
        no attempts are left, or at every position most balls did not rebound.
    out
        Result: positions of the next shots [m], (laboratory, attempts). The elements beyond
        `number` are not overwritten.
    """
    positions = np.empty(max_scan_shots(rules))
    for laboratory in range(number.size):
        rows = slice(starts[laboratory], starts[laboratory + 1])
        request = next_hits(position[rows], valid[rows], objective[rows], rules, positions)
        remaining = max(rules.attempts - (starts[laboratory + 1] - starts[laboratory]), 0)
        number[laboratory] = min(request, remaining)
        for shot in range(number[laboratory]):  # a slice takes seconds more to compile
            out[laboratory, shot] = positions[shot]


class Scanned(NamedTuple):
    """Results of the scans of a block, arrays (laboratory,) that `scans_of_block` fills."""

    complete: NDArray[np.int64]  # number of positions with all their hits
    best: Array  # best of these positions [m]
    below: Mask  # whether a complete position is next to it on this side
    above: Mask
    result: NDArray[np.int64]  # number of hits in the result


@njit(cache=True)
def scans_of_block(
    starts: NDArray[np.int64],
    position: Array,
    valid: Mask,
    objective: Array,
    rules: ScanRules,
    scans: Scanned,
    used: Mask,
    near: Mask,
) -> None:
    """Fill `scans` with the results of the scans of a block, and `used` and `near` with masks.

    A block is a group of laboratories. A position is complete if it has as many valid hits as the
    rules require. If a laboratory has no complete position, its best position is NaN and its mask
    is False.

    The mask `used`, (shot,), is True for the hits from which the result of a laboratory is
    computed:

    * Some procedures require final hits: further hits at the best position after the scan. In this
      case, they are the last `rules.final_hits` of these hits.
    * Otherwise, they are the hits of the scan within `rules.fit_half_width` of the best position.

    The mask `near`, (shot,), is True for the hits of the scan within twice `rules.fit_half_width`.

    In `position`, `valid` and `objective`, laboratory i has the shots from `starts[i]` up to, but
    not including, `starts[i + 1]`.
    """
    for laboratory in range(scans.best.size):
        rows = slice(starts[laboratory], starts[laboratory + 1])
        at, good, goal, mine = position[rows], valid[rows], objective[rows], used[rows]
        complete, counted = _select_complete(at, good, rules)
        mine[:] = False
        around = near[rows]
        count_scan_hits(at, good, rules, around)
        scans.complete[laboratory], scans.result[laboratory] = complete.size, 0
        scans.best[laboratory], scans.below[laboratory], scans.above[laboratory] = (
            np.nan,
            False,
            False,
        )
        if not complete.size:
            continue
        best = complete[best_of(complete, rules.valid_hits, at, good, goal, rules)]
        scans.best[laboratory] = best
        neighbours = complete[_next_to(best, complete, rules)]
        scans.below[laboratory], scans.above[laboratory] = (
            (neighbours < best).any(),
            (neighbours > best).any(),
        )
        around &= np.abs(at - best) < 2 * rules.fit_half_width + 4 * rules.tolerance
        if rules.final_hits:
            fresh = np.empty(at.size, np.int64)
            count = find_final_hits(best, at, good, rules, fresh)
            mine[fresh[max(count - rules.final_hits, 0) : count]] = True
        else:
            for shot in range(at.size):
                is_near = abs(at[shot] - best) < rules.fit_half_width + 4 * rules.tolerance
                mine[shot] = counted[shot] and is_near
        scans.result[laboratory] = mine.sum()


@njit(cache=True)
def shortfalls_of_block(
    starts: NDArray[np.int64],
    position: Array,
    valid: Mask,
    metric: Array,
    rules: ScanRules,
    mean: Array,
    square: Array,
) -> None:
    """Fill `mean` and `square` with the expected shortfall and its expected square, per scan.

    A scan tests several positions along the barrel, and one of them is chosen. The shortfall is the
    amount by which an adjacent position is truly better than the chosen one. The true amount is
    unknown. Its normal distribution is described in `choice.shortfalls`.

    Parameters
    ----------
    starts
        First shot of each laboratory. Laboratory i has the shots from `starts[i]` up to, but not
        including, `starts[i + 1]`.
    position, valid, metric
        Impact position, validity and metric of each shot, (shot,).
    rules
        Rules of the scan. A position is complete if it has as many valid hits as they require.
    mean
        Overwritten with the expected shortfall, (laboratory,), in the unit of the metric. It is 0
        if no position is complete, or if the hits do not scatter.
    square
        Overwritten with the expected square of the shortfall, (laboratory,), in the squared unit of
        the metric. It is 0 in the same cases.
    """
    for laboratory in range(mean.size):
        rows = slice(starts[laboratory], starts[laboratory + 1])
        at, good, read = position[rows], valid[rows], metric[rows]
        complete, counted = _select_complete(at, good, rules)
        mean[laboratory], square[laboratory] = 0.0, 0.0
        if not complete.size:
            continue
        means, scatter, freedom = np.empty(complete.size), 0.0, -complete.size
        for k in range(complete.size):
            mine = read[counted & (_round_position(at) == complete[k])]
            means[k] = mine.mean()
            scatter += ((mine - means[k]) ** 2).sum()
            freedom += mine.size
        u = sqrt(2 * scatter / freedom / rules.valid_hits) if freedom > 0 else 0.0
        if not u > 0:
            continue
        best = best_of(complete, rules.valid_hits, at, good, read, rules)
        for neighbour in np.flatnonzero(_next_to(complete[best], complete, rules)):
            deficit = (means[neighbour] - means[best]) / u
            share, density = erfc(-deficit / sqrt(2)) / 2, exp(-(deficit**2) / 2) / sqrt(2 * pi)
            mean[laboratory] += u * (deficit * share + density)
            square[laboratory] += u**2 * ((1 + deficit**2) * share + deficit * density)


@njit(**INNER)
def _round_position(position: Array) -> Array:
    """Return positions rounded to a micrometer, which removes rounding errors of sums."""
    return np.rint(position * 1e6) / 1e6


@njit(**INNER)
def _sort_distinct(values: Array) -> Array:
    """Return the distinct values in ascending order. `np.unique` takes seconds more to compile."""
    distinct, count = np.empty(values.size), 0
    for value in values:
        k = count
        while k and distinct[k - 1] >= value:
            k -= 1
        if k == count or distinct[k] != value:
            for other in range(count, k, -1):
                distinct[other] = distinct[other - 1]
            distinct[k] = value
            count += 1
    return distinct[:count]


@njit(**INNER)
def _select_complete(position: Array, valid: Mask, rules: ScanRules) -> tuple[Array, Mask]:
    """Return the positions with all hits of a scan, and the mask of these hits."""
    counted = np.empty(position.size, np.bool_)
    count_scan_hits(position, valid, rules, counted)
    at = _round_position(position)
    positions = _sort_distinct(at[counted])
    full = np.empty(positions.size, np.bool_)
    for k in range(positions.size):
        mine = counted & (at == positions[k])
        full[k] = mine.sum() >= rules.valid_hits
        if not full[k]:
            counted[mine] = False
    return positions[full], counted


@njit(**INNER)
def _next_to(best: float, complete: Array, rules: ScanRules) -> Mask:
    """Return a mask of the complete positions next to the best one."""
    distance = np.abs(complete - best)
    return (distance > 1e-6) & (distance < rules.fine_step + 4 * rules.tolerance)


@njit(**INNER)
def _hopeful(
    positions: Array, hits: int, position: Array, objective: Array, tolerance: float
) -> Array:
    """Return the positions at which the maximum can be.

    A position is left out if at least `hits` balls did not rebound there and at most as many did.
    The bat returns almost no speed at such a position.
    """
    hopeful = np.ones(positions.size, np.bool_)
    for k in range(positions.size):
        misses, rebounds = 0, 0
        for shot in range(position.size):
            if is_at(position[shot], positions[k], tolerance):
                is_rebound = np.isfinite(objective[shot])
                rebounds += is_rebound
                misses += not is_rebound
        hopeful[k] = misses < hits or rebounds > misses
    return positions[hopeful]


@njit(**INNER)
def _hits(at: float, position: Array, valid: Mask, tolerance: float) -> int:
    count = 0
    for shot in range(position.size):
        count += valid[shot] and is_at(position[shot], at, tolerance)
    return count


@njit(**INNER)
def _lacking(
    positions: Array, hits: int, position: Array, valid: Mask, tolerance: float, out: Array
) -> int:
    """Fill `out` with each position that lacks hits, once per missing hit. Return their number."""
    count = 0
    for at in positions:
        for _ in range(hits - _hits(at, position, valid, tolerance)):
            out[count] = at
            count += 1
    return count


@njit(**INNER)
def _complete(positions: Array, position: Array, valid: Mask, rules: ScanRules) -> Array:
    full = np.empty(positions.size, np.bool_)
    for k in range(positions.size):
        full[k] = _hits(positions[k], position, valid, rules.tolerance) >= rules.valid_hits
    return positions[full]
