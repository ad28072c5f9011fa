"""From a session to its result: the metric, its uncertainty, the verdict.

The input is raw records, calibrations and the procedure only; the computation is the same for
records of our simulated rigs and of another laboratory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from virtual_lab.catalog import Datum
from virtual_lab.measurement.camera.comparison import CameraComparison, compare_camera
from virtual_lab.measurement.diagnostics import Discrepancy, Evidence, Flag, check
from virtual_lab.measurement.other_support import OtherSupport, other_support
from virtual_lab.measurement.procedure import (
    Finding,
    HitWeights,
    Judgement,
    Procedure,
    SetAside,
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
from virtual_lab.measurement.session_reduction import SessionReduction, reduce_session
from virtual_lab.measurement.swing_range import SwingResult, swing_range
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Propagator, Variants, mean_of_hits
from virtual_lab.units import Array


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
    procedure, shots, outcome = reduced.procedure, reduced.shots, reduced.outcome
    where, valid = reduced.readings.place, reduced.judgement.valid
    quantities: dict[str, Budget] = {}
    metric = None
    if np.isfinite(outcome.weights).all():
        variants, used = propagator(reduced.constants), outcome.used
        weights, effects = outcome.weights[used], outcome.effects[used]
        places = np.round(where, 6)[used]
        for name, hits in reduced.model(variants.columns).items():
            own = effects if name == "metric" else weights
            quantities[name] = mean_of_hits(variants, hits[..., used], weights, places, own)
        lost = shortfall(procedure, where, valid, reduced.shot_metric)
        metric = with_choice(quantities.pop("metric"), lost)
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
        set_aside=reduced.model.lot.set_aside,
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
