"""A value with its standard uncertainty, as it is said and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.video.follow.joint import Fit

__all__ = ["Said", "from_fit", "or_none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """A value and its standard uncertainty."""

    value: float
    u: float

    def document(self) -> dict[str, float]:
        """Return it as JSON has it."""
        return {"value": self.value, "u": self.u}

    def times(self, factor: float) -> Said:
        """Return it in another unit."""
        return Said(value=factor * self.value, u=factor * self.u)


def or_none(said: Said | None) -> dict[str, float] | None:
    """Return a value as JSON has it, None where there is none."""
    return said.document() if said else None


def from_fit(fit: Fit, quantity: Callable[[Fit], float]) -> Said:
    """Return what follows from a fit with the u that the fit's covariance gives it.

    The fit is moved by one standard uncertainty along each of its own axes.
    """
    value = quantity(fit)
    powers, axes = np.linalg.eigh(fit.covariance)
    kept = powers > 1e-15 * powers.max() if powers.size else powers > 0
    steps = axes[:, kept] * np.sqrt(powers[kept])
    off = [quantity(fit.with_vector(fit.vector + step)) - value for step in steps.T]
    return Said(value=value, u=float(np.sqrt(np.sum(np.square(off)))))


def widened(said: Said, *more: float) -> Said:
    """Return a value with further standard uncertainties."""
    return replace(said, u=float(np.sqrt(said.u**2 + sum(each**2 for each in more))))
