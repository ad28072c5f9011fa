"""One test's result for a range of swing laws: v_f over their exponent n."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure import Curve, Outcome, Procedure, metric_of, outcome_of
from virtual_lab.measurement.reduction.shot_algebra import bat_properties
from virtual_lab.measurement.session_reduction import Reduced
from virtual_lab.uncertainty.budget import Budget, combine, propagate, scatter

__all__ = ["SwingResult", "swing_range"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingResult:
    """The metric for one exponent of the swing law."""

    exponent: float
    place: float  # of its greatest value, from the tip [m]
    budget: Budget


def swing_range(reduced: Reduced) -> tuple[SwingResult, ...]:
    """Return the metric for each of the game's `exponents`; () where the rules name none.

    The hits are those of the test. The scan closed in on the best place of the procedure's own
    exponent; for another one the top lies a few tenths of an inch beside it.
    """
    rules = reduced.procedure.spec
    if rules.game is None or not rules.game.exponents:
        return ()
    place, valid = reduced.readings.place, reduced.judgement.valid
    curve = Curve.measured(reduced.shots)
    others: dict[float, tuple[Procedure, Outcome, Array]] = {}
    for exponent in rules.game.exponents:
        other = replace(rules, game=replace(rules.game, exponent=exponent))
        hits = metric_of(other)(curve, reduced.bat)
        others[exponent] = other, outcome_of(other, place, valid, hits), hits
    if not all(np.isfinite(outcome.weights).all() for _, outcome, _ in others.values()):
        return ()

    def results(x: Mapping[str, Array]) -> dict[str, Array]:
        own, bat = Curve.measured(reduced.results(x)), bat_properties(x)
        return {
            str(exponent): metric_of(other)(own, bat)[..., outcome.used]
            @ outcome.weights[outcome.used]
            for exponent, (other, outcome, _) in others.items()
        }

    shared = propagate(results, reduced.constants)
    found = []
    for exponent, (_, outcome, hits) in others.items():
        used = outcome.used
        value = float(hits[used] @ outcome.weights[used])
        part = scatter(hits[used], outcome.weights[used], np.round(place[used], 6))
        budget = combine(value, [*shared[str(exponent)], part])
        found.append(SwingResult(exponent=exponent, place=outcome.place, budget=budget))
    return tuple(found)
