"""From hits to a result: weights of the hits, impact position of the result, and verdict.

A result is a weighted sum of the hits. At a fixed impact position all weights are equal. In a scan
the result is the value at the maximum of a curve fitted near the best position, which determines
the weights. The hits also shift the position of this maximum. If the curve is the metric itself,
the shift has no first-order effect on the result. If it is another quantity, such as v_f, the shift
changes the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.eligibility import bat_rules, exemption
from virtual_lab.measurement.procedure.metric import Objective
from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure, Scan
from virtual_lab.measurement.procedure.schedule import scan_rules, sort_by_laboratory
from virtual_lab.measurement.reduction.flights import number_shots
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.output.metrics import METRICS
from virtual_lab.units import Array, Mask

if TYPE_CHECKING:
    from virtual_lab.measurement.procedure.scan_kernel import Scanned

TOO_FEW = "fewer than two hits were valid"
NO_MAXIMUM = "the hits near the best impact position show no maximum"


class Verdict(Enum):
    """The outcome of a test by the procedure's own rule."""

    PASS = "PASS"
    FAIL = "FAIL"
    INVALID = "INVALID"
    MEASURED = "MEASURED"  # the rules set no limit


@dataclass(frozen=True, slots=True, kw_only=True)
class HitWeights:
    """Weights of the hits of a block, with impact positions and reasons for no result."""

    weights: Array  # (shot,), with the sum 1 in a laboratory; NaN without a result
    # derivative of the result with respect to the metric of a hit, (shot,): the weight of the hit,
    # plus its effect by shifting the impact position, which is scaled as `_curve_maxima` describes
    effects: Array
    position: Array  # impact position of the result, from the tip, (laboratory,) [m]
    reasons: tuple[str, ...]  # reason why a test gives no result, or empty, (laboratory,)

    @property
    def used(self) -> Mask:
        """Shots that contribute to a result, (shot,)."""
        return np.asarray(self.weights != 0) & np.isfinite(self.weights)

    def row(self, laboratory: int, shots: Mask) -> HitWeights:
        """Return the weights of one laboratory. `shots` is the mask of its shots, (shot,)."""
        rows = slice(laboratory, laboratory + 1)
        return HitWeights(
            weights=self.weights[shots],
            effects=self.effects[shots],
            position=self.position[rows],
            reasons=self.reasons[rows],
        )


def hit_weights_of(
    procedure: Procedure,
    laboratories: int,
    owner: NDArray[np.intp],
    position: Array,
    valid: Mask,
    metric: Array,
    objective: Objective,
) -> HitWeights:
    """Return the weights of the hits, (shot,), and the impact position of each laboratory's result.

    The position is the distance from the barrel tip, (laboratory,) [m]. In a laboratory without a
    result, weights and position are NaN, and the field `reasons` states why. Without a scan, a
    result needs at least two valid hits. A test with at least two valid hits, but fewer than the
    procedure requires, has a result too. The field `reasons` then states the shortage, which makes
    the verdict INVALID.

    Parameters
    ----------
    procedure
        Test procedure. Only its number of valid hits and its scan are used.
    laboratories
        Number of laboratories.
    owner, position, valid, metric
        For each shot, (shot,): index of the laboratory, impact position from the tip [m], whether
        the hit is valid, and the metric. The shots of a laboratory are in the order fired.
    objective
        The quantity that a scan maximizes, for the same shots.
    """
    if procedure.scan is not None:
        shots = ScanShots(owner, position, valid, metric, objective)
        return _scan_weights(procedure, procedure.scan, laboratories, shots)
    hits = np.bincount(owner, valid, laboratories)
    enough = hits >= 2
    divisor = np.where(enough, hits, np.nan)
    weights = np.where(enough[owner], valid / divisor[owner], np.nan)
    return HitWeights(
        weights=weights,
        effects=weights,
        position=np.bincount(owner, np.where(valid, position, 0.0), laboratories) / divisor,
        reasons=tuple(
            TOO_FEW
            if number < 2
            else ""
            if number >= procedure.valid_hits
            else f"only {number:.0f} of {procedure.valid_hits} valid hits"
            for number in hits
        ),
    )


