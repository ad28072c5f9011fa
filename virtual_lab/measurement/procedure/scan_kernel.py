"""Which hits of a scan count, which place is best and where to hit next; compiled.

Arrays are those of one laboratory's shots in the order fired, (shot,), but for functions of a
block, which take all shots, laboratory after laboratory, and `starts`, (laboratory + 1,): where the
shots of each begin, and where the last ones end. Shots were set at a place if they lie within half
a step of setting of it.
"""

from __future__ import annotations

from math import erfc, exp, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask

LEAST = 1e-9  # m, a rounding


class ScanRules(NamedTuple):
    """What a scan asks for, lengths in metres."""

    low: float
    high: float
    coarse_step: float
    fine_step: float
    coarse_hits: int
    fit_half_width: float
    final_hits: int
    consecutive: bool
    valid_hits: int  # at a place
    attempts: int
    reach: float  # half a step of setting


@njit(cache=True)
def most_asked(rules: ScanRules) -> int:
    """Return how many shots a round may ask for at most."""
    places = int((rules.high - rules.low) / min(rules.coarse_step, rules.fine_step)) + 2
    return places * max(rules.coarse_hits, rules.valid_hits) + rules.final_hits


@njit(cache=True)
def is_at(place: float, at: float, reach: float) -> bool:
    """Return whether a shot was set at a place."""
    return bool(abs(place - at) < reach + LEAST)


@njit(cache=True)
def count_scan_hits(place: Array, valid: Mask, rules: ScanRules, counted: Mask) -> None:
    """Mark which hits are the scan's: at each place the first `valid_hits` valid ones."""
    for shot in range(place.size):
        counted[shot] = False
        if valid[shot]:
            before = 0
            for other in range(shot):
                if valid[other] and is_at(place[other], place[shot], rules.reach):
                    before += 1
            counted[shot] = before < rules.valid_hits


@njit(cache=True)
def mean_at(
    at: float, most: int, place: Array, valid: Mask, sought: Array, reach: float
) -> tuple[int, float]:
    """Return the number of the first valid hits at a place, up to `most`, and the mean sought."""
    many, total = 0, 0.0
    for shot in range(place.size):
        if many < most and valid[shot] and is_at(place[shot], at, reach):
            many += 1
            total += sought[shot]
    return many, total / max(many, 1)


@njit(cache=True)
def best_of(
    among: Array, most: int, place: Array, valid: Mask, sought: Array, rules: ScanRules
) -> int:
    """Return which of some places has the greatest mean of the first `most` hits there."""
    best, top = 0, -np.inf
    for k in range(among.size):
        _, mean = mean_at(among[k], most, place, valid, sought, rules.reach)
        if mean > top:
            best, top = k, mean
    return best


@njit(cache=True)
def fresh_hits(
    best: float, place: Array, valid: Mask, rules: ScanRules, fresh: NDArray[np.int64]
) -> int:
    """Fill in the numbers of the final hits that count at the best place; return how many.

    They come after those of the scan; if the procedure asks for consecutive ones, an invalid shot
    there begins them again.
    """
    many, of_scan = 0, 0
    for shot in range(place.size):
        if not is_at(place[shot], best, rules.reach):
            continue
        if valid[shot] and of_scan < rules.valid_hits:
            of_scan += 1
        elif valid[shot]:
            fresh[many] = shot
            many += 1
        elif rules.consecutive:
            many = 0
    return many


