"""Bias of a test due to aim errors and scatter, computed by simulation on the exact curve.

Aim errors move hits away from the intended position, which lowers the result near a maximum. A scan
selects the maximum of noisy values, which raises the result. A scan also adds hits at positions
with high first hits, but not at positions with low first hits, which lowers the result. There is no
closed formula for the sum of these effects, so the procedure is simulated many times on the exact
curve, without instruments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from virtual_lab.lab import Laboratory
from virtual_lab.lab.measurand import true_curve
from virtual_lab.lab.plans import shot_numbers
from virtual_lab.lab.true_metric import Visits, results_of_curves
from virtual_lab.measurement.procedure import (
    Curve,
    Objective,
    Procedure,
    hit_weights_of,
    metric_of,
    next_shots,
    objective_of,
    round_to_setting,
    shortfalls,
)
from virtual_lab.measurement.reduction.kinematics import restitution_from_efficiency
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.streams import Draws
from virtual_lab.units import Array


class HitScatter(NamedTuple):
    """Scatter of the hits from shot to shot."""

    along: float  # standard deviation of the impact position [m]
    scatter: float  # standard deviation of the metric at a fixed impact position


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsal:
    """Simulation of the procedure on an exact curve."""

    procedure: Procedure
    percussion: float  # impact position of the result [m]
    bat: BatProperties
    turn_rate: float  # angular rate of the bat [rad/s]
    # function of positions [m], shape (n,): e_A, r and e0, shape (3, n)
    curve: Callable[[Array], Array]

    @classmethod
    def of(cls, laboratory: Laboratory, percussion: float) -> Self:
        """Return the simulation of a test on the exact curve of the true bat of a laboratory.

        `percussion` is the impact position of the result [m].
        """
        procedure = laboratory.rules.spec
        scan = procedure.scan
        low, high = (scan.low, scan.high) if scan else (percussion, percussion)
        step, beyond = 4e-3, 0.025  # step of the curve, and its extension beyond all aims [m]
        places = np.arange(low - beyond, high + beyond + step, step)
        curve = true_curve(laboratory.impact, laboratory.specimen, procedure, places)
        curves = [curve.collision_efficiency, curve.recoil_factor, curve.ball_restitution]
        spline = CubicSpline(places, curves, axis=1)
        beam = curve.bat
        bat = BatProperties(
            mass=np.array(beam.mass),
            length=np.array(beam.length),
            z_cm=np.array(beam.z_cm),
            inertia_cm=np.array(beam.inertia_cm),
            barrel_radius=np.array(np.nan),
        )
        turn_rate = float(procedure.turn_rate(bat.length))
        return cls(
            procedure=procedure,
            percussion=percussion,
            bat=bat,
            turn_rate=turn_rate,
            curve=lambda at: np.asarray(spline(at)),
        )

    def hit_scatter(self, along: float, scatter: float) -> HitScatter:
        """Return the scatter of the hits from two observed standard deviations.

        `along` is the standard deviation of the marks along the bat [m]. `scatter` is the standard
        deviation of the metric at one aim. The part of `scatter` that the scatter of the marks
        causes is subtracted, averaged over the range of the fit.
        """
        scan = self.procedure.scan
        half_width = scan.fit_half_width if scan else 0.0
        about = self.percussion + np.linspace(-half_width, half_width, 9)
        slope = (self.metric(about, along) - self.metric(about, -along)) / 2
        return HitScatter(along, sqrt(max(scatter**2 - float(np.mean(slope**2)), 0.0)))

    def metric(self, place: Array, beside: Array | float = 0.0) -> Array:
        """Return the metric measured from hits at `place` + `beside`, aimed at `place` [m]."""
        e_a, recoil, e0 = self.curve(place)
        struck = self.curve(place + beside)[0]
        speed, set_speed = self.procedure.ball_speed, self._bat_speed(place)
        speed_at_hit = self._bat_speed(place + beside)
        e_a = (struck * (speed + speed_at_hit) + speed_at_hit - set_speed) / (speed + set_speed)
        curve = Curve(
            position=place,
            collision_efficiency=e_a,
            recoil_factor=recoil,
            restitution=np.asarray(restitution_from_efficiency(e_a, recoil)),
            ball_restitution=e0,
        )
        return metric_of(self.procedure)(curve, self.bat)

    def _bat_speed(self, place: Array) -> Array:
        axis = self.bat.length - self.procedure.pivot_from_knob
        return np.asarray(self.turn_rate * (axis - place))

    def errors(self, hit_scatter: HitScatter, draws: Draws, numbers: NDArray[np.intp]) -> Array:
        """Return the errors of the results of simulated tests, shape (test,).

        `numbers` are the numbers of the tests, which select their random numbers. The error of a
        test without a result is NaN.
        """
        rules, many = self.procedure, numbers.size
        random = draws.normal("rehearsal", (2, rules.attempts), numbers)
        owner, place, metric = np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
        percussion, fired = np.full(many, self.percussion), np.zeros(many, dtype=np.intp)
        while True:
            target, valid = self._target_metric(place, metric), np.ones(place.size, dtype=bool)
            shots = next_shots(rules, percussion, owner, place, valid, target.value)
            if not shots.owner.size:
                break
            places = round_to_setting(shots.position, exact=False)
            shot = fired[shots.owner] + shot_numbers(shots.owner)
            beside, noise = random[shots.owner, :, shot].T
            measured = self.metric(places, hit_scatter.along * beside) + hit_scatter.scatter * noise
            fired = fired + np.bincount(shots.owner, minlength=many)
            owner = np.append(owner, shots.owner)
            place, metric = np.append(place, places), np.append(metric, measured)
        weights = hit_weights_of(rules, many, owner, place, valid, metric, target).weights
        shortfall = shortfalls(rules, many, owner, place, valid, metric).mean
        results = np.bincount(owner, metric * weights, many) + shortfall
        exact = self.metric(place)
        exact_target = self._target_metric(place, exact).value
        return results - results_of_curves(
            rules, many, Visits(owner, place, valid), exact_target, exact
        )

    def _target_metric(self, place: Array, metric: Array) -> Objective:
        return objective_of(self.procedure, metric, place, self.bat)

    def bias(self, hit_scatter: HitScatter, draws: Draws, times: int) -> tuple[float, float]:
        """Return the mean error over `times` simulated tests, and its standard error."""
        few = 4096  # number of tests at a time, which limits the memory
        parts = [np.arange(first, min(first + few, times)) for first in range(0, times, few)]
        errors = np.concatenate([self.errors(hit_scatter, draws, part) for part in parts])
        errors = errors[np.isfinite(errors)]
        return float(errors.mean()), float(errors.std(ddof=1)) / sqrt(errors.size)
