"""The first order beside a Monte Carlo of the whole measurement model (GUM Supplement 1)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.laboratories import certified
from virtual_lab.measurement.certification import evaluate
from virtual_lab.measurement.session_reduction import reduce_session
from virtual_lab.uncertainty.budget import Components, Variants, types_a

Array = NDArray[np.float64]
DRAWS = 4000


@dataclass(frozen=True)
class MonteCarlo:
    """Every constant drawn at once from its normal distribution, row after row."""

    columns: Mapping[str, Array]
    sets: int = DRAWS + 1

    @classmethod
    def of(cls, constants: Mapping[str, Any]) -> "MonteCarlo":
        rng = np.random.default_rng(5)
        drawn = {}
        for name, known in constants.items():
            noise = rng.standard_normal((DRAWS, 1)) * known.u
            column = np.concatenate([np.zeros((1, 1)), noise])
            drawn[name] = np.reshape(known.value, (*np.shape(known.value), 1, 1)) + column
        return cls(drawn)

    def part(self, chosen: slice) -> "MonteCarlo":
        return MonteCarlo({name: column[chosen] for name, column in self.columns.items()})

    def components(self, values: Array) -> Components:
        values = values.reshape(-1, DRAWS + 1)
        u = values[:, 1:].std(axis=1, ddof=1)
        parts = types_a("constants", values[:, 0], u)
        return replace(
            parts, evaluations=("B",), shift=(values[:, 1:].mean(axis=1) - values[:, 0])[:, None]
        )

    def effects(self, values: Array) -> Array:
        drawn = values[..., 1:, :]
        return (drawn - drawn.mean(axis=-2, keepdims=True)) / np.sqrt(DRAWS - 1)

    def u(self, values: Array) -> Array:
        return np.asarray(values[..., 1:, :].std(axis=-2, ddof=1))


@pytest.mark.parametrize(
    ("bat", "procedure"), [("r161", "astm-f1881"), ("r161", "bbcor"), ("softball-34", "asa")]
)
def test_both_give_one_uncertainty(bat: str, procedure: str) -> None:
    """Of every quantity, hits included, within 4 standard errors of 4 000 draws (4.5 %).

    A sensitivity left out, taken twice or with a wrong sign beside another, and what curvature
    makes of u, would show; a wrong u of a constant would not: both take the same.
    """
    session = certified(bat, procedure=procedure, seed=2).certification.session
    reduced = reduce_session(session)
    first, drawn = (
        evaluate(session, reduced, Variants.of),
        evaluate(session, reduced, MonteCarlo.of),
    )
    assert first.metric is not None
    assert drawn.metric is not None
    assert drawn.metric.value == pytest.approx(first.metric.value, rel=1e-12)
    for name, budget in {**first.quantities, "metric": first.metric}.items():
        other = {**drawn.quantities, "metric": drawn.metric}[name]
        assert other.u == pytest.approx(budget.u, rel=0.045), name
    assert drawn.metric.shift == pytest.approx(first.metric.shift, abs=0.08 * first.metric.u)
