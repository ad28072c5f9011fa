"""Input of the checks: a session and its reduced results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.model import MeasurementModel
from virtual_lab.measurement.procedure import Judgement, Procedure, worst_misfit
from virtual_lab.measurement.reduction.observations import BallReadings, ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    BatProperties,
    MeasuredBalls,
    ShotResults,
    measured_balls,
)
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import Budget, Component
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Records, constants and results of one test."""

    session: Session
    procedure: Procedure
    constants: Mapping[str, Estimate]
    bat: BatProperties
    balls: BallReadings
    readings: ImpactReadings
    shots: ShotResults
    judgement: Judgement
    model: MeasurementModel  # the results as functions of the constants
    effects: Array  # of each shot's metric on the result, NaN: there is none, (shot,)
    metric: Budget | None  # the result

    @cached_property
    def best(self) -> dict[str, Array]:
        """The constants' values."""
        return {name: np.array(known.value) for name, known in self.constants.items()}

    @property
    def off_flight(self) -> NDArray[np.bool_]:
        """Shots whose edges deviate from one flight by more than the procedure allows, (shot,)."""
        most = self.procedure.windows.edge_misfit
        worst = worst_misfit(self.shots, self.readings)
        return np.asarray(worst > (np.inf if most is None else most))

    @property
    def sensitivities(self) -> dict[str, float]:
        """The result's sensitivities to the constants, in its u a unit; {} without a result."""
        if self.metric is None or not self.metric.u:
            return {}
        every = [part for line in self.metric.components for part in (line.parts or (line,))]
        return {part.name: part.sensitivity / self.metric.u for part in every}

    def moves(self, components: Sequence[Component]) -> float:
        """Return what a unit of a difference does to the result if one constant is its cause.

        `components` are those of the difference; in the result's u, of the worst constant.
        """
        known = self.sensitivities
        ratios = [
            abs(known[part.name] / part.sensitivity)
            for part in components
            if part.name in known and part.sensitivity
        ]
        return max(ratios, default=inf)

    @cached_property
    def measured_balls(self) -> MeasuredBalls:
        """Mass and e0 of each ball of the lot."""
        return measured_balls(self.best, self.balls)
