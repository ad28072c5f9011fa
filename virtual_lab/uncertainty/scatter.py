"""Scatter of the hits of a test, combined with that of the laboratory's earlier tests.

Six hits give a poor estimate of their scatter, and if they agree by chance, the test states a u
that is too small. The variance of a hit, minus the part that the constants of the budget explain,
should be the same in all tests by one procedure. The variances of earlier tests and of this test
are therefore averaged with their degrees of freedom as weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.units import Array, Mask

LARGER_BY_CHANCE = 0.01  # significance of the one-sided F test against earlier tests
LEAST_UNEXPLAINED = 1e-3  # smallest unexplained share of the total variance; keeps ν above 0


@dataclass(frozen=True, slots=True, kw_only=True)
class HitVariance(AlignedArrays):
    """Variance of a hit within its impact position, (laboratory,)."""

    unexplained: Array  # total minus the part explained by constants, which can be negative
    total: Array
    dof: Array  # degrees of freedom, 0 with too few hits

    aligned: ClassVar = EVERY_FIELD

    @classmethod
    def of(cls, estimates: Estimates) -> Self:
        """Return the variance from estimates with value s² and u = √(2/ν) s²."""
        total = estimates.u * np.sqrt(estimates.dof / 2)
        return cls(unexplained=estimates.value, total=total, dof=estimates.dof)

    def as_estimates(self, source: str = "") -> Estimates:
        """Return the variance as a value with its u."""
        u = np.where(self.dof > 0, self.total * np.sqrt(2 / np.maximum(self.dof, 1e-300)), 0.0)
        return Estimates(value=self.unexplained, u=u, dof=self.dof, evaluation="A", source=source)

    @classmethod
    def pool(cls, tests: Sequence[HitVariance]) -> Self:
        """Return the mean of several tests, weighted by their degrees of freedom."""
        dof = np.array([each.dof for each in tests])

        def mean(values: Sequence[Array]) -> Array:
            parts = np.where(dof > 0, dof * np.array(values), 0.0)
            return np.asarray(parts.sum(axis=0) / np.maximum(dof.sum(axis=0), 1e-300))

        return cls(
            unexplained=mean([each.unexplained for each in tests]),
            total=mean([each.total for each in tests]),
            dof=dof.sum(axis=0),
        )

    def larger(self, earlier: HitVariance) -> Mask:
        """Return a mask of the laboratories with a significantly larger variance than `earlier`."""
        from scipy.special import fdtri

        freedoms = np.maximum(self.dof, 1.0), np.maximum(earlier.dof, 1.0)
        most = fdtri(*freedoms, 1 - LARGER_BY_CHANCE)
        compared = (self.dof > 0) & (earlier.dof > 0)
        return np.asarray(compared & (self.total > most * earlier.total))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter(AlignedArrays):
    """Scatter of weighted sums of hits, (laboratory,)."""

    u: Array
    dof: Array
    weighing: Array  # sum of the squared weights
    variance: HitVariance

    aligned: ClassVar = EVERY_FIELD

    @classmethod
    def of_hits(cls, hits: Array, weights: Array, groups: Array, effects: Array) -> Self:
        """Return the scatter of weighted sums of hits, from the scatter at each impact position.

        The variance is estimated at each position separately, because an error of aim has a larger
        effect where the response of the bat changes quickly. A position with a single hit gets the
        pooled variance of the others.

        Parameters
        ----------
        hits, weights, groups
            Values, their weights in the result, and their positions, (laboratory, hit).
        effects
            Effect on each hit of one standard uncertainty of each constant in the same budget,
            (laboratory, constant, hit). The mean scatter that these effects cause within a position
            is subtracted from its variance (never below 0), because the budget contains it.
        """
        from virtual_lab.uncertainty.budget_kernel import scatter_u

        out = np.empty((6, len(hits)))
        # copies of views and of read-only arrays, for which the function would be compiled again
        values, shares, at, moves = (
            np.require(each, float, ("C", "W")) for each in (hits, weights, groups, effects)
        )
        scatter_u(values, shares, at, moves, out)
        u, dof, weighing, total, unexplained, freedom = out
        variance = HitVariance(unexplained=unexplained, total=total, dof=freedom)
        return cls(u=u, dof=dof, weighing=weighing, variance=variance)

    def pool_with(self, earlier: HitVariance) -> Self:
        """Return the scatter pooled with that of earlier tests.

        Today's scatter is returned alone if it is significantly larger.
        """
        both = HitVariance.pool([self.variance, earlier])
        unexplained = np.maximum(both.unexplained, LEAST_UNEXPLAINED * both.total)
        alone = self.variance.larger(earlier) | ~(unexplained > 0)
        unexplained = np.where(alone, 1.0, unexplained)
        share = unexplained / np.where(alone, 1.0, both.total)
        return replace(
            self,
            u=np.where(alone, self.u, np.sqrt(self.weighing * unexplained)),
            # subtraction of a known part does not change the uncertainty of a variance
            dof=np.where(alone, self.dof, both.dof * share**2),
        )


def has_larger_scatter(today: Estimate, earlier: Estimate) -> bool:
    """Return whether single hits have a significantly larger variance today than in earlier tests.

    `today` is the variance of a single hit today, with its u and degrees of freedom. `earlier` is
    the same for the earlier tests. The test is a one-sided F test at a significance level of 1 %.
    The result is False if either variance has 0 degrees of freedom.
    """
    new, old = (HitVariance.of(Estimates.stack([each])) for each in (today, earlier))
    return bool(new.larger(old)[0])


def bartlett_p(variances: Array, dof: Array) -> float:
    """Return the p-value of Bartlett's test that several variances are equal, 0 to 1.

    `variances`, (n,), are above 0, and `dof`, (n,), are their degrees of freedom; n is at least 2.
    The test assumes samples from normal distributions.
    """
    from scipy.special import chdtrc

    total, groups = dof.sum(), variances.size
    pooled = float(dof @ variances) / total
    statistic = total * np.log(pooled) - dof @ np.log(variances)
    correction = 1 + (np.sum(1 / dof) - 1 / total) / (3 * (groups - 1))
    return float(chdtrc(groups - 1, statistic / correction))