@njit(cache=True)
def next_hits(place: Array, valid: Mask, sought: Array, rules: ScanRules, out: Array) -> int:
    """Fill in the places to fire at next, one a shot; return how many, 0 when all is done."""
    coarse = np.arange(rules.low, rules.high + LEAST, rules.coarse_step)
    coarse = _hopeful(coarse, rules.coarse_hits, place, sought, rules.reach)
    lacking = _lacking(coarse, rules.coarse_hits, place, valid, rules.reach, out)
    if lacking or not coarse.size:
        return lacking
    middle = coarse[best_of(coarse, rules.coarse_hits, place, valid, sought, rules)]
    below = int((middle - rules.low + LEAST) / rules.fine_step)
    above = int((rules.high - middle + LEAST) / rules.fine_step)
    fine = middle + rules.fine_step * np.arange(-below, above + 1)
    fine = _hopeful(fine, rules.valid_hits, place, sought, rules.reach)
    # a curve is fitted over more places than the neighbours
    rings = 1 if rules.final_hits else 2
    settled = False
    while not settled:
        for ring in range(rings):
            reach = rules.fine_step if ring == 0 else rules.fit_half_width
            around = fine[np.abs(fine - middle) < reach + LEAST]
            lacking = _lacking(around, rules.valid_hits, place, valid, rules.reach, out)
            if lacking:
                return lacking
            # the result will be taken about the best of all the places, wherever it lies
            complete = _complete(fine, place, valid, rules)
            if not complete.size:
                return 0
            best = complete[best_of(complete, rules.valid_hits, place, valid, sought, rules)]
            settled = best == middle
            if not settled:
                middle = best
                break
    fresh = np.empty(place.size, np.int64)
    more = max(rules.final_hits - fresh_hits(middle, place, valid, rules, fresh), 0)
    out[:more] = middle
    return more


@njit(cache=True)
def next_hits_of_block(
    starts: NDArray[np.int64],
    place: Array,
    valid: Mask,
    sought: Array,
    rules: ScanRules,
    number: NDArray[np.int64],
    out: Array,
) -> None:
    """Fill in how many shots each laboratory of a block fires next, and at which places.

    `number` is (laboratory,), `out` (laboratory, attempts).
    """
    room = np.empty(most_asked(rules))
    for one in range(number.size):
        own = slice(starts[one], starts[one + 1])
        asked = next_hits(place[own], valid[own], sought[own], rules, room)
        left = max(rules.attempts - (starts[one + 1] - starts[one]), 0)
        number[one] = min(asked, left)
        out[one, : number[one]] = room[: number[one]]


class Scanned(NamedTuple):
    """What the scans of a block came to, arrays (laboratory,) to be filled in."""

    complete: NDArray[np.int64]  # places with all their hits
    best: Array  # the best of them [m]
    below: Mask  # whether a complete place lies next to it on this side
    above: Mask
    result: NDArray[np.int64]  # hits that the result rests on


@njit(cache=True)
def scans_of_block(
    starts: NDArray[np.int64],
    place: Array,
    valid: Mask,
    sought: Array,
    rules: ScanRules,
    found: Scanned,
    used: Mask,
) -> None:
    """Fill in what the scans of a block came to, and which hits their results rest on, (shot,).

    These are the last final hits at the best place, or the scan's about it.
    """
    for one in range(found.best.size):
        own = slice(starts[one], starts[one + 1])
        at, good, looked, mine = place[own], valid[own], sought[own], used[own]
        complete, counted = _completed(at, good, rules)
        mine[:] = False
        found.complete[one], found.result[one] = complete.size, 0
        found.best[one], found.below[one], found.above[one] = np.nan, False, False
        if not complete.size:
            continue
        best = complete[best_of(complete, rules.valid_hits, at, good, looked, rules)]
        found.best[one] = best
        beside = complete[_next_to(best, complete, rules)]
        found.below[one], found.above[one] = (beside < best).any(), (beside > best).any()
        if rules.final_hits:
            fresh = np.empty(at.size, np.int64)
            many = fresh_hits(best, at, good, rules, fresh)
            mine[fresh[max(many - rules.final_hits, 0) : many]] = True
        else:
            mine[:] = counted & (np.abs(at - best) < rules.fit_half_width + 4 * rules.reach)
        found.result[one] = mine.sum()


