"""A test procedure: what to ask of a rig, where to hit, which hits count, metric and verdict."""

from virtual_lab.measurement.procedure.choice import CHOICE, shortfall, with_choice
from virtual_lab.measurement.procedure.eligibility import Finding, findings
from virtual_lab.measurement.procedure.judge import Judgement, judge
from virtual_lab.measurement.procedure.metric import Curve, metric_of
from virtual_lab.measurement.procedure.outcome import (
    Outcome,
    Verdict,
    exact_result,
    outcome_of,
    verdict,
)
from virtual_lab.measurement.procedure.rules import Procedure, Windows
from virtual_lab.measurement.procedure.schedule import aimed_place, next_places, to_set

__all__ = [
    "CHOICE",
    "Curve",
    "Finding",
    "Judgement",
    "Outcome",
    "Procedure",
    "Verdict",
    "Windows",
    "aimed_place",
    "exact_result",
    "findings",
    "judge",
    "metric_of",
    "next_places",
    "outcome_of",
    "shortfall",
    "to_set",
    "verdict",
    "with_choice",
]
