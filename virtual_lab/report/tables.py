"""Tables of a certification: a row a shot, a row a component of the uncertainty."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.certification import Certification
from virtual_lab.uncertainty.budget import Budget
from virtual_lab.units import INCH, MPH, OUNCE

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["budget_rows", "budget_table", "shot_table"]


def shot_table(certification: Certification) -> pd.DataFrame:
    """Return a row a shot: what each instrument gave and what was reduced from it."""
    import pandas as pd

    shots, readings = certification.shots, certification.readings
    judgement = certification.judgement
    return pd.DataFrame(
        {
            "shot": np.arange(len(shots.speed)),
            "ball": readings.ball,
            "ball_mass_oz": shots.ball_mass / OUNCE,
            "place_in": readings.place / INCH,
            "gate_time_in_us": readings.duration_in * 1e6,
            "gate_time_out_us": readings.duration_out * 1e6,
            "encoder_counts_per_s": readings.recoil.rate,
            "encoder_u_counts_per_s": readings.recoil.rate_u,
            "encoder_residual_counts": readings.recoil.residual,
            "speed_mph": shots.speed / MPH,
            "recoil_rad_per_s": shots.recoil_rate,
            "collision_efficiency": shots.collision_efficiency,
            "rebound_efficiency": shots.rebound_efficiency,
            "recoil_factor": shots.recoil_factor,
            "restitution": shots.restitution,
            "ball_restitution": shots.ball_restitution,
            "bat_performance_factor": shots.bat_performance_factor,
            "valid": judgement.valid,
            "reason": list(judgement.reasons),
        }
    )


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
