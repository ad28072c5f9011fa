"""The splitting schemes on an oscillator and a pendulum: order and stability limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.splitting import SRKN_11, Splitting
from virtual_lab.simulation.collision.stepping import FINE


def run(scheme: Splitting, force: np.ufunc, steps: int, time: float) -> tuple[float, float]:
    """Integrate q'' = -force(q) from q = 1 at rest; return q and its rate."""
    q, rate, h = 1.0, 0.0, time / steps
    for _ in range(steps):
        for kick, drift in zip(scheme.kicks, [*scheme.drifts, 0.0], strict=True):
            rate -= kick * h * force(q)
            q += drift * h * rate
    return q, rate


@pytest.mark.parametrize("force", [np.positive, np.sin], ids=["oscillator", "pendulum"])
def test_the_observed_order_is_the_nominal_one(force: np.ufunc) -> None:
    exact = (np.cos(6.0), -np.sin(6.0)) if force is np.positive else run(SRKN_11, force, 200, 6.0)
    errors = [np.hypot(*np.subtract(run(SRKN_11, force, n, 6.0), exact)) for n in (8, 16)]
    order = np.log2(errors[0] / errors[1])
    print(f"errors {errors}, observed order {order:.2f}")
    assert order == pytest.approx(SRKN_11.order, abs=0.4)


def test_the_coefficients_add_up_to_one_and_are_symmetric() -> None:
    for shares in (SRKN_11.kicks, SRKN_11.drifts):
        assert shares.sum() == pytest.approx(1, abs=1e-14)
        assert np.array_equal(shares, shares[::-1])
    assert len(SRKN_11.kicks) == len(SRKN_11.drifts) + 1


def step_matrix(scheme: Splitting, phase: float) -> np.ndarray:
    matrix = np.eye(2)
    for kick, drift in zip(scheme.kicks, [*scheme.drifts, 0.0], strict=True):
        matrix = np.array([[1, 0], [-kick * phase, 1]]) @ matrix
        matrix = np.array([[1, drift * phase], [0, 1]]) @ matrix
    return matrix


def test_the_limit_is_where_an_eigenvalue_leaves_the_circle() -> None:
    limit = SRKN_11.limit

    def modulus(phase: float) -> float:
        return float(np.abs(np.linalg.eigvals(step_matrix(SRKN_11, phase))).max())

    below = np.append(np.linspace(0.01, limit - 1e-3, 500), limit - 1e-6)
    assert max(modulus(phase) for phase in below) < 1 + 1e-10
    assert modulus(limit + 1e-5) > 1 + 1e-5


def test_the_limit_has_its_known_value() -> None:
    assert pytest.approx(3.1414311, abs=1e-7) == SRKN_11.limit


@pytest.mark.parametrize("name", ["mode_step", "ball_step"])
def test_steps_past_the_limit_are_refused(name: str) -> None:
    limit = FINE.splitting.limit
    assert getattr(replace(FINE, **{name: limit}), name) == limit
    for value in (limit * (1 + 1e-9), 4.5, 0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match=f"modal: {name} = .*to {limit:.4f}, the limit"):
            replace(FINE, **{name: value})
