"""Results of the hits with the recoil factor of the other support, free or pivoted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.procedure import HitWeights, Procedure
from virtual_lab.measurement.reduction.kinematics import (
    bat_performance_factor,
    inverse_effective_mass,
    recoil_factor,
    restitution_from_efficiency,
)
from virtual_lab.measurement.reduction.shot_algebra import BatProperties, ShotResults


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSupport:
    """Mean r, e and BPF of the valid hits for the support that the procedure does not use."""

    which: str
    recoil_factor: float
    restitution: float
    bat_performance_factor: float


def other_support(
    procedure: Procedure, shots: ShotResults, bat: BatProperties, hit_weights: HitWeights
) -> OtherSupport:
    """Return the mean r, e and BPF of one bat for the other support, free or pivoted.

    If the procedure computes with a pivoted bat, the results are for a free bat, and vice versa.
    `OtherSupport.which` names the support. r is the recoil factor, e the bat-ball restitution, and
    BPF the bat performance factor; each is dimensionless. They are computed from the measured
    collision efficiency e_A. Each result is the weighted mean over the hits of `hit_weights`, and 0
    if there are none.
    """
    which = "free" if procedure.recoil == "pivoted" else "pivoted"
    # mass of the lot's mean ball, computed back from the recoil factor of the rules' support
    ball = shots.ball_mass * shots.lot_recoil_factor / shots.recoil_factor
    axis, position = bat.length - procedure.pivot_from_knob, shots.position
    inverse_M_eff = inverse_effective_mass(
        which == "free", bat.mass, bat.inertia_cm, bat.z_cm, axis, position
    )
    recoil = np.asarray(recoil_factor(ball, inverse_M_eff))
    restitution = np.asarray(restitution_from_efficiency(shots.lot_collision_efficiency, recoil))
    factor = np.asarray(bat_performance_factor(restitution, shots.lot_ball_restitution))
    mask = hit_weights.used
    weights = hit_weights.weights[mask]
    return OtherSupport(
        which=which,
        recoil_factor=float(recoil[mask] @ weights),
        restitution=float(restitution[mask] @ weights),
        bat_performance_factor=float(factor[mask] @ weights),
    )
