"""From a session to its result: the metric, its uncertainty, the verdict.

The input is raw records, calibrations and the procedure only; the computation is the same for
records of our simulated rigs and of another laboratory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.catalog import Datum
from virtual_lab.measurement.camera.comparison import CameraComparison, compare_camera
from virtual_lab.measurement.diagnostics import (
    BlockChecked,
    Discrepancy,
    Evidence,
    Flag,
    check,
    overdue,
)
from virtual_lab.measurement.model import MeasurementModel
from virtual_lab.measurement.other_support import OtherSupport, other_support
from virtual_lab.measurement.procedure import (
    BlockOutcome,
    Finding,
    HitWeights,
    Judgement,
    Procedure,
    SetAside,
    Verdict,
    eligible,
    findings,
    not_met,
    shortfalls,
    verdict,
    with_choice,
)
from virtual_lab.measurement.procedure.peak_width import Width, width_of
from virtual_lab.measurement.reduction.flights import numbered
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    BatProperties,
    ShotResults,
    bat_properties,
)
from virtual_lab.measurement.refined import refined, too_wide
from virtual_lab.measurement.session_reduction import (
    BlockReduction,
    SessionReduction,
    reduce_session,
)
from virtual_lab.measurement.swing_range import SwingResult, swing_range
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import beyond, decimals
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Budgets, Variants, means_of_hits
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.uncertainty.monte_carlo import MONTE_CARLO
from virtual_lab.uncertainty.propagated import Propagated
from virtual_lab.uncertainty.propagating import FIRST
from virtual_lab.uncertainty.scatter import HitVariance
from virtual_lab.units import Array, Mask

CACHED = 80_000  # largest number of values of an array that stays in the processor's cache


@dataclass(frozen=True, slots=True, kw_only=True)
class Certification:
    """The outcome of one test; all values are measured."""

    session: Session
    procedure: Procedure
    procedure_sheet: tuple[Datum, ...]
    bat: Mapping[str, Budget]  # mass, length, z_cm, inertia_cm
    shots: ShotResults
    shot_metric: Array  # (shot,)
    readings: ImpactReadings
    judgement: Judgement
    outcome: HitWeights
    metric: Budget | None  # budget of the metric; None if too few hits were valid
    quantities: Mapping[str, Budget]  # budgets by the keys of QUANTITIES; {} without a metric
    # variance of one hit in each result, from this test alone; {} if the test is INVALID
    variances: Mapping[str, Estimate]
    refined: Propagated | None  # result of second order or Monte Carlo; None: first order only
    width: Width | None  # peak width; None without a metric, a width rule or enough positions
    swings: tuple[SwingResult, ...]  # results by each swing law, if the rules name several
    other: OtherSupport | None
    camera: CameraComparison | None  # comparison with the camera, if it filmed the hits
    set_aside: tuple[SetAside, ...]  # balls that the rules do not admit
    # requirements of the rules for a bat before it is hit, met or not
    findings: tuple[Finding, ...]
    flags: tuple[Flag, ...]  # contradictions in the records
    pairs: tuple[Discrepancy, ...]  # differences between two measurements of one quantity
    not_checked: tuple[str, ...]  # checks of readings that the records do not hold
    reasons: tuple[str, ...]  # reasons of a verdict INVALID or FAIL
    verdict: Verdict

    @property
    def marginal(self) -> bool:
        """Whether the limit decides the verdict and lies within the 95 % interval."""
        decides = self.verdict is not Verdict.INVALID and all(each.met for each in self.findings)
        if not decides or self.metric is None or self.procedure.metric_limit is None:
            return False
        low, high = self.metric.interval_95
        return low <= self.procedure.metric_limit <= high

    @property
    def unverified(self) -> tuple[Datum, ...]:
        """The values of the procedure that were not verified in their source."""
        return tuple(datum for datum in self.procedure_sheet if not datum.verified)


def certify_session(session: Session) -> Certification:
    """Reduce a session and evaluate it. `InputError` as `reduce_session`."""
    return evaluate(session, reduce_session(session))


def evaluate(session: Session, reduced: SessionReduction) -> Certification:
    """Return metric, uncertainty and verdict of a session already reduced."""
    found = evaluate_block(
        SessionBlock.of(session), BlockReduction.alone(reduced), reduced.readings
    )
    return found.of(0, session, reduced)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockCertification:
    """The outcomes of the tests of a block; all values are measured."""

    procedure: Procedure
    outcome: BlockOutcome
    some: Mask  # mask of the laboratories with a result, (laboratory,)
    results: Mapping[str, Budgets]  # keys: ``metric``, and those of QUANTITIES
    checked: BlockChecked
    bat: BatProperties  # (laboratory, 1, 1)
    invalid: Mask  # (laboratory,)
    met: Mask  # whether the bat meets every rule, (laboratory,)

    @property
    def variances(self) -> dict[str, HitVariance]:
        """Variance of a hit in each result. An INVALID test has 0 degrees of freedom."""
        sound = self.some & ~self.invalid
        found = {}
        for name, budgets in self.results.items():
            assert budgets.scatter is not None
            own = budgets.scatter.variance
            found[name] = replace(own, dof=np.where(sound, own.dof, 0.0))
        return found

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdict of each laboratory."""
        return tuple(
            verdict(self.procedure, sound=not invalid, met=bool(met))
            for invalid, met in zip(self.invalid, self.met, strict=True)
        )

    def reasons(self, laboratory: int) -> tuple[str, ...]:
        """Return why the verdict of one laboratory is INVALID or FAIL."""
        metric = self.results["metric"]
        some = bool(self.some[laboratory])
        u, value = float(metric.u[laboratory]), float(metric.value[laboratory])
        outcome, flags = self.outcome.reasons[laboratory], self.checked.of(laboratory).flags
        invalid = tuple(_reasons(self.procedure, outcome, u if some else None, flags))
        bat = self.bat.select((laboratory, 0, 0))
        return invalid or not_met(
            self.procedure, findings(self.procedure, bat), value if some else None
        )

    def of(self, laboratory: int, session: Session, reduced: SessionReduction) -> Certification:
        """Return the certification of one laboratory, to be printed, from its records."""
        procedure, shots, outcome = reduced.procedure, reduced.shots, reduced.outcome
        where, valid = reduced.readings.place, reduced.judgement.valid
        quantities = (
            {name: budgets.row(laboratory) for name, budgets in self.results.items()}
            if self.some[laboratory]
            else {}
        )
        metric, finer = quantities.pop("metric", None), None
        variances = {}
        if metric and not self.invalid[laboratory]:
            variances = {name: own.known().row(laboratory) for name, own in self.variances.items()}
        method = session.uncertainty
        drawable = method != MONTE_CARLO or not (metric and too_wide(metric))
        if metric and variances and method != FIRST and drawable:
            finer = refined(method, reduced, metric)
            metric = replace(metric, u=finer.u, dof=finer.dof, interval_95=finer.interval)
        checked = self.checked.of(laboratory)
        return Certification(
            session=session,
            procedure=procedure,
            procedure_sheet=reduced.preparation.procedure.sheet,
            bat=reduced.preparation.bat,
            shots=shots,
            shot_metric=reduced.shot_metric,
            readings=reduced.readings,
            judgement=reduced.judgement,
            outcome=outcome,
            metric=metric,
            quantities=quantities,
            variances=variances,
            refined=finer,
            width=width_of(procedure, where, valid, reduced.shot_metric) if metric else None,
            swings=swing_range(reduced) if metric else (),
            other=other_support(procedure, shots, reduced.bat, outcome) if metric else None,
            camera=compare_camera(session, reduced),
            set_aside=reduced.preparation.lot.set_aside,
            findings=findings(procedure, reduced.bat),
            flags=(*checked.flags, *overdue(session.particulars, session.date)),
            pairs=checked.pairs,
            not_checked=checked.left_out,
            reasons=self.reasons(laboratory),
            verdict=self.verdicts[laboratory],
        )


