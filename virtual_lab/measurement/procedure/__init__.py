"""A test procedure: required records, impact positions, valid hits, metric and verdict."""

from virtual_lab.measurement.procedure.choice import (
    CHOICE,
    Shortfalls,
    add_shortfall,
    shortfalls,
    variances_within,
)
from virtual_lab.measurement.procedure.eligibility import Finding, findings
from virtual_lab.measurement.procedure.judge import (
    UNDECIDED,
    Acceptance,
    Judgement,
    accept_hits,
    judge,
    judge_by,
    worst_misfit,
)
from virtual_lab.measurement.procedure.lot import (
    SetAside,
    admit_balls,
    has_too_few,
    set_aside,
)
from virtual_lab.measurement.procedure.metric import Curve, Objective, metric_of, objective_of
from virtual_lab.measurement.procedure.outcome import (
    HitWeights,
    Reason,
    Verdict,
    curve_of,
    hit_weights_of,
    sentences_of,
    unmet_rules,
    verdicts_of,
)
from virtual_lab.measurement.procedure.rules import Procedure, Windows
from virtual_lab.measurement.procedure.schedule import (
    NextShots,
    next_shots,
    percussion_position,
    round_to_setting,
)

__all__ = [
    "CHOICE",
    "UNDECIDED",
    "Acceptance",
    "Curve",
    "Finding",
    "HitWeights",
    "Judgement",
    "NextShots",
    "Objective",
    "Procedure",
    "Reason",
    "SetAside",
    "Shortfalls",
    "Verdict",
    "Windows",
    "accept_hits",
    "add_shortfall",
    "admit_balls",
    "curve_of",
    "findings",
    "has_too_few",
    "hit_weights_of",
    "judge",
    "judge_by",
    "metric_of",
    "next_shots",
    "objective_of",
    "percussion_position",
    "round_to_setting",
    "sentences_of",
    "set_aside",
    "shortfalls",
    "unmet_rules",
    "variances_within",
    "verdicts_of",
    "worst_misfit",
]
