"""The study of effects for cases made by hand: least squares, root mean squares, errors."""

from __future__ import annotations

from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from tests.studies import effects as study
from tests.studies.effects import HITS, Effect, effects
from virtual_lab.measurement.procedure import CHOICE
from virtual_lab.uncertainty.budget import Component

COUNT = 40
CLOCK, SENSITIVITY = "impact.gates.clock", -0.5


def component(name: str, u: float, sensitivity: float) -> Component:
    return Component(
        name=name,
        value=0.0,
        u=u,
        evaluation="B",
        dof=np.inf,
        sensitivity=sensitivity,
        contribution=abs(sensitivity) * u,
    )


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> tuple[list[Effect], np.ndarray, np.ndarray]:
    """Return the study of cases with one constant, hits and a choice; also both errors.

    The u of the constant alternates .01 and .02, the hits' contribution 3e-3 and 4e-3.
    """
    rng = np.random.default_rng(3)
    off = rng.normal(0, 0.015, COUNT)
    error = 1e-3 + -0.7 * off + rng.normal(0, 2e-3, COUNT)
    cases = [
        study._Case(
            error=float(error[k]),
            choice=(1e-3, 3e-3)[k % 2],
            components={
                CLOCK: component(CLOCK, (0.01, 0.02)[k % 2], SENSITIVITY),
                HITS: component(HITS, (3e-3, 4e-3)[k % 2], 1.0),
                CHOICE: component(CHOICE, 1e-3, 1.0),
            },
            constant_errors={CLOCK: float(off[k])},
            across=np.zeros(2),
        )
        for k in range(COUNT)
    ]
    block = SimpleNamespace(certified=SimpleNamespace(invalid=np.zeros(COUNT, bool)))
    rules = SimpleNamespace(spec=SimpleNamespace(metric="bat_performance_factor"))
    setup = SimpleNamespace(rules=rules)
    shared = SimpleNamespace(setup=setup, each_block=lambda take, *_: [take(block)])
    monkeypatch.setattr(study, "RoundRobin", SimpleNamespace(of=lambda *_, **__: shared))
    monkeypatch.setattr(study, "_cases", lambda _: cases)
    return effects("r161", "astm-f1881", 1000), error, off


def test_effects_are_the_slopes_of_least_squares(found: Any) -> None:
    """The oracle is scipy.stats.linregress of both errors, over the rms u √((1 + 4)/2) 1e-2."""
    rows, error, off = found
    (row,) = (each for each in rows if each.component == CLOCK)
    u = sqrt(2.5e-4)
    line = stats.linregress(off / u, error)
    assert row.stated_effect == pytest.approx(SENSITIVITY * u)
    assert row.real_effect == pytest.approx(line.slope, rel=1e-9)
    assert row.real_effect_se == pytest.approx(line.stderr, rel=1e-9)
    assert row.difference_in_se == pytest.approx(
        (line.slope - SENSITIVITY * u) / line.stderr, rel=1e-9
    )


def test_hits_are_what_the_line_leaves(found: Any) -> None:
    """s² has 40 - 2 degrees, its error is s/√(2 · 38) (GUM E.4.3); stated: √((9 + 16)/2) 1e-3."""
    rows, error, off = found
    (row,) = (each for each in rows if each.component == HITS)
    line = stats.linregress(off, error)
    rest = error - line.intercept - line.slope * off
    s = sqrt(float(rest @ rest) / 38)
    assert row.stated_effect == pytest.approx(sqrt(12.5e-6))
    assert (row.real_effect, row.real_effect_se) == pytest.approx((s, s / sqrt(2 * 38)), rel=1e-9)


def test_a_choice_is_its_root_mean_square(found: Any) -> None:
    """Alternating 1 and 3: mean square 5, s of the squares 4 √(40/39); d√x = dx/2√x."""
    rows, *_ = found
    (row,) = (each for each in rows if each.component == CHOICE)
    assert row.real_effect == pytest.approx(1e-3 * sqrt(5))
    assert row.real_effect_se == pytest.approx(1e-3 * 4 * sqrt(40 / 39) / sqrt(40) / (2 * sqrt(5)))


def test_the_largest_term_is_first(found: Any) -> None:
    assert [row.component for row in found[0]] == [CLOCK, HITS, CHOICE]