def evaluate_block(
    block: SessionBlock,
    reduced: BlockReduction,
    readings: ImpactReadings,
) -> BlockCertification:
    """Return results, uncertainties and verdicts of a block.

    `readings` are those of all the shots reduced, (shot,).
    """
    rules, outcome, owner = reduced.procedure, reduced.outcome, reduced.owner
    laboratories = block.laboratories
    used = np.isfinite(outcome.weights) & (outcome.weights != 0)
    hits = numbered(owner, used, laboratories)

    def at_hits(values: Array) -> Array:
        return np.where(hits >= 0, values[hits], 0.0)

    preparation = reduced.preparation
    variants = Variants.of(reduced.constants)
    earlier = {name: HitVariance.of(known) for name, known in block.history.items()}
    weighing = Weighing(
        hits=hits,
        weights=at_hits(outcome.weights),
        effects=at_hits(outcome.effects),
        places=at_hits(np.round(reduced.place, 6)),
    )
    few = max(CACHED // (variants.sets * hits.shape[1]), 1)
    parts = [
        _results(reduced, readings, weighing, earlier, slice(first, first + few), variants)
        for first in range(0, laboratories, few)
    ]
    results = {name: Budgets.concatenate([each[name] for each, _ in parts]) for name in parts[0][0]}
    some = np.bincount(owner, used, laboratories) > 0
    lost = shortfalls(
        rules, laboratories, owner, reduced.place, reduced.valid & some[owner], reduced.metric
    )
    results["metric"] = with_choice(results["metric"], lost)
    metric = results["metric"]
    checked = check(
        Evidence(
            block=block,
            reduced=reduced,
            readings=readings,
            outcome=outcome,
            metric=metric,
            some=some,
            variants=variants,
            hits=hits,
            apart=np.concatenate([apart for _, apart in parts]),
        )
    )
    invalid = np.array([bool(reason) for reason in outcome.reasons])
    invalid |= some & ~(metric.u <= rules.largest_metric_u)
    for voided in checked.voids.values():
        invalid |= voided
    met = eligible(rules, preparation.bat).reshape(-1)
    if rules.metric_limit is not None:
        met &= ~(some & (metric.value > rules.metric_limit))
    return BlockCertification(
        procedure=rules,
        outcome=outcome,
        some=some,
        results=results,
        checked=checked,
        bat=preparation.bat,
        invalid=invalid,
        met=met,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighing(AlignedArrays):
    """The hits from which the results of a block are computed, arrays (laboratory, hit)."""

    hits: NDArray[np.intp]  # numbers of the shots; negative: no hit
    weights: Array
    effects: Array  # effect of each hit's metric on the result
    places: Array  # set impact positions [m]

    aligned: ClassVar = EVERY_FIELD


def _results(
    reduced: BlockReduction,
    readings: ImpactReadings,
    weighing: Weighing,
    earlier: Mapping[str, HitVariance],
    some: slice,
    variants: Variants,
) -> tuple[dict[str, Budgets], Array]:
    """Return the results of some laboratories, and the difference of e_A for their hits.

    The difference is e_A from recoil minus e_A from rebound, for all sets of constants,
    (laboratory, k, hit).
    """
    weighing = weighing.select(some)
    preparation = reduced.preparation
    model = MeasurementModel(
        rules=reduced.procedure,
        balls=preparation.balls.select(np.arange(preparation.laboratories)[some]),
        used=preparation.used[some],
        readings=readings.select(weighing.hits[:, None]),
    )
    variants = variants.select(some)
    columns = variants.columns
    bat = bat_properties(columns)
    moved = model.shots(columns, bat)
    known = {name: each.select(some) for name, each in earlier.items()}
    results = {
        name: means_of_hits(
            variants,
            values,
            weighing.weights,
            weighing.places,
            weighing.effects if name == "metric" else weighing.weights,
            known.get(name),
        )
        for name, values in model.quantities(columns, bat, moved).items()
    }
    return results, moved.recoil_efficiency - moved.rebound_efficiency


def _reasons(
    procedure: Procedure, of_hits: str, metric_u: float | None, flagged: tuple[Flag, ...]
) -> Iterator[str]:
    """Return the reasons why a test is INVALID; empty if it is not.

    `of_hits` is the reason why the hits give no result, or empty. `metric_u` is the u of the
    metric, None without a result.
    """
    if of_hits:
        yield of_hits
    if metric_u is not None and not metric_u <= procedure.largest_metric_u:
        printed = METRICS[procedure.metric]
        u, most = metric_u / printed.unit_si, procedure.largest_metric_u / printed.unit_si
        text = f"u of {printed.symbol} is {{0:.{{d}}f}}, allowed up to {{2:g}} {printed.unit}"
        yield beyond(text, u, -inf, most, decimals(u)).rstrip()
    for flag in flagged:
        if flag.invalidates:
            yield f"by the flag {flag.name}"
