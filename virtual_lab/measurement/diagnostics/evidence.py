"""Input of the checks: the records of a block and its results."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure import HitWeights, Procedure, worst_misfit
from virtual_lab.measurement.procedure.model import MeasurementModel
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls, ShotResults
from virtual_lab.measurement.session_reduction import Reduction, best_values
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.budget import Budgets, Components, Variants
from virtual_lab.units import Array, Mask

FEWEST_SHOTS = 3  # smallest number of shots for a mean and its scatter


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Input of the checks: records, constants and results of a block, shots in firing order."""

    block: SessionBlock
    reduced: Reduction
    readings: ImpactReadings
    hit_weights: HitWeights
    metric: Budgets  # budgets of the metric
    has_result: Mask  # mask of the laboratories with a result, (laboratory,)
    variants: Variants  # constants, each shifted up and down by its u
    hits: NDArray[np.intp]  # numbers of the shots in a result, (laboratory, hit); negative: none
    # e_A from recoil minus e_A from rebound of these hits, for all variants, (laboratory, k, hit)
    efficiency_gap: Array

    @property
    def procedure(self) -> Procedure:
        return self.reduced.procedure

    @property
    def laboratories(self) -> int:
        return self.block.laboratories

    @property
    def owner(self) -> NDArray[np.intp]:
        """Laboratory of each shot."""
        return self.reduced.owner

    @property
    def shots(self) -> ShotResults:
        return self.reduced.shots

    @cached_property
    def best(self) -> dict[str, Array]:
        """The constants' values, (laboratory, 1, 1)."""
        return best_values(self.reduced.constants)

    @property
    def measured_balls(self) -> MeasuredBalls:
        """Mass and e0 of each ball of the lot, (laboratory, 1, ball)."""
        return self.reduced.preparation.lot

    @cached_property
    def off_flight(self) -> Mask:
        """Mask of the shots whose edges deviate from one flight more than the procedure allows."""
        most = self.procedure.windows.edge_misfit
        worst = worst_misfit(self.shots, self.readings)
        return np.asarray(worst > (np.inf if most is None else most))

    @cached_property
    def sensitivities(self) -> dict[str, Array]:
        """Shift of each result per unit of a constant [u of the result], (laboratory,).

        NaN without a result.
        """
        certain = self.has_result & (self.metric.u > 0)
        u = np.where(certain, self.metric.u, np.nan)
        parts = self.metric.components
        return dict(zip(parts.names, parts.sensitivity.T / u, strict=True))

    def moves(self, components: Components) -> Array:
        """Return the largest shift of the result per unit of a difference, over the constants.

        A constant whose error causes the difference also shifts the result. `components` are the
        constants that contribute to the difference. The shift is in units of the result's u,
        (laboratory,). It is infinite if no constant has a known effect on the result.
        """
        worst = np.full(self.laboratories, np.nan)
        for name, effect in zip(components.names, components.sensitivity.T, strict=True):
            if name in self.sensitivities:
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.abs(self.sensitivities[name] / effect)
                worst = np.fmax(worst, np.where(effect != 0, ratio, np.nan))
        return np.where(np.isfinite(worst), worst, np.inf)

    def per_laboratory(self, values: Array | Mask) -> Array:
        """Return the sum of values (shot,) over the shots of each laboratory, (laboratory,)."""
        return np.asarray(np.bincount(self.owner, values, self.laboratories))

    def shots_of(self, used: Mask, laboratory: int) -> str:
        """Return the used shots of a laboratory as text: up to six numbers from 1, or a count."""
        shots = 1 + np.flatnonzero(used[self.owner == laboratory])
        return f"shots {', '.join(map(str, shots))}" if shots.size <= 6 else f"{shots.size} shots"

    def mean_of(self, values: Array, used: Mask) -> tuple[Array, Array, Array]:
        """Return the mean over the used shots of each laboratory, its u, and the number of shots.

        Each result has the shape (laboratory,). The u follows from the scatter of the shots. A
        value is NaN with too few shots.
        """
        number = self.per_laboratory(used)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.per_laboratory(np.where(used, values, 0.0)) / number
            deviation = np.where(used, values - mean[self.owner], 0.0)
            variance = self.per_laboratory(deviation**2) / (number - 1)
            return mean, np.sqrt(variance / number), number

    @cached_property
    def model(self) -> MeasurementModel:
        """The results of all the shots as functions of the constants, (laboratory, 1, shot)."""
        return self.reduced.model(self.readings)
