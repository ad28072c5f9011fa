"""From a session to its result: the metric, its uncertainty, the verdict.

The inputs are raw records, calibrations and the procedure. Records of our simulated rigs and of
another laboratory are evaluated in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.catalog import Datum
from virtual_lab.measurement.alternatives.other_support import OtherSupport, other_support
from virtual_lab.measurement.alternatives.refined import low_dof_source, propagate_metric
from virtual_lab.measurement.alternatives.swing_range import SwingResult, swing_range
from virtual_lab.measurement.camera.comparison import CameraComparison, compare_camera
from virtual_lab.measurement.diagnostics import (
    Checked,
    Discrepancy,
    Evidence,
    Flag,
    check,
    decisions_elsewhere,
    overdue,
)
from virtual_lab.measurement.procedure import (
    Curve,
    Finding,
    HitWeights,
    Judgement,
    Procedure,
    Reason,
    SetAside,
    Verdict,
    add_shortfall,
    findings,
    judge,
    judge_by,
    metric_of,
    sentences_of,
    set_aside,
    shortfalls,
    unmet_rules,
    variances_within,
    verdicts_of,
)
from virtual_lab.measurement.procedure.model import AS_FOUND, QUANTITIES
from virtual_lab.measurement.procedure.peak_width import Width, width_of
from virtual_lab.measurement.procedure.rules import SETTING_STEP
from virtual_lab.measurement.reduction.flights import number_shots
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    ShotResults,
    bat_properties,
)
from virtual_lab.measurement.session_reduction import (
    Reduction,
    reduce_block,
)
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import decimals, limit_message
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Budgets, Variants, means_of_hits
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.uncertainty.monte_carlo import MONTE_CARLO
from virtual_lab.uncertainty.propagated import Propagated
from virtual_lab.uncertainty.propagating import FIRST
from virtual_lab.uncertainty.scatter import HitVariance
from virtual_lab.units import Array, Mask

# results whose maximum a scan seeks, and to which its shortfall and shift of position apply
DECIDING = frozenset({"metric", AS_FOUND})
CACHED = 80_000  # largest number of values of an array that stays in the processor's cache


@dataclass(frozen=True, slots=True, kw_only=True)
class Certification:
    """Results, flags and verdict of one test. All values are measured."""

    session: Session
    block: SessionBlock  # the same records and calibration as arrays, a block of one
    procedure: Procedure
    procedure_sheet: tuple[Datum, ...]
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm
    shots: ShotResults
    shot_metric: Array  # (shot,)
    readings: ImpactReadings
    judgement: Judgement
    hit_weights: HitWeights
    metric: Budget | None  # budget of the metric; None if too few hits were valid
    first_order: Budgets | None  # the metric's components as arrays, a block of one
    # budgets by the keys of QUANTITIES, and AS_FOUND with a correction for the balls; {}: no metric
    quantities: Mapping[str, Budget]
    # variance of one hit in each result, from this test alone; {} if the test is INVALID
    variances: Mapping[str, Estimate]
    refined: Propagated | None  # result of second order or Monte Carlo; None: first order only
    width: Width | None  # peak width; None without a metric, a width rule or enough positions
    swings: tuple[SwingResult, ...]  # results by each swing law, if the rules name several
    other_support: OtherSupport | None
    camera: CameraComparison | None  # comparison with the camera, if it filmed the hits
    set_aside: tuple[SetAside, ...]  # balls that the rules do not admit
    # requirements of the rules for a bat before it is hit, met or not
    findings: tuple[Finding, ...]
    flags: tuple[Flag, ...]  # contradictions in the records
    pairs: tuple[Discrepancy, ...]  # differences between two measurements of one quantity
    not_checked: tuple[str, ...]  # checks for which the records lack the readings
    deviations: tuple[str, ...]  # decisions of a person against the rules, in a rehearsed test
    reasons: tuple[str, ...]  # reasons of a verdict other than PASS
    verdict: Verdict

    @property
    def marginal(self) -> bool:
        """Whether the limit decides the verdict and lies within the 95 % interval."""
        decides = self.verdict in (Verdict.PASS, Verdict.FAIL) and all(
            each.met for each in self.findings
        )
        if not decides or self.metric is None or self.procedure.metric_limit is None:
            return False
        low, high = self.metric.interval_95
        return low <= self.procedure.metric_limit <= high

    @property
    def unverified(self) -> tuple[Datum, ...]:
        """The values of the procedure that were not verified in their source."""
        return tuple(datum for datum in self.procedure_sheet if not datum.verified)


def certify_session(session: Session) -> Certification:
    """Return the certification of one recorded test: results, uncertainty, flags and verdict.

    A test with too few valid hits is not an error. Its verdict is INVALID and its metric is None.
    Raises `InputError` for a record, calibration or procedure that is missing or cannot be used.
    """
    block = SessionBlock.of(session)
    reduced, readings = reduce_block(block)
    if session.is_rehearsed:
        reduced = reduced.judge_hits(judge_by(session.decisions), readings)
    return certify_reduction(block, reduced, readings).row(0, lambda _: session)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certifications:
    """Results, flags and verdicts of a block, one test per laboratory. All values are measured."""

    block: SessionBlock
    reduced: Reduction
    readings: ImpactReadings  # readings of all shots, in the order in which they were fired
    hit_weights: HitWeights
    has_result: Mask  # mask of the laboratories with a result, (laboratory,)
    results: Mapping[str, Budgets]  # keys: ``metric``, AS_FOUND, and those of QUANTITIES
    checked: Checked
    reason_table: tuple[Reason, ...]  # reasons for verdicts other than PASS
    verdicts: tuple[Verdict, ...]

    @property
    def procedure(self) -> Procedure:
        return self.reduced.procedure

    @property
    def invalid(self) -> Mask:
        """Whether the test of each laboratory is INVALID, (laboratory,)."""
        return np.array([each is Verdict.INVALID for each in self.verdicts])

    @property
    def sound(self) -> Mask:
        """Whether the test of each laboratory has a result and is not INVALID, (laboratory,)."""
        return self.has_result & ~self.invalid

    @property
    def variances(self) -> dict[str, HitVariance]:
        """Variance of a hit in each result. An INVALID test has 0 degrees of freedom."""
        by_result = {}
        for name, budgets in self.results.items():
            assert budgets.scatter is not None
            variance = budgets.scatter.variance
            by_result[name] = replace(variance, dof=np.where(self.sound, variance.dof, 0.0))
        return by_result

    def reasons(self, laboratory: int) -> tuple[str, ...]:
        """Return the reasons of the verdict of one laboratory, () for PASS."""
        return sentences_of(self.reason_table, self.verdicts[laboratory], laboratory)

    def row(
        self, laboratory: int, session_of: Callable[[SessionBlock], Session], *, camera: bool = True
    ) -> Certification:
        """Return the certification of one laboratory, to be printed.

        `session_of` returns the session of a block of one. `camera` states whether camera and gates
        are compared.
        """
        block, reduced = self.block.row(laboratory), self.reduced.row(laboratory)
        session, procedure = session_of(block), self.procedure
        mask = self.reduced.owner == laboratory
        readings, hit_weights = self.readings.select(mask), self.hit_weights.row(laboratory, mask)
        rows = slice(laboratory, laboratory + 1)
        budgets = {
            name: each.select(rows)
            for name, each in self.results.items()
            if self.has_result[laboratory]
        }
        quantities = {name: each.row(0) for name, each in budgets.items()}
        metric, refined = quantities.pop("metric", None), None
        variances = {}
        if metric and self.verdicts[laboratory] is not Verdict.INVALID:
            scatters = {name: each.scatter for name, each in budgets.items() if each.scatter}
            variances = {
                name: each.variance.as_estimates().row(0) for name, each in scatters.items()
            }
        method = session.uncertainty
        drawable = method != MONTE_CARLO or not (metric and low_dof_source(metric))
        if metric and variances and method != FIRST and drawable:
            refined = propagate_metric(method, reduced, readings, hit_weights, metric)
            metric = replace(metric, u=refined.u, dof=refined.dof, interval_95=refined.interval)
        shots, hits, preparation = reduced.shots, reduced.shot_metric, reduced.preparation
        bat = preparation.bat.select((0, 0, 0))
        return Certification(
            session=session,
            block=block,
            procedure=procedure,
            procedure_sheet=preparation.procedure.sheet,
            bat={name: each.row(0) for name, each in preparation.bat_budgets.items()},
            shots=shots,
            shot_metric=hits,
            readings=readings,
            judgement=reduced.judgement(readings),
            hit_weights=hit_weights,
            metric=metric,
            first_order=budgets.get("metric"),
            quantities=quantities,
            variances=variances,
            refined=refined,
            width=width_of(procedure, reduced.position, reduced.valid, hits) if metric else None,
            swings=swing_range(reduced, readings) if metric else (),
            other_support=other_support(procedure, shots, bat, hit_weights) if metric else None,
            camera=compare_camera(block, reduced, readings, hit_weights) if camera else None,
            set_aside=set_aside(procedure, preparation.lot.select((0, 0))),
            findings=findings(procedure, bat),
            flags=(
                *self.checked.flags(laboratory),
                *overdue(session.particulars, session.date),
                *decisions_elsewhere(session),
            ),
            pairs=tuple(self.checked.pairs(laboratory)),
            not_checked=self.checked.left_out,
            deviations=tuple(_deviations(session, reduced, readings)),
            reasons=self.reasons(laboratory),
            verdict=self.verdicts[laboratory],
        )


def certify_reduction(
    block: SessionBlock, reduced: Reduction, readings: ImpactReadings
) -> Certifications:
    """Return results, uncertainties, flags and verdicts of a block, one test per laboratory.

    `readings` are the readings of all shots in `reduced`, (shot,). The mask
    `Certifications.has_result`, (laboratory,), marks the laboratories with a result. In any other
    laboratory the verdict is INVALID, and its numbers must not be used.
    """
    rules, hit_weights, owner = reduced.procedure, reduced.hit_weights, reduced.owner
    laboratories, mask = block.laboratories, hit_weights.used
    hits = number_shots(owner, mask, laboratories)

    def at_hits(values: Array) -> Array:
        return np.where(hits >= 0, values[hits], 0.0)

    variants = Variants.of(reduced.constants)
    earlier = nearby_variances(reduced, hit_weights)
    for name, estimates in block.history.items():
        past = HitVariance.of(estimates)
        earlier[name] = HitVariance.pool([earlier[name], past]) if name in earlier else past
    result_hits = ResultHits(
        hits=hits,
        weights=at_hits(hit_weights.weights),
        effects=at_hits(hit_weights.effects),
        positions=at_hits(np.round(reduced.position, 6)),
    )
    size = max(CACHED // (variants.sets * hits.shape[1]), 1)
    parts = [
        _results(reduced, readings, *part) for part in _split(result_hits, earlier, variants, size)
    ]
    results, efficiency_gap = parts[0] if len(parts) == 1 else _join(parts)
    has_result = np.bincount(owner, mask, laboratories) > 0
    shortfall = shortfalls(
        rules,
        laboratories,
        owner,
        reduced.position,
        reduced.valid & has_result[owner],
        reduced.shot_metric,
    )
    for name in DECIDING & results.keys():
        results[name] = add_shortfall(results[name], shortfall)
    metric = results["metric"]
    checked = check(
        Evidence(
            block=block,
            reduced=reduced,
            readings=readings,
            hit_weights=hit_weights,
            metric=metric,
            has_result=has_result,
            variants=variants,
            hits=hits,
            efficiency_gap=efficiency_gap,
        )
    )
    reason_table = (
        _too_few_balls(block, reduced),
        *_invalidating(rules, hit_weights, has_result, metric.u, checked),
        *unmet_rules(
            rules,
            reduced.preparation.bat,
            np.where(has_result, metric.value, np.nan),
            block.bat_construction,
        ),
    )
    return Certifications(
        block=block,
        reduced=reduced,
        readings=readings,
        hit_weights=hit_weights,
        has_result=has_result,
        results=results,
        checked=checked,
        reason_table=reason_table,
        verdicts=verdicts_of(rules, reason_table, laboratories),
    )


def nearby_variances(reduced: Reduction, hit_weights: HitWeights) -> dict[str, HitVariance]:
    """Return the variance of a hit within its position, from hits near the chosen position.

    The few final hits of a scan at one position give a poor estimate of their scatter. The other
    valid hits within the half width of a fit scatter alike, so their variance is pooled with that
    of the final hits, in the same way as the variance of an earlier test. The part of it that the
    constants explain is not subtracted. The dictionary is empty for a test without final hits.
    """
    rules, owner, position = reduced.procedure, reduced.owner, reduced.position
    if rules.scan is None or not rules.scan.final_hits:
        return {}
    off = np.abs(position - hit_weights.position[owner])
    mask = reduced.valid & ~hit_weights.used & (off < rules.scan.fit_half_width + SETTING_STEP)
    values = {name: getattr(reduced.shots, field) for name, field in QUANTITIES.items()}
    values["metric"] = reduced.shot_metric
    if rules.normalized:
        bat = reduced.preparation.bat.select((owner, 0, 0))
        values[AS_FOUND] = metric_of(rules.as_found)(Curve.from_shots(reduced.shots), bat)
    laboratories, nearby = reduced.preparation.laboratories, {}
    for name, hits in values.items():
        variance, dof = variances_within(owner[mask], position[mask], hits[mask], laboratories)
        variance = np.where(dof > 0, variance, 0.0)
        nearby[name] = HitVariance(unexplained=variance, total=variance, dof=dof)
    return nearby


def variance_of_hits(
    reduced: Reduction, hit_weights: HitWeights, final: HitVariance
) -> HitVariance:
    """Return the variance of the metric of a hit, from the final hits and those nearby.

    `final` is the variance of the final hits alone.
    """
    nearby = nearby_variances(reduced, hit_weights).get("metric")
    return final if nearby is None else HitVariance.pool([final, nearby])


def _deviations(session: Session, reduced: Reduction, readings: ImpactReadings) -> Iterator[str]:
    """Yield a sentence on each decision of a person that the rules contradict."""
    if not session.is_rehearsed:
        return
    by_rules = replace(reduced, acceptance=judge).judgement(readings).reasons
    for each in session.decisions:
        if each.accepted == bool(by_rules[each.shot]):
            rule = by_rules[each.shot] or "all rules are met"
            because = f"; stated reason: {each.because}" if each.because else ""
            yield f"{each.by} {each.word} shot {each.shot + 1} ({rule}){because}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultHits(AlignedArrays):
    """The hits from which the results of a block are computed, arrays (laboratory, hit)."""

    hits: NDArray[np.intp]  # numbers of the shots; negative: no hit
    weights: Array
    effects: Array  # effect of each hit's metric on the result
    positions: Array  # set impact positions [m]

    aligned: ClassVar = EVERY_FIELD


def _split(
    result_hits: ResultHits, earlier: Mapping[str, HitVariance], variants: Variants, size: int
) -> Iterator[tuple[slice, ResultHits, Mapping[str, HitVariance], Variants]]:
    """Yield the slice and the arguments of `_results` for `size` laboratories at a time."""
    laboratories = len(result_hits.hits)
    if laboratories <= size:  # the arrays are not copied
        yield slice(None), result_hits, earlier, variants
        return
    for first in range(0, laboratories, size):
        rows = slice(first, first + size)
        history = {name: each.select(rows) for name, each in earlier.items()}
        yield rows, result_hits.select(rows), history, variants.select(rows)


def _join(parts: Sequence[tuple[dict[str, Budgets], Array]]) -> tuple[dict[str, Budgets], Array]:
    """Return the results of `_results` for the laboratories of all parts, in order."""
    results, efficiency_gap = zip(*parts, strict=True)
    names = results[0]
    budgets = {name: Budgets.concatenate([each[name] for each in results]) for name in names}
    return budgets, np.concatenate(efficiency_gap)


def _results(
    reduced: Reduction,
    readings: ImpactReadings,
    rows: slice,
    result_hits: ResultHits,
    earlier: Mapping[str, HitVariance],
    variants: Variants,
) -> tuple[dict[str, Budgets], Array]:
    """Return the results of some laboratories, and the differences of e_A of their hits.

    `rows` are the laboratories to which the other arguments belong. A difference is e_A from recoil
    minus e_A from rebound. The array has the shape (laboratory, k, hit), with k sets of constants.
    """
    model = reduced.model(readings, result_hits.hits, rows)
    columns = variants.columns
    bat = bat_properties(columns)
    shots = model.shots(columns, bat)
    results = {
        name: means_of_hits(
            variants,
            values,
            result_hits.weights,
            result_hits.positions,
            result_hits.effects if name in DECIDING else result_hits.weights,
            earlier.get(name),
        )
        for name, values in model.quantities(columns, bat, shots).items()
    }
    return results, shots.recoil_efficiency - shots.rebound_efficiency


def _invalidating(
    procedure: Procedure,
    hit_weights: HitWeights,
    has_result: Mask,
    metric_u: Array,
    checked: Checked,
) -> Iterator[Reason]:
    """Yield the reasons why tests are INVALID."""
    none = np.array([bool(reason) for reason in hit_weights.reasons])
    yield Reason(Verdict.INVALID, none, lambda i: hit_weights.reasons[i])
    printed, most = METRICS[procedure.metric], procedure.largest_metric_u

    def too_large(i: int) -> str:
        u = printed.in_unit(float(metric_u[i]))
        stated = printed.text(lambda size: "{0:.{d}f}" if size == printed.unit_si else "{3:.{d}f}")
        allowed = printed.text(lambda size: f"{most / size:.3g}")
        text = f"the u of {printed.symbol} is {stated}, allowed up to {allowed}"
        return limit_message(text, u, -inf, printed.in_unit(most), decimals(u))

    yield Reason(Verdict.INVALID, has_result & ~(metric_u <= most), too_large)
    for name, where in checked.voids.items():
        yield Reason(Verdict.INVALID, where, partial(_by_flag, name))


def _too_few_balls(block: SessionBlock, reduced: Reduction) -> Reason:
    """Return the reason why tests with too few balls are INVALID."""
    preparation = reduced.preparation

    def sentence(i: int) -> str:
        rules, lot = reduced.procedure, preparation.lot.select((i, 0))
        number, left_out = lot.mass.size, len(set_aside(rules, lot))
        least, boxes = max(ceil(rules.least_admitted * number - 1e-9), 1), int(block.boxes[i])
        return (
            f"box {boxes} of the balls has {number - left_out} of {number} within the windows, "
            f"needs {least}"
        )

    return Reason(Verdict.INVALID, preparation.short, sentence)


def _by_flag(name: str, _laboratory: int) -> str:
    return f"flag {name}"