class CurveMaxima(NamedTuple):
    """Maxima of the fitted curves of a block; weights and effects as in `HitWeights`."""

    weights: Array  # (shot,)
    effects: Array  # (shot,)
    position: Array  # (laboratory,) [m]
    is_flat: Mask  # whether the hits show no maximum, (laboratory,)


class ScanShots(NamedTuple):
    """The shots of scans, (shot,)."""

    owner: NDArray[np.intp]
    position: Array
    valid: Mask
    metric: Array
    objective: Objective


def _scan_weights(
    procedure: Procedure, scan: Scan, laboratories: int, shots: ScanShots
) -> HitWeights:
    from virtual_lab.measurement.procedure.scan_kernel import Scanned, scans_of_block

    scans = Scanned(
        complete=np.empty(laboratories, np.int64),
        best=np.empty(laboratories),
        below=np.empty(laboratories, bool),
        above=np.empty(laboratories, bool),
        result=np.empty(laboratories, np.int64),
    )
    order, starts = sort_by_laboratory(shots.owner, laboratories)
    columns = shots.position[order], shots.valid[order], shots.objective.value[order]
    mask, near = masks = np.empty((2, order.size), dtype=bool)
    in_order = np.empty_like(masks)
    scans_of_block(starts, *columns, scan_rules(procedure, scan), scans, *in_order)
    masks[:, order] = in_order
    hits = np.bincount(shots.owner, shots.valid, laboratories)
    step = scan.fine_step - SETTING_STEP
    at_an_end = (scans.best - step < scan.low) | (scans.best + step > scan.high)
    has_result = (hits >= 2) & ((scans.complete >= 3) | ((scans.complete > 0) & at_an_end))
    reasons = tuple(
        TOO_FEW
        if hits[laboratory] < 2
        else _scan_reason(procedure, scan, scans, laboratory, bool(has_result[laboratory]))
        for laboratory in range(laboratories)
    )
    has_result &= scans.result > 0
    mask &= has_result[shots.owner]
    if scan.final_hits:
        many = np.where(has_result, scans.result, np.nan)
        weights = np.where(has_result[shots.owner], mask / many[shots.owner], np.nan)
        total = np.bincount(shots.owner, np.where(mask, shots.position, 0.0), laboratories)
        return HitWeights(weights=weights, effects=weights, position=total / many, reasons=reasons)
    maxima = _curve_maxima(scan, laboratories, shots, mask, near)
    return HitWeights(
        weights=maxima.weights,
        effects=maxima.effects,
        position=maxima.position,
        reasons=tuple(
            reason or (NO_MAXIMUM if flat else "")
            for reason, flat in zip(reasons, maxima.is_flat, strict=True)
        ),
    )


def _scan_reason(procedure: Procedure, scan: Scan, scans: Scanned, i: int, has_result: bool) -> str:
    """Return the reason why a scan gives no valid result; empty if it gives one."""
    if not has_result:
        return (
            f"only {scans.complete[i]} impact positions have {procedure.valid_hits} valid hits; "
            "a scan needs 3"
        )
    if not (scans.below[i] and scans.above[i]):
        return f"the scan has no maximum between {scan.low:g} and {scan.high:g} m"
    if scans.result[i] < scan.final_hits:
        in_a_row = "consecutive " if scan.consecutive else ""
        return (
            f"only {scans.result[i]} of {scan.final_hits} {in_a_row}hits at the best impact "
            "position"
        )
    return ""


