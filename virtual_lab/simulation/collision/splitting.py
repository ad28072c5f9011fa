"""Splitting Runge-Kutta-Nystrom schemes: kick, drift, kick, ..., kick.

For ``q'' = f(q)`` each kick adds its share of the step times f to q', and each drift adds its
share of the step times q' to q. The schemes are symplectic and symmetric; a test measures their
orders. Source: S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Splitting:
    """A splitting scheme: the shares of its kicks and of its drifts, each with the sum 1."""

    order: int
    kicks: NDArray[np.float64]  # one more element than drifts
    drifts: NDArray[np.float64]

    @cached_property
    def limit(self) -> float:
        """Largest phase per step [rad] at which an oscillator is stable.

        Both eigenvalues of a step are on the unit circle as long as half its trace is between -1
        and 1. An exact integration would give half the trace cos(phase), which touches -1 at a
        phase of pi; here it crosses -1 near this phase.
        """
        trace = self._half_trace
        roots = np.concatenate([(trace - sign).roots() for sign in (1, -1)])
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-3)]
        return float(np.sqrt(real.min()))

    @cached_property
    def _half_trace(self) -> Polynomial:
        """Return half the trace of a step of ``q'' = -phase^2 q``, as a polynomial in phase^2."""
        square = Polynomial([0.0, 1.0])
        q, rate = [Polynomial([1.0]), Polynomial([0.0])], [Polynomial([0.0]), Polynomial([1.0])]
        for kick, drift in zip(self.kicks, [*self.drifts, 0.0], strict=True):
            for i in (0, 1):  # initial states q = 1 and q' = 1
                rate[i] -= kick * square * q[i]
                q[i] += drift * rate[i]
        return (q[0] + rate[1]) / 2


def _symmetric(kicks: tuple[float, ...], drifts: tuple[float, ...]) -> Splitting:
    """Return a symmetric scheme from its first half; the middle share completes each sum."""
    kick, drift = 0.5 - sum(kicks), 1 - 2 * sum(drifts)
    return Splitting(
        order=6,
        kicks=np.array([*kicks, kick, kick, *reversed(kicks)]),
        drifts=np.array([*drifts, drift, *reversed(drifts)]),
    )


# SRKN_11^b: eleven evaluations per step
SRKN_11 = _symmetric(
    (
        0.0414649985182624,
        0.198128671918067,
        -0.0400061921041533,
        0.0752539843015807,
        -0.0115113874206879,
    ),
    (
        0.123229775946271,
        0.290553797799558,
        -0.127049212625417,
        -0.246331761062075,
        0.357208872795928,
    ),
)
