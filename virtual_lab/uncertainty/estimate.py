"""A measured value with its standard uncertainty, from calibration or reduction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import ClassVar, Literal, Self

import numpy as np

from virtual_lab.aligned import AlignedArrays
from virtual_lab.units import Array, Mask


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Value, standard uncertainty `u` (both SI), degrees of freedom, evaluation type (GUM).

    Independent estimates with the same `pool` have a u that comes from one common scatter. A budget
    shows them as one line with the name of the pool.
    """

    value: float
    u: float = 0.0
    dof: float = inf
    evaluation: Literal["A", "B"] = "B"
    source: str = ""
    pool: str = ""

    def __post_init__(self) -> None:
        if not isfinite(self.value):
            raise ValueError(f"value must be finite, not {self.value}")
        if not (isfinite(self.u) and self.u >= 0):
            raise ValueError(f"standard uncertainty must be finite and at least 0, not {self.u}")
        if isnan(self.dof) or self.dof <= 0:
            raise ValueError(f"degrees of freedom must be above 0, not {self.dof}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates(AlignedArrays):
    """The estimates of one quantity in a block of laboratories, arrays (laboratory,).

    Value and `u` are in SI. Evaluation, source and pool are the same for every laboratory.
    """

    value: Array
    u: Array
    dof: Array
    evaluation: Literal["A", "B"] = "B"
    source: str = ""
    pool: str = ""

    aligned: ClassVar = ("value", "u", "dof")

    @classmethod
    def stack(cls, estimates: Sequence[Estimate]) -> Self:
        """Return the estimates of several laboratories as a block.

        Raises `ValueError` if they differ in evaluation, source or pool.
        """
        kinds = {(each.evaluation, each.source, each.pool) for each in estimates}
        if len(kinds) != 1:
            raise ValueError(f"estimates of one kind allowed, not {sorted(kinds)}")
        ((evaluation, source, pool),) = kinds
        value, u, dof = np.array([(each.value, each.u, each.dof) for each in estimates]).T
        return cls(value=value, u=u, dof=dof, evaluation=evaluation, source=source, pool=pool)

    def row(self, laboratory: int) -> Estimate:
        """Return the estimate of one laboratory. Raises `ValueError` if its value is not finite."""
        return Estimate(
            value=float(self.value[laboratory]),
            u=float(self.u[laboratory]),
            dof=float(self.dof[laboratory]),
            evaluation=self.evaluation,
            source=self.source,
            pool=self.pool,
        )


def means_of_readings(
    readings: Array, *, used: Mask | None = None, least_u: Array | float = 0.0
) -> Estimates:
    """Return means of repeated readings with their type A uncertainties, (laboratory,).

    The degrees of freedom are the number of used readings minus one. If `least_u` is larger than
    the u from the scatter, they are inf. With one used reading, u is NaN and the degrees of freedom
    are inf. Without a used reading, the mean is also NaN.

    Parameters
    ----------
    readings
        Repeated readings, (laboratory, n), n ≥ 2.
    used
        Mask of the readings to use, with the shape of `readings`. None means all.
    least_u
        Lower bound of the standard uncertainty of a mean, in the unit of the readings. Use step/√12
        if the resolution of the instrument, `step`, is so coarse that it may hide the scatter (GUM
        F.2.2.1).
    """
    counted = np.ones(readings.shape, dtype=bool) if used is None else used
    number = counted.sum(axis=1)
    scatter = readings.std(axis=1, ddof=1, where=counted) / np.sqrt(number)
    return Estimates(
        value=readings.mean(axis=1, where=counted),
        u=np.maximum(scatter, least_u),
        dof=np.where(scatter >= least_u, number - 1.0, inf),
        evaluation="A",
    )


def share_interval(count: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a probability, given `count` events in `of` independent cases.

    The interval is the exact one of Clopper and Pearson. It is (0, 1) if `of` is 0.
    """
    from scipy.special import betaincinv

    low = float(betaincinv(count, of - count + 1, 0.025)) if count else 0.0
    high = float(betaincinv(count + 1, of - count, 0.975)) if count < of else 1.0
    return low, high
