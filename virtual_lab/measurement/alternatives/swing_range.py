"""One test's result for a range of swing laws: v_f over their exponent n."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.measurement.procedure import (
    Curve,
    HitWeights,
    Objective,
    Procedure,
    hit_weights_of,
    metric_of,
)
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import bat_properties
from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.uncertainty.budget import Budget, Variants, means_of_hits


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingResult:
    """The metric for one exponent of the swing law."""

    exponent: float
    position: float  # position of the maximum, from the tip [m]
    budget: Budget


def swing_range(reduced: Reduction, readings: ImpactReadings) -> tuple[SwingResult, ...]:
    """Return the metric of one test for each exponent of the swing law in the procedure.

    By the swing law, bat speed is proportional to the mass or inertia of the bat to the power -n. A
    result states the exponent n, the budget of the metric, and the impact position with the largest
    metric [m from the barrel tip]. The results have the order in which the procedure lists the
    exponents. The tuple is empty if it lists none, or if one of the results cannot be computed.

    A scan has hits at several positions along the barrel. Some procedures add final hits at the
    position with the largest metric for the procedure's main exponent. These final hits are then
    used for all results, although the position for another exponent is a few tenths of an inch
    away. If there are no final hits, each result uses the hits of the scan near its own position.
    """
    rules = reduced.procedure
    if rules.game is None or not rules.game.exponents:
        return ()
    curve, measured = Curve.from_shots(reduced.shots), reduced.preparation.bat.select((0, 0, 0))
    others: dict[float, tuple[Procedure, HitWeights]] = {}
    for exponent in rules.game.exponents:
        variant_rules = replace(rules, game=replace(rules.game, exponent=exponent))
        hits = metric_of(variant_rules)(curve, measured)
        objective = Objective(hits, np.ones_like(hits))
        hit_weights = hit_weights_of(
            variant_rules, 1, reduced.owner, reduced.position, reduced.valid, hits, objective
        )
        others[exponent] = variant_rules, hit_weights
    if not all(np.isfinite(hit_weights.weights).all() for _, hit_weights in others.values()):
        return ()

    variants = Variants.of(reduced.constants)
    columns = variants.columns
    bat = bat_properties(columns)
    variant_curve = Curve.from_shots(reduced.model(readings).shots(columns, bat))
    results = []
    for exponent, (variant_rules, hit_weights) in others.items():
        mask = hit_weights.used
        hits, positions = (
            metric_of(variant_rules)(variant_curve, bat)[..., mask],
            np.round(reduced.position[mask], 6),
        )
        weights = hit_weights.weights[None, mask]
        budget = means_of_hits(variants, hits, weights, positions[None], weights).row(0)
        results.append(
            SwingResult(exponent=exponent, position=float(hit_weights.position[0]), budget=budget)
        )
    return tuple(results)
