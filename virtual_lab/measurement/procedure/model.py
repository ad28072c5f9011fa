"""Results of a test as functions of the calibration constants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from virtual_lab.measurement.procedure.metric import Curve, metric_of
from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.flights import FlightModel
from virtual_lab.measurement.reduction.observations import BallReadings, ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    BatProperties,
    SetResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.units import Array, Mask

CONTROL = "control.restitution_ratio"

QUANTITIES: Mapping[str, str] = {  # name in a certificate: field of the shots that is averaged
    "bat_performance_factor": "bat_performance_factor",
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "recoil_factor": "aimed_recoil_factor",
    "ball_restitution": "lot_ball_restitution",
}
AS_FOUND = "metric_as_found"  # metric with the balls of the lot, if the rules correct for them


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementModel:
    """The results of a test as functions of its constants.

    The constants are numbers, or arrays whose last axis has length 1 for the shots. Leading axes
    (laboratories, variants, Monte Carlo samples) are leading axes of the results, (..., shot). The
    result and its uncertainty come from this one model.
    """

    rules: Procedure
    balls: BallReadings
    used: Mask  # (..., ball), balls that define the lot
    readings: ImpactReadings

    def __call__(self, constants: Mapping[str, Array]) -> dict[str, Array]:
        """Return the quantities of a certificate, `AS_FOUND` and ``metric``, each (..., shot)."""
        bat = bat_properties(constants)
        return self.quantities(constants, bat, self.shots(constants, bat))

    def quantities(
        self, constants: Mapping[str, Array], bat: BatProperties, shots: SetResults
    ) -> dict[str, Array]:
        """Return the quantities of `__call__` from the bat and the shots for these constants."""
        values = {name: getattr(shots, field) for name, field in QUANTITIES.items()}
        control = constants[CONTROL] if self.rules.controlled else 1.0
        curve = Curve.from_shots(shots)
        if self.rules.normalized:
            values[AS_FOUND] = metric_of(self.rules.as_found)(curve, bat)
        return values | {"metric": metric_of(self.rules, control_ratio=control)(curve, bat)}

    def shots(
        self,
        constants: Mapping[str, Array],
        bat: BatProperties,
        flight_model: FlightModel | None = None,
    ) -> SetResults:
        """Return the results of the shots. By default, `readings` are the source of the flights."""
        return shot_results(
            SetResults,
            constants,
            bat,
            measured_balls(constants, self.balls),
            self.readings,
            self.rules.reduction_settings,
            flight_model,
            self.used,
        )