@njit(cache=True)
def shortfalls_of_block(
    starts: NDArray[np.int64],
    place: Array,
    valid: Mask,
    metric: Array,
    rules: ScanRules,
    mean: Array,
    square: Array,
) -> None:
    """Fill in mean and mean square of what the place that each scan chose may fall short by."""
    for one in range(mean.size):
        own = slice(starts[one], starts[one + 1])
        at, good, read = place[own], valid[own], metric[own]
        complete, counted = _completed(at, good, rules)
        mean[one], square[one] = 0.0, 0.0
        if not complete.size:
            continue
        means, scatter, freedom = np.empty(complete.size), 0.0, -complete.size
        for k in range(complete.size):
            mine = read[counted & (_rounded(at) == complete[k])]
            means[k] = mine.mean()
            scatter += ((mine - means[k]) ** 2).sum()
            freedom += mine.size
        u = sqrt(2 * scatter / freedom / rules.valid_hits) if freedom > 0 else 0.0
        if not u > 0:
            continue
        best = best_of(complete, rules.valid_hits, at, good, read, rules)
        for other in np.flatnonzero(_next_to(complete[best], complete, rules)):
            behind = (means[other] - means[best]) / u
            share, density = erfc(-behind / sqrt(2)) / 2, exp(-(behind**2) / 2) / sqrt(2 * pi)
            mean[one] += u * (behind * share + density)
            square[one] += u**2 * ((1 + behind**2) * share + behind * density)


@njit(cache=True)
def _rounded(place: Array) -> Array:
    """Return places to a micrometre: those asked for, whatever sums they come from."""
    return np.rint(place * 1e6) / 1e6


@njit(cache=True)
def _completed(place: Array, valid: Mask, rules: ScanRules) -> tuple[Array, Mask]:
    """Return the places with all the hits that a scan asks for, and which hits these are."""
    counted = np.empty(place.size, np.bool_)
    count_scan_hits(place, valid, rules, counted)
    at = _rounded(place)
    each = np.unique(at[counted])
    kept = np.empty(each.size, np.bool_)
    for k in range(each.size):
        mine = counted & (at == each[k])
        kept[k] = mine.sum() >= rules.valid_hits
        if not kept[k]:
            counted[mine] = False
    return each[kept], counted


@njit(cache=True)
def _next_to(best: float, complete: Array, rules: ScanRules) -> Mask:
    """Return which complete places are next to the best one."""
    off = np.abs(complete - best)
    return (off > 1e-6) & (off < rules.fine_step + 4 * rules.reach)


@njit(cache=True)
def _hopeful(places: Array, hits: int, place: Array, sought: Array, reach: float) -> Array:
    """Return the places without those where `hits` balls or more, and most, did not rebound.

    There the bat returns almost no speed, so such a place cannot have the maximum.
    """
    kept = np.ones(places.size, np.bool_)
    for k in range(places.size):
        lost, back = 0, 0
        for shot in range(place.size):
            if is_at(place[shot], places[k], reach):
                came = np.isfinite(sought[shot])
                back += came
                lost += not came
        kept[k] = lost < hits or back > lost
    return places[kept]


@njit(cache=True)
def _hits(at: float, place: Array, valid: Mask, reach: float) -> int:
    many = 0
    for shot in range(place.size):
        many += valid[shot] and is_at(place[shot], at, reach)
    return many


@njit(cache=True)
def _lacking(places: Array, hits: int, place: Array, valid: Mask, reach: float, out: Array) -> int:
    """Fill in each place as often as hits are lacking there; return how many they are."""
    many = 0
    for at in places:
        for _ in range(hits - _hits(at, place, valid, reach)):
            out[many] = at
            many += 1
    return many


@njit(cache=True)
def _complete(places: Array, place: Array, valid: Mask, rules: ScanRules) -> Array:
    kept = np.empty(places.size, np.bool_)
    for k in range(places.size):
        kept[k] = _hits(places[k], place, valid, rules.reach) >= rules.valid_hits
    return places[kept]
