"""From a session to its result: the metric, its uncertainty, the verdict.

The input is raw records, calibrations and the procedure only; the computation is the same for
records of our simulated rigs and of another laboratory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog import Datum
from virtual_lab.measurement.camera.comparison import CameraComparison, compare_camera
from virtual_lab.measurement.diagnostics import Discrepancy, Evidence, Flag, check
from virtual_lab.measurement.model import MeasurementModel
from virtual_lab.measurement.other_support import OtherSupport, other_support
from virtual_lab.measurement.procedure import (
    BlockOutcome,
    Finding,
    HitWeights,
    Judgement,
    Procedure,
    SetAside,
    Shortfall,
    Verdict,
    findings,
    not_met,
    shortfall,
    verdict,
    with_choice,
)
from virtual_lab.measurement.procedure.peak_width import Width, width_of
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import ShotResults
from virtual_lab.measurement.session_reduction import (
    BlockPreparation,
    BlockReduction,
    SessionReduction,
    reduce_session,
)
from virtual_lab.measurement.swing_range import SwingResult, swing_range
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Budgets, Propagator, Variants, means_of_hits
from virtual_lab.uncertainty.estimate import Known
from virtual_lab.units import Array, Mask


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
    metric: Budget | None  # None where too few hits were valid to give one
    quantities: Mapping[str, Budget]  # by the keys of QUANTITIES; {} without a metric
    width: Width | None  # None too where the rules ask for none
    swings: tuple[SwingResult, ...]  # where the rules name several swing laws
    other: OtherSupport | None
    camera: CameraComparison | None  # where a camera watched the hits
    set_aside: tuple[SetAside, ...]  # balls that the rules do not admit
    findings: tuple[Finding, ...]  # what the rules ask of a bat before it is hit
    flags: tuple[Flag, ...]  # what does not hang together in the records
    pairs: tuple[Discrepancy, ...]  # by which two measurements of one thing differ
    not_checked: tuple[str, ...]  # what a recorder that sums up keeps too little for
    reasons: tuple[str, ...]  # why the verdict is INVALID or FAIL
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


def evaluate(
    session: Session, reduced: SessionReduction, propagator: Propagator = Variants.of
) -> Certification:
    """Return metric, uncertainty and verdict of a session already reduced.

    `propagator` carries the uncertainty of the constants through the measurement model, by
    default to first order.
    """
    preparation, outcome = reduced.preparation, reduced.outcome
    found = evaluate_block(
        BlockEvidence(
            preparation=preparation.block.alone(preparation.laboratory),
            constants={name: Known.stacked([known]) for name, known in reduced.constants.items()},
            owner=np.zeros(outcome.weights.size, dtype=np.intp),
            readings=reduced.readings,
            valid=reduced.judgement.valid,
            metric=reduced.shot_metric,
            outcome=BlockOutcome(
                weights=outcome.weights,
                effects=outcome.effects,
                place=np.array([outcome.place]),
                reasons=(outcome.reason,),
            ),
        ),
        propagator,
    )
    return _certification(session, reduced, found, 0, propagator)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockEvidence:
    """What the results of a block are evaluated from; shots as fired, (shot,)."""

    preparation: BlockPreparation
    constants: Mapping[str, Known]
    owner: NDArray[np.intp]
    readings: ImpactReadings
    valid: Mask
    metric: Array
    outcome: BlockOutcome

    @classmethod
    def of(cls, reduced: BlockReduction, readings: ImpactReadings) -> Self:
        """Return that of a reduction by the procedure, and the readings of all its shots."""
        return cls(
            preparation=reduced.preparation,
            constants=reduced.constants,
            owner=reduced.owner,
            readings=readings,
            valid=reduced.valid,
            metric=reduced.metric,
            outcome=reduced.outcome,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockResults:
    """Results of a block with their uncertainties, before flags and verdict."""

    quantities: Mapping[str, Budgets]  # by the keys of QUANTITIES, and ``metric``
    some: Mask  # which laboratories have any, (laboratory,)

    def of(self, laboratory: int) -> dict[str, Budget]:
        """Return the results of one laboratory; {} where too few hits were valid to give one."""
        if not self.some[laboratory]:
            return {}
        return {name: budgets.of(laboratory) for name, budgets in self.quantities.items()}


def evaluate_block(seen: BlockEvidence, propagator: Propagator = Variants.of) -> BlockResults:
    """Return the results of a block of laboratories with their uncertainties."""
    preparation, outcome, owner = seen.preparation, seen.outcome, seen.owner
    rules, laboratories = preparation.procedure.spec, preparation.laboratories
    used = np.isfinite(outcome.weights) & (outcome.weights != 0)
    hits = numbered(owner, used, laboratories)

    def at_hits(values: Array) -> Array:
        return np.where(hits >= 0, values[hits], 0.0)

    model = MeasurementModel(
        rules=rules,
        balls=preparation.balls,
        used=preparation.used,
        readings=seen.readings.part(hits[:, None]),
    )
    variants = propagator(seen.constants)
    weights, effects = at_hits(outcome.weights), at_hits(outcome.effects)
    places = at_hits(np.round(seen.readings.place, 6))
    quantities = {
        name: means_of_hits(
            variants, values, weights, places, effects if name == "metric" else weights
        )
        for name, values in model(variants.columns).items()
    }
    if rules.scan is not None and rules.scan.final_hits:
        lost = []
        for one in range(laboratories):
            own = owner == one
            lost.append(
                shortfall(rules, seen.readings.place[own], seen.valid[own], seen.metric[own])
                if used[own].any()
                else Shortfall(0.0, 0.0)
            )
        quantities["metric"] = with_choice(quantities["metric"], lost)
    some = np.bincount(owner, used, laboratories) > 0
    return BlockResults(quantities=quantities, some=some)


def numbered(owner: NDArray[np.intp], used: Mask, laboratories: int) -> NDArray[np.intp]:
    """Return the numbers of the shots of each laboratory that are used, (laboratory, hit).

    In the order fired; -1 fills up where one has fewer than another.
    """
    shots = np.flatnonzero(used)
    shots = shots[np.argsort(owner[shots], kind="stable")]
    own = owner[shots]
    many = np.bincount(own, minlength=laboratories)
    turn = np.arange(shots.size) - np.repeat(np.cumsum(many) - many, many)
    found = np.full((laboratories, max(int(many.max(initial=0)), 1)), -1, dtype=np.intp)
    found[own, turn] = shots
    return found


def _certification(
    session: Session,
    reduced: SessionReduction,
    results: BlockResults,
    laboratory: int,
    propagator: Propagator,
) -> Certification:
    """Return the certification of one laboratory of a block, to be printed."""
    procedure, shots, outcome = reduced.procedure, reduced.shots, reduced.outcome
    where, valid = reduced.readings.place, reduced.judgement.valid
    quantities = results.of(laboratory)
    metric = quantities.pop("metric", None)
    found = findings(procedure, reduced.bat)
    checked = check(_evidence(session, reduced, metric))
    invalid = tuple(_reasons(procedure, outcome, metric, checked.flags))
    unmet = not_met(procedure, found, metric.value if metric else None)
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
        width=width_of(procedure, where, valid, reduced.shot_metric) if metric else None,
        swings=swing_range(reduced, propagator) if metric else (),
        other=other_support(procedure, shots, reduced.bat, outcome) if metric else None,
        camera=compare_camera(session, reduced, propagator),
        set_aside=reduced.preparation.lot.set_aside,
        findings=found,
        flags=checked.flags,
        pairs=checked.pairs,
        not_checked=checked.left_out,
        reasons=invalid or unmet,
        verdict=verdict(procedure, sound=not invalid, met=not unmet),
    )


def _reasons(
    procedure: Procedure, outcome: HitWeights, metric: Budget | None, flagged: tuple[Flag, ...]
) -> Iterator[str]:
    """Return the reasons why a test is INVALID; empty if it is not."""
    if outcome.reason:
        yield outcome.reason
    if metric is not None and not metric.u <= procedure.largest_metric_u:
        printed = METRICS[procedure.metric]
        u, most = metric.u / printed.unit_si, procedure.largest_metric_u / printed.unit_si
        yield f"u of {printed.symbol} is {u:.2g}, allowed up to {most:g} {printed.unit}".rstrip()
    for flag in flagged:
        if flag.invalidates:
            yield f"by the flag {flag.name}"


def _evidence(session: Session, reduced: SessionReduction, metric: Budget | None) -> Evidence:
    return Evidence(
        session=session,
        procedure=reduced.procedure,
        constants=reduced.constants,
        bat=reduced.bat,
        balls=reduced.model.balls,
        readings=reduced.readings,
        shots=reduced.shots,
        judgement=reduced.judgement,
        model=reduced.model,
        effects=reduced.outcome.effects,
        metric=metric,
    )
