"""The metric of one test by second order or Monte Carlo instead of first order.

The inputs are the constants of the measurement model and the further components of the budget: the
scatter of the hits and the choice of a position. The procedure still determines the value and the
verdict. The method determines u and the interval.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from virtual_lab.measurement.procedure import HitWeights
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.parameters import Propagation
from virtual_lab.uncertainty.budget import Budget, Component
from virtual_lab.uncertainty.inputs import Input, InputName
from virtual_lab.uncertainty.propagated import Propagated
from virtual_lab.uncertainty.propagating import propagate_inputs
from virtual_lab.units import Array

ROWS = 1024  # number of sets of constants per call of the model
# smallest number of degrees of freedom of a source for which draws give u in a reasonable time. A t
# distribution with 2 has no finite u. For two digits of u, 2.5 took up to 90 million draws, and 3
# up to 4 million.
LEAST_FREEDOM = 3.0


def propagate_metric(
    method: Propagation,
    reduced: Reduction,
    readings: ImpactReadings,
    hit_weights: HitWeights,
    linear: Budget,
    draws: int | None = None,
) -> Propagated:
    """Return the metric of one test, its u and its 95 % interval, propagated by `method` [SI].

    `readings` and `hit_weights` must belong to the same test as `reduced`, and `linear` is its
    first-order budget. `draws` is the number of Monte Carlo draws. By default, draws are added
    until two digits of u are correct. Raises `InputError` if too many draws are needed, or if
    second order does not converge.
    """
    model, inputs = model_of(reduced, readings, hit_weights, linear)
    return propagate_inputs(model, inputs, method=method, draws=draws)


def low_dof_source(linear: Budget) -> Component | None:
    """Return the source of uncertainty with the fewest degrees of freedom, if they are below 3.

    Otherwise return None. Monte Carlo draws of a source with fewer than 3 degrees of freedom
    scatter so widely that u does not settle.

    A source is a component of the budget. If the component has parts, each part is a source
    instead. Sources with u = 0 are ignored.
    """
    parts = [part for line in linear.components for part in (line.parts or (line,)) if part.u]
    component = min(parts, key=lambda part: part.dof, default=None)
    return component if component and component.dof < LEAST_FREEDOM else None


def model_of(
    reduced: Reduction, readings: ImpactReadings, hit_weights: HitWeights, linear: Budget
) -> tuple[Callable[..., Array], dict[InputName, Any]]:
    """Return a function that computes the metric of one test, and its inputs keyed by name.

    The function takes one array (k,) per input, as keyword arguments, and returns the metric, (k,)
    [SI]. `linear` is the first-order budget of the metric. The inputs are the constants of the
    reduction, and one error for each component of `linear` that is not such a constant. The value
    of an error is 0.
    """
    indices = np.flatnonzero(hit_weights.used)
    model, effects = reduced.model(readings, indices[None]), hit_weights.effects[indices]
    inputs: dict[str, Any] = {name: each.row(0) for name, each in reduced.constants.items()}
    errors = {
        part.name: Input(0.0, part.u, part.dof, evaluation="A")
        for part in linear.components
        if not part.parts and part.name not in inputs
    }

    def hits(constants: Mapping[str, Array]) -> Array:
        columns = {name: constants[name][None, :, None] for name in inputs}
        return np.asarray(model(columns)["metric"][0] @ effects)

    best = hits({name: np.array([each.value]) for name, each in inputs.items()})

    def metric(**columns: Array) -> Array:
        rows = next(iter(columns.values())).size
        parts = [
            hits({name: values[first : first + ROWS] for name, values in columns.items()})
            for first in range(0, rows, ROWS)
        ]
        return linear.value - best + np.concatenate(parts) + sum(columns[name] for name in errors)

    return metric, dict[InputName, Any]((inputs | errors).items())
