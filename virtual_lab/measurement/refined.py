"""The metric of one test by second order or Monte Carlo instead of first order.

The inputs are the constants of the measurement model and the further components of the budget: the
scatter of the hits and the choice of a position. The value and the verdict remain those of the
procedure; u and the interval are those of the method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from virtual_lab.measurement.session_reduction import SessionReduction
from virtual_lab.uncertainty.budget import HITS, Budget
from virtual_lab.uncertainty.inputs import Input, InputName
from virtual_lab.uncertainty.propagated import Propagated
from virtual_lab.uncertainty.propagating import propagate_inputs
from virtual_lab.units import Array

ROWS = 1024  # number of sets of constants per call of the model


def refined(
    method: str,
    reduced: SessionReduction,
    linear: Budget,
    freedom: float,
    draws: int | None = None,
) -> Propagated:
    """Return the metric of a test, `linear` by the first order, by a method of `propagate_inputs`.

    Draws are as many as make two digits of u right, or so many. `freedom`: see `model_of`.
    """
    model, inputs = model_of(reduced, linear, freedom)
    return propagate_inputs(model, inputs, method=method, draws=draws)


def model_of(
    reduced: SessionReduction, linear: Budget, freedom: float
) -> tuple[Callable[..., Array], dict[InputName, Any]]:
    """Return the metric of a test as a function of rows of inputs, (k,), and these inputs.

    The hits are a t of the degrees of freedom with which their variance was seen, `freedom`: those
    of what constants leave of it serve Welch and Satterthwaite, and may be below 1.
    """
    used = reduced.outcome.used
    model = replace(reduced.model, readings=reduced.readings.part(used))
    effects, known = reduced.outcome.effects[used], dict[str, Any](reduced.constants)
    added = {
        part.name: Input(0.0, part.u, freedom if part.name == HITS else part.dof, evaluation="A")
        for part in linear.components
        if not part.parts and part.name not in known
    }

    def hits(constants: Mapping[str, Array]) -> Array:
        columns = {name: constants[name][:, None] for name in known}
        return model(columns)["metric"] @ effects

    best = hits({name: np.array([each.value]) for name, each in known.items()})

    def metric(**drawn: Array) -> Array:
        rows = next(iter(drawn.values())).size
        parts = [
            hits({name: values[first : first + ROWS] for name, values in drawn.items()})
            for first in range(0, rows, ROWS)
        ]
        return linear.value - best + np.concatenate(parts) + sum(drawn[name] for name in added)

    return metric, dict[InputName, Any]((known | added).items())
