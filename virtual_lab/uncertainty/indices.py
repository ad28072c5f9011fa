"""Sobol's indices: shares of the inputs in the variance of a model, by scipy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log2, sqrt
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files.dictionary import with_units
from virtual_lab.parameters import AnyModel, Seed
from virtual_lab.uncertainty.inputs import InputName, InputSource, read_inputs
from virtual_lab.uncertainty.models import Model
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd

MOST_NUMBERS = 2**27  # largest number of values that a computation holds at once


@dataclass(frozen=True, slots=True)
class _Quantiles:
    """A source with the interface of a scipy distribution."""

    source: InputSource

    def ppf(self, q: Array) -> Array:
        source = self.source
        return source.estimate.value + source.scale * source.law.quantile(q, source.shape)


def sobol_indices(
    model: AnyModel,
    inputs: Mapping[InputName, Any],
    *,
    points: int = 16_384,
    seed: Seed = 0,
) -> pd.DataFrame:
    """Return a table of Sobol's indices of a model, one row per pair of output and input.

    The column ``first_order`` has the share of the output's variance that the input explains alone.
    The column ``total_order`` has the share with all its interactions (Saltelli 2010, by
    scipy.stats.sobol_indices). The columns ``first_order_se`` and ``total_order_se`` have their
    standard errors, computed as for independent points. With Sobol's sequence the errors are mostly
    smaller. By chance, the total-order index can be smaller than the first-order index, within
    these errors.

    Parameters
    ----------
    model, inputs
        As for `propagate`.
    points
        Number of points, a power of 2. The model is evaluated ``points`` × (number of inputs + 2)
        times.
    seed
        Seed of the scrambling of Sobol's sequence.

    Raises
    ------
    InputError
        Inputs are correlated, fewer than two inputs are uncertain, the number of points is too
        large or not a power of 2, or an output does not vary. The errors of
        `propagate` are also raised.
    """
    import pandas as pd
    from scipy.stats import sobol_indices as by_scipy

    if points < 2 or points & (points - 1):
        raise InputError("", "points", points, "allowed: a power of 2")
    read = read_inputs(inputs, {})
    if read.joints:
        bound = ", ".join(read.joints[0].names)
        raise InputError("inputs", "observed together", bound, "allowed: independent inputs")
    if len(read.sources) < 2:
        raise InputError("inputs", "uncertain", len(read.sources), "allowed: at least two")
    called, names = Model.try_out(model, read), list(read.sources)
    of_A_point = len(names) * (len(names) + 2 + 8 * len(called.outputs))
    most = 1 << int(log2(MOST_NUMBERS / of_A_point))
    if points > most:
        raise InputError("", "points", points, f"allowed: a power of 2 up to {most}")
    errors: list[Array] = []

    def answers(x: Array) -> Array:
        return np.stack(list(called(dict(zip(names, x, strict=True))).values()))

    def indices(f_A: Array, f_B: Array, f_AB: Array) -> tuple[Array, Array]:
        by_library, u = indices_with_errors(f_A, f_B, f_AB)
        errors.append(u)
        return by_library[0].T, by_library[1].T

    by_library = by_scipy(
        func=answers,
        n=points,
        method=indices,
        dists=cast("Any", [_Quantiles(source) for source in read.sources.values()]),
        rng=seed,
    )
    called.require_same()
    first, total = np.atleast_2d(by_library.first_order), np.atleast_2d(by_library.total_order)
    first_se, total_se = errors[0]
    columns = {
        "first_order": first,
        "first_order_se": first_se.T,
        "total_order": total,
        "total_order_se": total_se.T,
    }
    rows = [
        {"output": output, "input": name, **{key: each[k, i] for key, each in columns.items()}}
        for k, output in enumerate(called.outputs)
        for i, name in enumerate(names)
    ]
    return with_units(pd.DataFrame(rows))


def indices_with_errors(f_A: Array, f_B: Array, f_AB: Array) -> tuple[Array, Array]:
    """Return Sobol's indices, and their standard errors, each (2, input, output).

    Along the first axis are the first-order indices and then the total indices. They are shares of
    the output's variance, 0 to 1 apart from sampling errors. The estimators are (b) and (f) in
    Table 2 of Saltelli 2010. Each is a mean over the points, divided by the variance of the output.
    The standard errors follow from the scatter over the points by first-order propagation. Raises
    `InputError` for an output that does not vary.

    Parameters
    ----------
    f_A, f_B
        Outputs of the model for two independent samples A and B of the inputs, (output, point). The
        mean of each output is subtracted.
    f_AB
        The same for sample A with one input replaced by that of sample B, (input, output, point).
    """
    squares = (f_A**2 + f_B**2) / 2
    variance = squares.mean(axis=-1)
    if not variance.all():
        allowed = "one of them depends on no input; leave it out"
        raise InputError("model", "outputs", None, allowed)
    parts = np.stack([f_B * (f_AB - f_A), (f_AB - f_A) ** 2 / 2])
    mean = parts.mean(axis=-1) / variance
    parts -= mean[..., None] * squares
    return mean, parts.std(axis=-1) / variance / sqrt(squares.shape[-1])
