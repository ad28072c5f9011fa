"""Where to hit: the centre of percussion, or a scan that closes in on the best place.

After every round the operator asks for the remaining places. They follow only from the shots so
far, so a reduction of the records finds the same places again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure, Scan
from virtual_lab.measurement.reduction.kinematics import centre_of_percussion
from virtual_lab.units import Array, Mask

ROUNDING = 1e-9  # m


def aimed_place(bat: Mapping[str, float], pivot_from_knob: float) -> float:
    """Return the centre of percussion (Eq. 11) of the bat as measured [m].

    `bat` holds the measured mass, length, z_cm and inertia_cm [SI].
    """
    axis = bat["length"] - pivot_from_knob
    return float(centre_of_percussion(bat["z_cm"], bat["inertia_cm"], bat["mass"], axis))


def to_set(places: Array, *, exact: bool) -> Array:
    """Return places as an operator can set them [m]: in half millimetres, unless `exact`."""
    return places if exact else np.round(places / SETTING_STEP) * SETTING_STEP


def next_places(
    procedure: Procedure, percussion: float, place: Array, valid: Mask, sought: Array
) -> Array:
    """Return the places to fire at next [m], one a shot; none when the test is complete.

    Parameters
    ----------
    procedure
        Its counts and its scan.
    percussion
        Centre of percussion of the bat as measured [m].
    place, valid, sought
        Of the shots fired so far, in order, (shot,).
    """
    if procedure.scan is None:
        missing = np.full(max(procedure.valid_hits - int(valid.sum()), 0), percussion)
    else:
        missing = _scan(procedure, procedure.scan, place, valid, sought)
    return missing[: max(procedure.attempts - len(place), 0)]


class NextShots(NamedTuple):
    """Shots to fire next in a block, sorted by laboratory, (shot,)."""

    owner: NDArray[np.intp]  # which laboratory
    place: Array  # [m]


def next_shots(
    procedure: Procedure,
    percussion: Array,
    owner: NDArray[np.intp],
    place: Array,
    valid: Mask,
    sought: Array,
) -> NextShots:
    """Return the shots to fire next, as `next_places` of each laboratory.

    Parameters
    ----------
    percussion
        (laboratory,) [m].
    owner, place, valid, sought
        Of the shots fired so far, in order, (shot,).
    """
    laboratories = np.arange(percussion.size)
    if procedure.scan is None:
        hits = np.bincount(owner, valid, percussion.size).astype(int)
        fired = np.bincount(owner, minlength=percussion.size)
        left = np.maximum(procedure.attempts - fired, 0)
        number = np.minimum(np.maximum(procedure.valid_hits - hits, 0), left)
        return NextShots(laboratories.repeat(number), percussion.repeat(number))
    places = []
    for one in laboratories:
        own = owner == one
        places.append(next_places(procedure, percussion[one], place[own], valid[own], sought[own]))
    number = np.array([each.size for each in places])
    return NextShots(laboratories.repeat(number), np.concatenate(places))


def _scan(procedure: Procedure, scan: Scan, place: Array, valid: Mask, sought: Array) -> Array:
    coarse = np.arange(scan.low, scan.high + ROUNDING, scan.coarse_step)
    coarse = _hopeful(coarse, scan.coarse_hits, place, sought)
    lacking = _lacking(coarse, scan.coarse_hits, place, valid)
    if lacking.size or not coarse.size:
        return lacking
    means = [sought[valid & same_place(place, at)][: scan.coarse_hits].mean() for at in coarse]
    middle = float(coarse[int(np.argmax(means))])
    fine = _grid(scan, middle)
    fine = _hopeful(fine, procedure.valid_hits, place, sought)
    reaches = (scan.fine_step,) if scan.final_hits else (scan.fine_step, scan.fit_half_width)
    settled = False
    while not settled:
        for reach in reaches:
            around = fine[np.abs(fine - middle) < reach + ROUNDING]
            lacking = _lacking(around, procedure.valid_hits, place, valid)
            if lacking.size:
                return lacking
            # the result will be taken about the best of all the places, wherever it lies
            complete = fine[_hits(fine, place, valid) >= procedure.valid_hits]
            if not complete.size:
                return np.zeros(0)
            best = best_place(procedure, complete, place, valid, sought)
            settled = best == middle
            if not settled:
                middle = best
                break
    fresh = final_hits(procedure, scan, middle, place, valid)
    return np.full(max(scan.final_hits - fresh.size, 0), middle)


def _grid(scan: Scan, middle: float) -> Array:
    """Return the fine places from `low` to `high`, one of them `middle` [m]."""
    below = int((middle - scan.low + ROUNDING) / scan.fine_step)
    above = int((scan.high - middle + ROUNDING) / scan.fine_step)
    return np.asarray(middle + scan.fine_step * np.arange(-below, above + 1))


def _hopeful(places: Array, hits: int, place: Array, sought: Array) -> Array:
    """Return the places without those where `hits` balls or more, and most, did not rebound.

    There the bat returns almost no speed, so such a place cannot have the maximum.
    """
    here, came = same_place(place, places[:, None]), np.isfinite(sought)
    lost, back = (here & ~came).sum(axis=1), (here & came).sum(axis=1)
    return np.asarray(places[(lost < hits) | (back > lost)])


def best_place(
    procedure: Procedure, among: Iterable[float], place: Array, valid: Mask, sought: Array
) -> float:
    """Return the place [m] where the maximised quantity has the greatest mean over the hits."""
    counted = scan_hits(procedure, place, valid)
    means = {at: sought[counted & same_place(place, at)].mean() for at in among}
    return max(means, key=means.__getitem__)


def scan_hits(procedure: Procedure, place: Array, valid: Mask) -> Mask:
    """Return which hits are the scan's: at each place the first `valid_hits` valid ones."""
    places = np.unique(np.round(place, 6))
    here = valid & same_place(place, places[:, None])
    return np.asarray((here & (here.cumsum(axis=1) <= procedure.valid_hits)).any(axis=0))


def final_hits(
    procedure: Procedure, scan: Scan, best: float, place: Array, valid: Mask
) -> NDArray[np.intp]:
    """Return the numbers of the fresh hits at the best place [m] that count, in order.

    If the procedure asks for consecutive ones, those since the last invalid shot there.
    """
    here = same_place(place, best) & ~scan_hits(procedure, place, valid)
    shots = np.flatnonzero(here)
    if scan.consecutive:
        failed = np.flatnonzero(~valid[shots])
        return shots[failed[-1] + 1 :] if failed.size else shots
    return shots[valid[shots]]


def same_place(place: Array, at: float | Array) -> Mask:
    """Return which shots were set at a place: within half a step of setting.

    `at` (place, 1) gives a row a place, (place, shot).
    """
    return np.asarray(np.abs(place - at) < SETTING_STEP / 2 + 1e-9)


def _lacking(places: Array, hits: int, place: Array, valid: Mask) -> Array:
    return np.repeat(places, np.maximum(hits - _hits(places, place, valid), 0))


def _hits(places: Array, place: Array, valid: Mask) -> NDArray[np.int_]:
    """Return the number of valid hits at each of `places`."""
    return np.asarray((valid & same_place(place, places[:, None])).sum(axis=1))
