"""One test's result for a range of swing laws: v_f over their exponent n."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.measurement.procedure import Curve, HitWeights, Procedure, metric_of, outcome_of
from virtual_lab.measurement.reduction.shot_algebra import bat_properties
from virtual_lab.measurement.session_reduction import SessionReduction
from virtual_lab.uncertainty.budget import Budget, Variants, mean_of_hits


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingResult:
    """The metric for one exponent of the swing law."""

    exponent: float
    place: float  # position of the maximum, from the tip [m]
    budget: Budget


def swing_range(reduced: SessionReduction) -> tuple[SwingResult, ...]:
    """Return the metric for each of the game's `exponents`, () if the rules name none.

    The hits are those of the test. The scan is centred on the best place for the procedure's
    exponent; for another exponent the maximum lies a few tenths of an inch away.
    """
    rules = reduced.procedure
    if rules.game is None or not rules.game.exponents:
        return ()
    place, valid = reduced.readings.place, reduced.judgement.valid
    curve = Curve.measured(reduced.shots)
    others: dict[float, tuple[Procedure, HitWeights]] = {}
    for exponent in rules.game.exponents:
        other = replace(rules, game=replace(rules.game, exponent=exponent))
        hits = metric_of(other)(curve, reduced.bat)
        others[exponent] = other, outcome_of(other, place, valid, hits)
    if not all(np.isfinite(outcome.weights).all() for _, outcome in others.values()):
        return ()

    variants = Variants.of(reduced.constants)
    columns = variants.columns
    bat = bat_properties(columns)
    moved = Curve.measured(reduced.model.shots(columns, bat))
    found = []
    for exponent, (other, outcome) in others.items():
        used = outcome.used
        hits, places = metric_of(other)(moved, bat)[..., used], np.round(place[used], 6)
        budget = mean_of_hits(variants, hits, outcome.weights[used], places)
        found.append(SwingResult(exponent=exponent, place=outcome.place, budget=budget))
    return tuple(found)