def _curve_maxima(
    scan: Scan, laboratories: int, shots: ScanShots, mask: Mask, near: Mask
) -> CurveMaxima:
    """Return the maxima of the fitted curves of a block, with the weights of the hits.

    A cubic f of the maximized quantity has its maximum at z. Another cubic is fitted to the metric
    of the used hits and evaluated at z. The line in f is fitted to the used hits, and the higher
    terms to the hits of the mask `near`, within twice their range: in the range of the used hits
    alone, scatter hides the curvature of a flat sweet spot. A hit shifts z by ``-b'(z) / f''``,
    where b is its contribution to f, and f'' that in the middle of the used hits, which scatters
    less than that at z. The effects of the used hits are scaled so that they cause the variance
    that all hits cause. Without used hits the results are NaN.
    """
    has_result = np.bincount(shots.owner, mask, laboratories) > 0
    hits = number_shots(shots.owner, near & has_result[shots.owner], laboratories)
    is_hit = hits >= 0
    is_used = is_hit & mask[hits]
    position = np.where(is_hit, shots.position[hits], 0.0)
    middle = np.full(laboratories, np.nan)
    np.divide(np.sum(position * is_used, axis=1), is_used.sum(axis=1), out=middle, where=has_result)
    unit = np.where(is_hit, position - middle[:, None], 0.0) / scan.fit_half_width
    powers = np.arange(4)
    all_rows, used_rows = (
        unit[..., None] ** powers
        * (each[..., None] & (powers <= _degrees(position, each)[:, None])[:, None])
        for each in (is_hit, is_used)
    )
    solved, line = np.linalg.pinv(used_rows), np.linalg.pinv(used_rows[..., :2])
    # f is fitted by multiplying the values of all hits with `shape`, (laboratory, power, hit)
    shape = np.linalg.pinv(all_rows)
    shape[:, :2] = line - line @ all_rows[..., 2:] @ shape[:, 2:]
    objective = shots.objective
    value, gain, metric = (
        np.where(is_hit, each[hits], 0.0)
        for each in (objective.value, objective.gain, shots.metric)
    )
    fitted = np.einsum("lph,lh->lp", shape, value)
    low = np.min(unit, axis=1, where=is_used, initial=np.inf)
    high = np.max(unit, axis=1, where=is_used, initial=-np.inf)
    turn = _turns(fitted)
    turns = (low < turn) & (turn < high)
    candidates = np.stack([low, high, np.where(turns, turn, low)], axis=1)
    candidates[~has_result] = np.nan
    heights = np.einsum("lcp,lp->lc", candidates[..., None] ** powers, fitted)
    top = np.take_along_axis(candidates, heights.argmax(axis=1)[:, None], axis=1)
    weights = np.einsum("lp,lph->lh", top**powers, solved)
    effects = weights.copy()
    bend = 2 * fitted[:, 2]
    if scan.seeks == "batted_speed":
        slopes = np.einsum("lp,lph->lh", powers[1:] * top ** powers[:-1], shape[:, 1:])
        steepness = np.einsum("lh,lh->l", slopes, metric)
        shift = steepness / np.where(bend < 0, -bend, np.inf) * np.linalg.norm(slopes, axis=1)
        slopes *= is_used
        of_used = np.linalg.norm(slopes, axis=1)
        effects += (shift / np.where(of_used > 0, of_used, 1.0))[:, None] * slopes * gain
    spread = np.where(has_result[shots.owner], 0.0, np.nan)
    by_shot = [spread.copy(), spread.copy()]
    for column, each in zip(by_shot, (weights, effects), strict=True):
        column[hits[is_used]] = each[is_used]
    return CurveMaxima(
        weights=by_shot[0],
        effects=by_shot[1],
        position=middle + top[:, 0] * scan.fit_half_width,
        is_flat=~(bend < 0) & has_result,
    )


def _degrees(position: Array, is_hit: Mask) -> NDArray[np.intp]:
    """Return the degree of the polynomial through the hits of each laboratory, at most 3.

    It is one less than the number of different positions.
    """
    at = np.sort(np.where(is_hit, np.round(position, 6), np.inf), axis=1)
    differs = np.pad(at[:, 1:] > at[:, :-1], ((0, 0), (1, 0)), constant_values=True)
    return np.asarray(np.minimum(3, (differs & np.isfinite(at)).sum(axis=1) - 1))


