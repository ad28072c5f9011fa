"""One laboratory as a block of one, for examples of textbooks and papers without blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from virtual_lab.measurement.procedure import (
    HitWeights,
    Objective,
    Procedure,
    hit_weights_of,
    next_shots,
)
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.session_reduction import Reduction, reduce_block
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Components, Variants, combine_components
from virtual_lab.uncertainty.estimate import Estimate, Estimates


def stacked(constants: Mapping[str, Estimate]) -> dict[str, Estimates]:
    return {name: Estimates.stack([each]) for name, each in constants.items()}


def propagate(
    model: Callable[[Mapping[str, Any]], Mapping[str, Any]], constants: Mapping[str, Estimate]
) -> dict[str, Components]:
    """Return the components of each output of a model of columns (k, 1), which returns (k,)."""
    variants = Variants.of(stacked(constants))
    values = model({name: column[0] for name, column in variants.columns.items()})
    return {name: variants.components(each[None]) for name, each in values.items()}


def combine(value: float, components: Components) -> Budget:
    return combine_components(np.array([value]), components).row(0)


def outcome_of(
    procedure: Procedure, place: Any, valid: Any, metric: Any, objective: Objective | None = None
) -> HitWeights:
    """Return the weights of the hits. A scan without an `objective` maximizes the metric."""
    alone, looked = np.zeros(len(place), int), objective or Objective(metric, np.ones_like(metric))
    return hit_weights_of(procedure, 1, alone, place, valid, metric, looked)


def next_places(
    procedure: Procedure, percussion: float, place: Any, valid: Any, objective: Any
) -> Any:
    """Return the impact positions of the next shots [m]."""
    alone = np.zeros(len(place), int)
    return next_shots(procedure, np.array([percussion]), alone, place, valid, objective).position


def reduce_session(session: Session) -> tuple[Reduction, ImpactReadings]:
    return reduce_block(SessionBlock.of(session))
