"""The first order beside a Monte Carlo of the whole measurement model (GUM Supplement 1)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.laboratories import certified
from virtual_lab.measurement.certification import evaluate
from virtual_lab.measurement.session_reduction import reduce_session
from virtual_lab.uncertainty.budget import Component, Variants
from virtual_lab.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
DRAWS = 4000


@dataclass(frozen=True)
class MonteCarlo:
    """Every constant drawn at once from its normal distribution, row after row."""

    columns: Mapping[str, Array]

    @classmethod
    def of(cls, constants: Mapping[str, Estimate]) -> "MonteCarlo":
        rng = np.random.default_rng(5)
        drawn = {}
        for name, known in constants.items():
            noise = rng.standard_normal((DRAWS, 1)) * known.u
            drawn[name] = np.concatenate([[[known.value]], known.value + noise])
        return cls(drawn)

    def components(self, values: Array) -> list[Component]:
        u = float(values[1:].std(ddof=1))
        return [
            Component(
                name="constants",
                value=0.0,
                u=u,
                evaluation="B",
                dof=np.inf,
                sensitivity=1.0,
                contribution=u,
                shift=float(values[1:].mean() - values[0]),
            )
        ]

    def effects(self, values: Array) -> Array:
        return (values[1:] - values[1:].mean(axis=0)) / np.sqrt(DRAWS - 1)

    def u(self, values: Array) -> Array:
        return np.asarray(values[1:].std(axis=0, ddof=1))


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
