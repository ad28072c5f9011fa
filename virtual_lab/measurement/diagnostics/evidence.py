"""Input of the checks: the records of a block and its results."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.model import MeasurementModel
from virtual_lab.measurement.procedure import BlockOutcome, Procedure, worst_misfit
from virtual_lab.measurement.reduction.flights import numbered
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls, ShotResults
from virtual_lab.measurement.session_reduction import BlockReduction, best_values
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.budget import Budgets, Components, Variants
from virtual_lab.units import Array, Mask

FEWEST_SHOTS = 3  # that a mean and its scatter may rest on


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Records, constants and results of a block; shots as fired, (shot,)."""

    block: SessionBlock
    reduced: BlockReduction
    readings: ImpactReadings
    outcome: BlockOutcome
    metric: Budgets  # the results
    some: Mask  # which laboratories have one, (laboratory,)
    variants: Variants  # of the constants
    hits: NDArray[np.intp]  # numbers of the shots a result rests on, below 0: none
    apart: Array  # e_A of these by recoil less by rebound for the variants, (laboratory, k, hit)

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
        return self.reduced.results

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
        """Shots whose edges deviate from one flight by more than the procedure allows."""
        most = self.procedure.windows.edge_misfit
        worst = worst_misfit(self.shots, self.readings)
        return np.asarray(worst > (np.inf if most is None else most))

    @cached_property
    def sensitivities(self) -> dict[str, Array]:
        """The results' sensitivities to the constants, in their u a unit, (laboratory,).

        NaN without a result.
        """
        known = self.some & (self.metric.u > 0)
        u = np.where(known, self.metric.u, np.nan)
        parts = self.metric.components
        return dict(zip(parts.names, parts.sensitivity.T / u, strict=True))

    def moves(self, components: Components) -> Array:
        """Return the shift of the result per unit of a difference that one constant causes.

        `components` are those of the difference; in the result's u, of the worst constant; infinite
        where nothing is known of that, (laboratory,).
        """
        worst = np.full(self.laboratories, np.nan)
        for name, own in zip(components.names, components.sensitivity.T, strict=True):
            if name in self.sensitivities:
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.abs(self.sensitivities[name] / own)
                worst = np.fmax(worst, np.where(own != 0, ratio, np.nan))
        return np.where(np.isfinite(worst), worst, np.inf)

    def per_laboratory(self, values: Array | Mask) -> Array:
        """Return the sum of values of shots, (shot,), over each laboratory's."""
        return np.asarray(np.bincount(self.owner, values, self.laboratories))

    def shots_of(self, used: Mask, laboratory: int) -> str:
        """Return the used shots of a laboratory in words: their numbers from 1, or how many."""
        shots = 1 + np.flatnonzero(used[self.owner == laboratory])
        return f"shots {', '.join(map(str, shots))}" if shots.size <= 6 else f"{shots.size} shots"

    def mean_of(self, values: Array, used: Mask) -> tuple[Array, Array, Array]:
        """Return means over the used shots of each laboratory, their scatter's u, and the numbers.

        (laboratory,) each; NaN where too few are used.
        """
        number = self.per_laboratory(used)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.per_laboratory(np.where(used, values, 0.0)) / number
            off = np.where(used, values - mean[self.owner], 0.0)
            variance = self.per_laboratory(off**2) / (number - 1)
            return mean, np.sqrt(variance / number), number

    @cached_property
    def model(self) -> MeasurementModel:
        """The results of all the shots as functions of the constants, (laboratory, 1, shot)."""
        preparation = self.reduced.preparation
        every = numbered(self.owner, np.ones(self.owner.size, dtype=bool), self.laboratories)
        return MeasurementModel(
            rules=self.procedure,
            balls=preparation.balls,
            used=preparation.used,
            readings=self.readings.part(every[:, None]),
        )
