"""From hits to a result: weights of the hits, the place of the result, and the verdict.

A result is a weighted sum of the hits. At a fixed place all weights are equal. In a scan the
weights are those of the maximum of a curve fitted near the best place. If the metric itself has
its maximum there, a shift of the place has no effect to first order. If another quantity, such as
v_f, has its maximum there, the hits also shift the place and thereby the result.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.eligibility import Finding
from virtual_lab.measurement.procedure.metric import Sought
from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure, Scan
from virtual_lab.measurement.procedure.schedule import best_place, final_hits, scan_hits
from virtual_lab.output.metrics import METRICS
from virtual_lab.units import Array, Mask

TOO_FEW = "fewer than two hits were valid"


class Verdict(Enum):
    """The outcome of a test by the procedure's own rule."""

    PASS = "PASS"
    FAIL = "FAIL"
    INVALID = "INVALID"
    MEASURED = "MEASURED"  # the rules set no limit


@dataclass(frozen=True, slots=True, kw_only=True)
class HitWeights:
    """Weights and effects of the hits."""

    weights: Array  # (shot,), they add to 1; NaN where nothing can be said
    effects: (
        Array  # (shot,), of the result per unit of a hit's metric: weights and the place's part
    )
    place: float  # that the result speaks of, from the tip [m]
    reason: str  # why the test gives no result; empty where it does

    @property
    def used(self) -> Mask:
        """Shots that contribute to the result, (shot,)."""
        return np.asarray(self.weights != 0) & np.isfinite(self.weights)


def outcome_of(
    procedure: Procedure,
    place: Array,
    valid: Mask,
    metric: Array,
    sought: Sought | None = None,
) -> HitWeights:
    """Return the weights of the hits.

    Parameters
    ----------
    procedure
        Its counts and its scan.
    place, valid, metric
        Of the shots in the order they were fired, (shot,).
    sought
        The quantity that a scan maximises, for the same shots; None: the metric.
    """
    sought = sought or Sought(metric, np.ones_like(metric))
    if valid.sum() < 2:
        return _nothing(len(place), TOO_FEW)
    if procedure.scan is None:
        first = np.zeros(len(place), dtype=np.intp)
        alone = outcomes_of(procedure, 1, first, place, valid, metric, sought)
        return alone.of(0, np.ones(len(place), dtype=bool))
    return _of_scan(procedure, procedure.scan, place, valid, metric, sought)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockOutcome:
    """Weights and effects of the hits of a block, as `HitWeights` of each laboratory."""

    weights: Array  # (shot,)
    effects: Array  # (shot,)
    place: Array  # (laboratory,)
    reasons: tuple[str, ...]  # (laboratory,)

    def of(self, laboratory: int, shots: Mask) -> HitWeights:
        """Return those of one laboratory; `shots` are its own."""
        return HitWeights(
            weights=self.weights[shots],
            effects=self.effects[shots],
            place=float(self.place[laboratory]),
            reason=self.reasons[laboratory],
        )


def outcomes_of(
    procedure: Procedure,
    laboratories: int,
    owner: NDArray[np.intp],
    place: Array,
    valid: Mask,
    metric: Array,
    sought: Sought,
) -> BlockOutcome:
    """Return the weights of the hits of a block, as `outcome_of` each laboratory's own.

    `owner` is the laboratory of each shot, (shot,); the other arrays are those of `outcome_of`.
    """
    if procedure.scan is not None:
        found = []
        weights, effects = np.empty((2, len(place)))
        for one in range(laboratories):
            own = owner == one
            looked = Sought(sought.value[own], sought.gain[own])
            found.append(outcome_of(procedure, place[own], valid[own], metric[own], looked))
            weights[own], effects[own] = found[-1].weights, found[-1].effects
        return BlockOutcome(
            weights=weights,
            effects=effects,
            place=np.array([each.place for each in found]),
            reasons=tuple(each.reason for each in found),
        )
    hits = np.bincount(owner, valid, laboratories)
    enough = hits >= 2
    many = np.where(enough, hits, np.nan)
    weights = np.where(enough[owner], valid / many[owner], np.nan)
    return BlockOutcome(
        weights=weights,
        effects=weights,
        place=np.bincount(owner, np.where(valid, place, 0.0), laboratories) / many,
        reasons=tuple(
            TOO_FEW
            if number < 2
            else ""
            if number >= procedure.valid_hits
            else f"{number:.0f} valid hits of {procedure.valid_hits}"
            for number in hits
        ),
    )


def complete_places(procedure: Procedure, place: Array, valid: Mask) -> Array:
    """Return the places with all the hits a scan asks for."""
    counted = scan_hits(procedure, place, valid)
    places, number = np.unique(np.round(place[counted], 6), return_counts=True)
    return np.asarray(places[number >= procedure.valid_hits])


