"""Tables of a certification: a row a shot, a row a component of the uncertainty."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.certificate.camera import witness_columns
from virtual_lab.measurement.certification import Certification
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import INCH, MPH, OUNCE

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["budget_rows", "budget_table", "place_rows", "shot_table"]


def shot_table(certification: Certification) -> pd.DataFrame:
    """Return a row a shot: what each instrument gave and what was reduced from it."""
    import pandas as pd

    shots, readings = certification.shots, certification.readings
    judgement = certification.judgement
    columns = {
        "shot": np.arange(len(shots.speed)),
        "ball": readings.ball,
        "ball_mass_oz": shots.ball_mass / OUNCE,
        "place_in": readings.place / INCH,
        "gate_time_in_us": readings.passages.duration_in * 1e6,
        "gate_time_out_us": readings.passages.duration_out * 1e6,
        "speed_mph": shots.speed / MPH,
        "rebound_mph": shots.rebound_speed / MPH,
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
        | witness_columns(certification.second_witness)
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


def place_rows(certification: Certification) -> list[dict[str, Any]]:
    """Return a row a place of a scan: hits, their mean metric and its scatter, as measured."""
    place, valid = certification.readings.place, certification.judgement.valid
    rows = []
    for at in np.unique(place[valid]):
        hits = certification.shot_metric[valid & (place == at)]
        rows.append(
            {
                "place_in": float(at / INCH),
                "hits": int(hits.size),
                "mean": float(hits.mean()),
                "s": float(hits.std(ddof=1)) if hits.size > 1 else None,
            }
        )
    return rows


def budget_rows(budget: Budget) -> list[dict[str, Any]]:
    """Return the components of an uncertainty, largest first, shares of the variance in %."""
    variance = sum(part.contribution**2 for part in budget.components)
    return [
        {
            "component": part.name,
            "value": part.value,
            "u": part.u,
            "type": part.evaluation,
            "degrees_of_freedom": part.dof if isfinite(part.dof) else None,
            "sensitivity": part.sensitivity,
            "contribution": part.contribution,
            "share_percent": 100 * part.contribution**2 / variance if variance else 0.0,
        }
        for part in budget.components
    ]


def budget_table(budget: Budget) -> pd.DataFrame:
    """Return the uncertainty budget as a table, largest component first."""
    import pandas as pd

    return pd.DataFrame(budget_rows(budget))
