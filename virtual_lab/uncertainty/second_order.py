"""Second order: mean and variance of a model by its Taylor series up to the third derivatives.

GUM 5.1.2, note, with the kurtosis κ of each input in the place of the normal one's 3:
E = f + Σ f_ii/2, Var = Σ [f_i² + (κ_i - 1)/4 f_ii² + κ_i/3 f_i f_iii] + Σ_{i<j} [f_ij² +
f_i f_ijj + f_j f_iij], derivatives per standard uncertainty of independent errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Self

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.inputs import Inputs
from virtual_lab.uncertainty.propagated import LAST_BITS
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """Points at which the second order evaluates a model: single errors and pairs of errors."""

    columns: dict[str, Array]  # values of each source, (1 + 4 n + 2 n (n - 1),), estimates first
    kurtosis: Array

    @classmethod
    def of(cls, inputs: Inputs) -> Self:
        """Return the points. Correlated inputs shift together, along independent directions."""
        names = list(inputs.sources)
        n = len(names)
        one = np.eye(n)
        pairs = list(combinations(range(n), 2))
        corners = [[a * one[i] + b * one[j]] for a in (1, -1) for b in (1, -1) for i, j in pairs]
        steps = np.concatenate([np.zeros((1, n)), one, -one, 2 * one, -2 * one, *corners])
        spread = np.diag([source.estimate.u for source in inputs.sources.values()])
        kurtosis = np.array([source.kurtosis for source in inputs.sources.values()])
        for joint in inputs.joints:
            at = [names.index(name) for name in joint.names]
            spread[np.ix_(at, at)] = joint.factor
            kurtosis[at] = 3.0
        errors = steps @ spread.T
        values = [source.estimate.value for source in inputs.sources.values()]
        return cls(dict(zip(names, (values + errors).T, strict=True)), kurtosis)

    def moments(self, values: Array) -> tuple[float, float]:
        """Return mean and standard uncertainty of an output (k,) at the points.

        Raises `InputError` if the series gives a negative variance, because it does not converge.
        """
        n = self.kurtosis.size
        middle = values[0]
        up, down, up2, down2 = values[1 : 4 * n + 1].reshape(4, n)
        corners = values[4 * n + 1 :].reshape(2, 2, n * (n - 1) // 2)
        i, j = np.array(list(combinations(range(n), 2)), int).reshape(-1, 2).T
        first = (8 * (up - down) - (up2 - down2)) / 12
        second = (16 * (up + down) - (up2 + down2) - 30 * middle) / 12
        third = (up2 - down2 - 2 * (up - down)) / 2
        mixed = (corners[0, 0] - corners[0, 1] - corners[1, 0] + corners[1, 1]) / 4
        along = corners.sum(axis=1) - 2 * np.stack([up[i], down[i]])
        across = corners.sum(axis=0) - 2 * np.stack([up[j], down[j]])
        f_ijj, f_iij = (along[0] - along[1]) / 2, (across[0] - across[1]) / 2
        squares = first**2 + (self.kurtosis - 1) / 4 * second**2 + self.kurtosis / 3 * first * third
        variance = squares.sum() + np.sum(mixed**2 + first[i] * f_ijj + first[j] * f_iij)
        if variance < -((LAST_BITS * middle) ** 2):
            allowed = "the series does not converge for these u; use method='monte-carlo'"
            raise InputError("second-order", "variance", f"{variance:.3g}", allowed)
        return float(middle + second.sum() / 2), float(np.sqrt(max(variance, 0)))
