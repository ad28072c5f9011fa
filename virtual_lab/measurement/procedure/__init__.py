"""A test procedure: what a rig is asked for, places, valid hits, metric and verdict."""

from virtual_lab.measurement.procedure.choice import CHOICE, shortfall, variance_within, with_choice
from virtual_lab.measurement.procedure.eligibility import Finding, findings
from virtual_lab.measurement.procedure.judge import Acceptance, Judgement, judge, worst_misfit
from virtual_lab.measurement.procedure.lot import Lot, SetAside, lot_of
from virtual_lab.measurement.procedure.metric import Curve, Sought, metric_of, sought_of
from virtual_lab.measurement.procedure.outcome import (
    HitWeights,
    Verdict,
    curve_of,
    not_met,
    outcome_of,
    verdict,
)
from virtual_lab.measurement.procedure.rules import Procedure, Windows
from virtual_lab.measurement.procedure.schedule import aimed_place, next_places, to_set

__all__ = [
    "CHOICE",
    "Acceptance",
    "Curve",
    "Finding",
    "HitWeights",
    "Judgement",
    "Lot",
    "Procedure",
    "SetAside",
    "Sought",
    "Verdict",
    "Windows",
    "aimed_place",
    "curve_of",
    "findings",
    "judge",
    "lot_of",
    "metric_of",
    "next_places",
    "not_met",
    "outcome_of",
    "shortfall",
    "sought_of",
    "to_set",
    "variance_within",
    "verdict",
    "with_choice",
    "worst_misfit",
]
