"""Sobol's indices: which input's uncertainty the variance of a model comes from, by scipy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.inputs import InputName, InputSource, read_inputs
from virtual_lab.uncertainty.models import Model
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class _Quantiles:
    """A source as scipy asks for a distribution."""

    source: InputSource

    def ppf(self, q: Array) -> Array:
        source = self.source
        return source.estimate.value + source.scale * source.law.quantile(q, source.shape)


def sobol_indices(
    model: Callable[..., Any],
    inputs: Mapping[InputName, Any],
    *,
    points: int = 16_384,
    seed: int = 0,
) -> pd.DataFrame:
    """Return Sobol's indices of a model, a row an output and input.

    `first` is the part of the variance that an input explains alone, `total` with all its
    interactions (Saltelli 2010, by scipy.stats.sobol_indices).

    Parameters
    ----------
    model, inputs
        As for `propagate`.
    points
        A power of 2; the model is called for (inputs + 2) times as many.
    seed
        Of the scrambling of Sobol's sequence.

    Raises
    ------
    InputError
        Correlated inputs, one alone, or another number of points; else as `propagate`.
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
        raise InputError("inputs", "uncertain", len(read.sources), "allowed: two and more")
    called, names = Model.tried(model, read), list(read.sources)

    def answers(x: Array) -> Array:
        return np.stack(list(called(dict(zip(names, x, strict=True))).values()))

    found = by_scipy(
        func=answers,
        n=points,
        dists=cast("Any", [_Quantiles(source) for source in read.sources.values()]),
        rng=seed,
    )
    first, total = np.atleast_2d(found.first_order), np.atleast_2d(found.total_order)
    rows = [
        {"output": output, "input": name, "first": first[k, i], "total": total[k, i]}
        for k, output in enumerate(called.outputs)
        for i, name in enumerate(names)
    ]
    return pd.DataFrame(rows)