def _turns(cubics: Array) -> Array:
    """Return the position of the local maximum of each cubic, (curve,); NaN without one.

    `cubics` are coefficients, (curve, power). The formula remains exact if the cubic term vanishes.
    """
    a, b, c = (cubics[:, 1:] * np.arange(1, 4)).T
    square = b**2 - 4 * a * c
    bend = np.where(square >= 0, -b + np.sqrt(np.maximum(square, 0.0)), 0.0)
    return np.where(bend > 0, 2 * a / np.where(bend > 0, bend, 1.0), np.nan)


def curve_of(procedure: Procedure, position: Array, used: Mask, metric: Array) -> Polynomial | None:
    """Return the polynomial of the metric over impact position, fitted for the result of a scan.

    Positions are distances from the barrel tip [m]. The polynomial is in the unit of `metric`. The
    objective is the quantity that the procedure maximizes along the barrel. The result of the scan
    is the value of the polynomial at the position with the largest objective.

    `position` and `metric` are the values of one laboratory's shots, and `used` is the mask of the
    shots in the result, all (shot,). Return None if the procedure does not scan, if its result is
    the mean of final hits at one position, or if fewer than two shots are used.
    """
    if procedure.scan is None or procedure.scan.final_hits or used.sum() < 2:
        return None
    degree = int(_degrees(position[used][None], np.ones((1, used.sum()), dtype=bool))[0])
    return Polynomial.fit(position[used], metric[used], degree)


class Reason(NamedTuple):
    """A reason for a verdict other than PASS, in the laboratories of a block."""

    verdict: Verdict
    where: Mask  # laboratories to which it applies, (laboratory,)
    sentence: Callable[[int], str]  # sentence for a laboratory to which it applies


def unmet_rules(
    procedure: Procedure, bat: BatProperties, value: Array, construction: str = ""
) -> Iterator[Reason]:
    """Yield one reason for FAIL per rule of the procedure, with a mask of the laboratories.

    If the procedure requires no test of bats of this construction ("": unknown), yield only this
    reason, for MEASURED.

    The mask, (laboratory,), is True where the bat violates the rule. The rules are the eligibility
    rules for bats and the limit of the metric. A rule that all bats meet is yielded too. `bat`
    holds the measured bats. `value` is the metric, (laboratory,), NaN if unknown. NaN and a value
    equal to the limit do not violate the limit.
    """
    if exempt := exemption(procedure, construction):
        yield Reason(Verdict.MEASURED, np.ones(len(value), dtype=bool), lambda _: exempt)
        return
    for rule in bat_rules(procedure, bat):
        yield Reason(Verdict.FAIL, ~rule.met, rule.sentence)
    limit, metric = procedure.metric_limit, METRICS[procedure.metric]
    if limit is not None:
        yield Reason(
            Verdict.FAIL,
            value > limit,
            lambda i: (
                f"{metric.symbol} {metric.limit(float(value[i]), more=1)} is above the limit "
                f"{metric.limit(limit)}"
            ),
        )


def verdicts_of(
    procedure: Procedure, reasons: Iterable[Reason], laboratories: int
) -> tuple[Verdict, ...]:
    """Return the verdict of each laboratory, given the reasons for MEASURED, FAIL and INVALID.

    A reason for INVALID precedes the others. A laboratory without a reason has the verdict PASS, or
    MEASURED if the procedure states no limit.
    """
    sound = Verdict.MEASURED if procedure.metric_limit is None else Verdict.PASS
    verdicts = np.full(laboratories, sound, dtype=object)
    for reason in sorted(reasons, key=lambda each: each.verdict is Verdict.INVALID):
        verdicts[reason.where] = reason.verdict
    return tuple(verdicts)


def sentences_of(reasons: Iterable[Reason], verdict: Verdict, laboratory: int) -> tuple[str, ...]:
    """Return the sentences of all reasons for the verdict of one laboratory.

    `verdict` is the verdict of this laboratory. Reasons for another verdict, or in other
    laboratories, are left out. The tuple is empty for PASS.
    """
    return tuple(
        each.sentence(laboratory)
        for each in reasons
        if each.verdict is verdict and each.where[laboratory]
    )
