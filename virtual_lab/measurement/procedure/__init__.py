"""A test procedure: required records, impact positions, valid hits, metric and verdict."""

from virtual_lab.measurement.procedure.choice import (
    CHOICE,
    Shortfalls,
    shortfalls,
    variances_within,
    with_choice,
)
from virtual_lab.measurement.procedure.eligibility import Finding, eligible, findings
from virtual_lab.measurement.procedure.judge import (
    Acceptance,
    Judgement,
    accepted,
    judge,
    worst_misfit,
)
from virtual_lab.measurement.procedure.lot import Lot, SetAside, admitted, lot_of
from virtual_lab.measurement.procedure.metric import Curve, Sought, metric_of, sought_of
from virtual_lab.measurement.procedure.outcome import (
    BlockOutcome,
    HitWeights,
    Verdict,
    curve_of,
    not_met,
    outcome_of,
    outcomes_of,
    verdict,
)
from virtual_lab.measurement.procedure.rules import Procedure, Windows
from virtual_lab.measurement.procedure.schedule import (
    NextShots,
    aimed_place,
    next_places,
    next_shots,
    to_set,
)

__all__ = [
    "CHOICE",
    "Acceptance",
    "BlockOutcome",
    "Curve",
    "Finding",
    "HitWeights",
    "Judgement",
    "Lot",
    "NextShots",
    "Procedure",
    "SetAside",
    "Shortfalls",
    "Sought",
    "Verdict",
    "Windows",
    "accepted",
    "admitted",
    "aimed_place",
    "curve_of",
    "eligible",
    "findings",
    "judge",
    "lot_of",
    "metric_of",
    "next_places",
    "next_shots",
    "not_met",
    "outcome_of",
    "outcomes_of",
    "shortfalls",
    "sought_of",
    "to_set",
    "variances_within",
    "verdict",
    "with_choice",
    "worst_misfit",
]
