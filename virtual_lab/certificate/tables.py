"""Tables of a certification: one row per shot, one row per uncertainty component."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.certificate.filling import budget_lines
from virtual_lab.measurement.camera.comparison import CameraComparison
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.reduction.flights import FlightReadings, RawFlightsU
from virtual_lab.measurement.reduction.gates import INBOUND, OUTBOUND, GateReadings
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import DEGREE, INCH, MPH, OUNCE

if TYPE_CHECKING:
    import pandas as pd


def shot_table(certification: Certification) -> pd.DataFrame:
    """Return one row per shot: instrument readings and reduced results."""
    import pandas as pd

    shots, readings = certification.shots, certification.readings
    judgement = certification.judgement
    columns = {
        "shot": np.arange(len(shots.speed)),
        "ball": readings.ball,
        "ball_mass_oz": shots.ball_mass / OUNCE,
        "place_in": readings.place / INCH,
        **_gate_columns(readings.seen),
        "speed_mph": shots.speed / MPH,
        "rebound_mph": shots.rebound_speed / MPH,
        **_speed_u_columns(readings.seen.raw_u),
    }
    for name, encoder in (("encoder", readings.recoil), ("swing", readings.swing)):
        if encoder is not None:
            columns |= {
                f"{name}_counts_per_s": encoder.rate,
                f"{name}_u_counts_per_s": encoder.rate_u,
                f"{name}_residual_counts": encoder.residual,
            }
    if readings.recoil is not None:
        columns |= {"recoil_rad_per_s": shots.recoil_rate}
    if readings.swing is not None:
        columns |= {"bat_speed_mph": shots.bat_speed / MPH}
    return pd.DataFrame(
        columns
        | _camera_columns(certification.camera)
        | {
            "collision_efficiency": shots.collision_efficiency,
            "rebound_efficiency": shots.rebound_efficiency,
            "recoil_factor": shots.recoil_factor,
            "restitution": shots.restitution,
            "ball_restitution": shots.ball_restitution,
            "bat_performance_factor": shots.bat_performance_factor,
            f"metric_{certification.procedure.metric}": certification.shot_metric,
            "weight": certification.outcome.weights,
            "valid": judgement.valid,
            "reason": list(judgement.reasons),
        }
    )


def budget_table(budget: Budget) -> pd.DataFrame:
    """Return the uncertainty budget as a table, largest component first."""
    import pandas as pd

    return pd.DataFrame([asdict(line) for line in budget_lines(budget)])


def _gate_columns(seen: FlightReadings) -> dict[str, Any]:
    """Return the times that gates or boards read, as columns of the readings."""
    if not isinstance(seen, GateReadings):
        return {}
    times = seen.passages.times
    return {
        "gate_time_in_us": (times[:, INBOUND, -1] - times[:, INBOUND, 0]) * 1e6,
        "gate_time_out_us": (times[:, OUTBOUND, 0] - times[:, OUTBOUND, -1]) * 1e6,
    }


def _speed_u_columns(raw_u: RawFlightsU) -> dict[str, Any]:
    """Return the standard uncertainties of the speeds by the readings alone, if they show them."""
    named = {"speed_u_mph": raw_u.speed_in, "rebound_u_mph": raw_u.speed_out}
    return {name: u / MPH for name, u in named.items() if np.isfinite(u).any()}


def _camera_columns(camera: CameraComparison | None) -> dict[str, Any]:
    """Return the camera results of every shot, as columns of the readings."""
    if camera is None:
        return {}
    filmed, u = camera.filmed, camera.u
    return {
        "video_speed_mph": filmed.flights.speed_in / MPH,
        "video_speed_u_mph": u["speed_in"] / MPH,
        "video_rebound_mph": filmed.flights.speed_out / MPH,
        "video_rebound_u_mph": u["speed_out"] / MPH,
        "video_place_in": filmed.place / INCH,
        "video_place_u_in": u["place"] / INCH,
        "video_angle_deg": np.asarray(filmed.angle_in) / DEGREE,
        "video_angle_u_deg": u["angle"] / DEGREE,
        "video_efficiency": camera.shots.rebound_efficiency,
        "video_efficiency_u": u["efficiency"],
    }
