"""Bias of a test from stray aim and scatter, found by rehearsals on the exact curve.

Aim errors move hits away from the intended place, which lowers the result near a maximum. A scan
takes the maximum of noisy values, which raises the result; but it also continues where the first
hits were high and turns away where they were low, which lowers it. No closed form covers all of
this, so the rules are simulated many times on the exact curve, without instruments.
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
    Procedure,
    Sought,
    metric_of,
    next_shots,
    outcomes_of,
    shortfalls,
    sought_of,
    to_set,
)
from virtual_lab.measurement.reduction.kinematics import restitution_from_efficiency
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.streams import Draws
from virtual_lab.units import Array


class HitScatter(NamedTuple):
    """Standard deviations of the hits from shot to shot."""

    along: float  # standard deviation of the impact position [m]
    scatter: float  # standard deviation of the metric at a fixed impact position


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsal:
    """Simulation of the procedure on an exact curve."""

    procedure: Procedure
    percussion: float  # impact position of the result [m]
    bat: BatProperties
    turn_rate: float  # angular rate of the bat [rad/s]
    curve: Callable[[Array], Array]  # function of places [m]: e_A, r and e0, (3, n)

    @classmethod
    def of(cls, laboratory: Laboratory, percussion: float) -> Self:
        """Return the rehearsal of a laboratory's test on the curve of its true bat.

        `percussion` is the place of its result [m].
        """
        procedure = laboratory.rules.spec
        scan = procedure.scan
        low, high = (scan.low, scan.high) if scan else (percussion, percussion)
        step, beyond = 4e-3, 0.025  # step of the curve and its extension beyond any aim [m]
        places = np.arange(low - beyond, high + beyond + step, step)
        curve = true_curve(laboratory.impact, laboratory.specimen, procedure, places)
        known = [curve.collision_efficiency, curve.recoil_factor, curve.ball_restitution]
        spline = CubicSpline(places, known, axis=1)
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

    def straying(self, along: float, scatter: float) -> HitScatter:
        """Return the deviations for a total `scatter` of the metric within a place.

        The part caused by the scatter of the place is removed, on average over the scan's fit.
        """
        scan = self.procedure.scan
        reach = scan.fit_half_width if scan else 0.0
        about = self.percussion + np.linspace(-reach, reach, 9)
        slope = (self.metric(about, along) - self.metric(about, -along)) / 2
        return HitScatter(along, sqrt(max(scatter**2 - float(np.mean(slope**2)), 0.0)))

    def metric(self, place: Array, beside: Array | float = 0.0) -> Array:
        """Return the metric measured from hits at a distance `beside` the intended place."""
        e_a, recoil, e0 = self.curve(place)
        struck = self.curve(place + beside)[0]
        speed, here = self.procedure.ball_speed, self._bat_speed(place)
        there = self._bat_speed(place + beside)
        e_a = (struck * (speed + there) + there - here) / (speed + here)
        curve = Curve(
            place=place,
            collision_efficiency=e_a,
            recoil_factor=recoil,
            restitution=np.asarray(restitution_from_efficiency(e_a, recoil)),
            ball_restitution=e0,
        )
        return metric_of(self.procedure)(curve, self.bat)

    def _bat_speed(self, place: Array) -> Array:
        axis = self.bat.length - self.procedure.pivot_from_knob
        return np.asarray(self.turn_rate * (axis - place))

    def errors(self, straying: HitScatter, draws: Draws, numbers: NDArray[np.intp]) -> Array:
        """Return the errors of the results of rehearsals by their numbers, (rehearsal,).

        The error of a rehearsal without a result is NaN.
        """
        rules, many = self.procedure, numbers.size
        drawn = draws.normal("rehearsal", (2, rules.attempts), numbers)
        owner, place, metric = np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
        percussion, fired = np.full(many, self.percussion), np.zeros(many, dtype=np.intp)
        while True:
            sought, valid = self._sought(place, metric), np.ones(place.size, dtype=bool)
            asked = next_shots(rules, percussion, owner, place, valid, sought.value)
            if not asked.owner.size:
                break
            places = to_set(asked.place, exact=False)
            shot = fired[asked.owner] + shot_numbers(asked.owner)
            beside, noise = drawn[asked.owner, :, shot].T
            seen = self.metric(places, straying.along * beside) + straying.scatter * noise
            fired = fired + np.bincount(asked.owner, minlength=many)
            owner = np.append(owner, asked.owner)
            place, metric = np.append(place, places), np.append(metric, seen)
        weights = outcomes_of(rules, many, owner, place, valid, metric, sought).weights
        lost = shortfalls(rules, many, owner, place, valid, metric).mean
        found = np.bincount(owner, metric * weights, many) + lost
        exact = self.metric(place)
        looked = self._sought(place, exact).value
        return found - results_of_curves(rules, many, Visits(owner, place, valid), looked, exact)

    def _sought(self, place: Array, metric: Array) -> Sought:
        return sought_of(self.procedure, metric, place, self.bat)

    def bias(self, straying: HitScatter, draws: Draws, times: int) -> tuple[float, float]:
        """Return the mean error over a number of rehearsals, and its standard error."""
        few = 4096  # number of rehearsals at a time, which limits the memory
        parts = [np.arange(first, min(first + few, times)) for first in range(0, times, few)]
        errors = np.concatenate([self.errors(straying, draws, part) for part in parts])
        errors = errors[np.isfinite(errors)]
        return float(errors.mean()), float(errors.std(ddof=1)) / sqrt(errors.size)
