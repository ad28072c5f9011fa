"""Input of the checks: a session and its reduced results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure import Judgement, Procedure, worst_misfit
from virtual_lab.measurement.reduction.observations import BallReadings, ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    BatProperties,
    MeasuredBalls,
    ShotResults,
    measured_balls,
)
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
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
    results: Callable[[Mapping[str, Array]], ShotResults]  # of any values of the constants

    @property
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
    def measured_balls(self) -> MeasuredBalls:
        """Mass and e0 of each ball of the lot."""
        return measured_balls(self.best, self.balls)
