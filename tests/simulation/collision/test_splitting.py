"""The splitting scheme on an oscillator and a pendulum: order and stability limit."""

from __future__ import annotations

import numpy as np
import pytest

from virtual_lab.simulation.collision.modal_kernel import DRIFTS, KICKS
from virtual_lab.simulation.collision.stepping import STEPPER

ORDER, LIMIT = 6, 3.1414311  # order of the scheme, and largest stable phase of a step [rad]


def run(force: np.ufunc, steps: int, time: float) -> tuple[float, float]:
    """Integrate q'' = -force(q) from q = 1 at rest; return q and its rate."""
    q, rate, h = 1.0, 0.0, time / steps
    for _ in range(steps):
        for kick, drift in zip(KICKS, [*DRIFTS, 0.0], strict=True):
            rate -= kick * h * force(q)
            q += drift * h * rate
    return q, rate


@pytest.mark.parametrize("force", [np.positive, np.sin], ids=["oscillator", "pendulum"])
def test_the_observed_order_is_the_nominal_one(force: np.ufunc) -> None:
    exact = (np.cos(6.0), -np.sin(6.0)) if force is np.positive else run(force, 200, 6.0)
    errors = [np.hypot(*np.subtract(run(force, n, 6.0), exact)) for n in (8, 16)]
    order = np.log2(errors[0] / errors[1])
    print(f"errors {errors}, observed order {order:.2f}")
    assert order == pytest.approx(ORDER, abs=0.4)


def test_the_coefficients_add_up_to_one_and_are_symmetric() -> None:
    for shares in (KICKS, DRIFTS):
        assert shares.sum() == pytest.approx(1, abs=1e-14)
        assert np.array_equal(shares, shares[::-1])
    assert len(KICKS) == len(DRIFTS) + 1


def modulus(phase: float) -> float:
    """Return the largest modulus of the eigenvalues of a step of an oscillator."""
    matrix = np.eye(2)
    for kick, drift in zip(KICKS, [*DRIFTS, 0.0], strict=True):
        matrix = np.array([[1, 0], [-kick * phase, 1]]) @ matrix
        matrix = np.array([[1, drift * phase], [0, 1]]) @ matrix
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def test_the_default_steps_are_stable() -> None:
    below = np.append(np.linspace(0.01, LIMIT - 1e-3, 500), LIMIT - 1e-6)
    assert max(modulus(phase) for phase in below) < 1 + 1e-10
    assert modulus(LIMIT + 1e-5) > 1 + 1e-5
    assert max(STEPPER.mode_step, STEPPER.ball_step) < LIMIT