def _of_scan(
    procedure: Procedure, scan: Scan, place: Array, valid: Mask, metric: Array, sought: Sought
) -> HitWeights:
    counted = scan_hits(procedure, place, valid)
    complete = complete_places(procedure, place, valid)
    few = f"{procedure.valid_hits} valid hits at {complete.size} places, 3 make a scan"
    if not complete.size:
        return _nothing(len(place), few)
    best = best_place(procedure, complete, place, valid, sought.value)
    if complete.size < 3 and not _at_an_end(scan, best):
        return _nothing(len(place), few)
    beside = neighbours(scan, complete, best)
    bracketed = bool((beside < best).any() and (beside > best).any())
    reason = "" if bracketed else f"no maximum between {scan.low:g} and {scan.high:g} m"
    if scan.final_hits:
        fresh = final_hits(procedure, scan, best, place, valid)[-scan.final_hits :]
        if fresh.size < scan.final_hits:
            in_a_row = "consecutive " if scan.consecutive else ""
            few = f"{fresh.size} of {scan.final_hits} {in_a_row}hits at the best place"
            reason = reason or few
        if fresh.size == 0:
            return _nothing(len(place), reason)
        return _mean(np.isin(np.arange(len(place)), fresh), place, reason)
    near = counted & np.isin(np.round(place, 6), complete)
    near &= np.abs(place - best) < scan.fit_half_width + 2 * SETTING_STEP
    weights, effects, top = _top_of_curve(scan, place, near, metric, sought)
    return HitWeights(weights=weights, effects=effects, place=top, reason=reason)


def neighbours(scan: Scan, complete: Array, best: float) -> Array:
    """Return the complete places next to the best one [m]."""
    spaced = scan.fine_step + 2 * SETTING_STEP
    off = np.abs(complete - best)
    return np.asarray(complete[(off > 1e-6) & (off < spaced)])


def _at_an_end(scan: Scan, place: float) -> bool:
    """Return whether the next fine place on one side lies beyond the scan."""
    step = scan.fine_step - SETTING_STEP
    return place - step < scan.low or place + step > scan.high


def _mean(hits: Mask, place: Array, reason: str) -> HitWeights:
    weights = hits / hits.sum()
    return HitWeights(
        weights=weights, effects=weights, place=float(place[hits].mean()), reason=reason
    )


def _top_of_curve(
    scan: Scan, place: Array, near: Mask, metric: Array, sought: Sought
) -> tuple[Array, Array, float]:
    """Return weights and effects of the hits `near`, and the place of the maximum.

    One polynomial f is fitted to the maximised quantity, another to the metric, which is read at
    the maximum z of f. A hit shifts z by ``-b'(z) / f''(z)``, where b is its part of the fit.
    """
    middle = place[near].mean()
    unit = (place[near] - middle) / scan.fit_half_width
    degree = _degree(unit)
    solved = np.linalg.pinv(np.vander(unit, degree + 1, increasing=True))
    fitted = solved @ sought.value[near]
    turn = _turn(fitted)
    powers = np.arange(degree + 1)
    candidates = np.array([unit.min(), unit.max()])
    if unit.min() < turn < unit.max():
        candidates = np.append(candidates, turn)
    top = float(candidates[np.argmax(candidates[:, None] ** powers @ fitted)])
    weights = np.zeros(len(place))
    weights[near] = top**powers @ solved
    effects = weights.copy()
    if scan.seeks == "batted_speed" and top == turn:
        slopes = powers[1:] * top ** powers[:-1] @ solved[1:]
        bend = (powers * (powers - 1))[2:] * top ** powers[:-2] @ fitted[2:]
        moved = -slopes * sought.gain[near] / bend
        effects[near] += slopes @ metric[near] * moved
    return weights, effects, middle + top * scan.fit_half_width


def _degree(place: Array) -> int:
    """Return the degree of the curve through hits; at equal steps the odd term costs nothing."""
    return min(3, len(np.unique(np.round(place, 6))) - 1)


def curve_of(procedure: Procedure, place: Array, used: Mask, metric: Array) -> Polynomial | None:
    """Return the curve of the metric over the place [m] from which a scan reads its result.

    `used` are the shots in the result, (shot,). None where the result is a mean of hits.
    """
    if procedure.scan is None or procedure.scan.final_hits or used.sum() < 2:
        return None
    return Polynomial.fit(place[used], metric[used], _degree(place[used]))


def _turn(cubic: Array) -> float:
    """Return the local maximum of a polynomial up to the third degree, NaN without one.

    The formula stays exact as the cubic term vanishes.
    """
    a, b, c = np.pad(cubic[1:] * np.arange(1, cubic.size), (0, 3))[:3]
    square = b**2 - 4 * a * c
    bend = -b + np.sqrt(square) if square >= 0 else 0.0
    return float(2 * a / bend) if bend > 0 else np.nan


def _nothing(shots: int, reason: str) -> HitWeights:
    nothing = np.full(shots, np.nan)
    return HitWeights(weights=nothing, effects=nothing, place=np.nan, reason=reason)


def not_met(procedure: Procedure, found: Iterable[Finding], value: float | None) -> tuple[str, ...]:
    """Return what a bat does not meet, each rule with value and limit; () if it meets all.

    `found` are the findings of its eligibility; `value` is the metric in SI, met up to and
    including the limit, None if it is unknown.
    """
    rules = [finding.sentence for finding in found if not finding.met]
    limit = procedure.metric_limit
    if limit is not None and value is not None and value > limit:
        metric = METRICS[procedure.metric]
        own, most = metric.limit(value, more=1), metric.limit(limit)
        rules.append(f"{metric.symbol} {own} is above the limit {most}")
    return tuple(rules)


def verdict(procedure: Procedure, *, sound: bool, met: bool) -> Verdict:
    """Return INVALID for an invalid test, FAIL if the bat does not meet every rule, else PASS."""
    if not sound:
        return Verdict.INVALID
    if not met:
        return Verdict.FAIL
    return Verdict.MEASURED if procedure.metric_limit is None else Verdict.PASS
