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
from scipy.interpolate import CubicSpline

from virtual_lab.lab import Laboratory
from virtual_lab.lab.measurand import true_curve
from virtual_lab.lab.true_metric import Visits, results_of_curves
from virtual_lab.measurement.procedure import (
    Curve,
    Procedure,
    Sought,
    metric_of,
    next_places,
    outcome_of,
    shortfalls,
    sought_of,
    to_set,
)
from virtual_lab.measurement.reduction.kinematics import restitution_from_efficiency
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.streams import Draws
from virtual_lab.units import Array


class HitScatter(NamedTuple):
    """Scatter of hits about what was asked for: standard deviations from shot to shot."""

    along: float  # of the place [m]
    scatter: float  # of the metric, the place's part left out


@dataclass(frozen=True, slots=True, kw_only=True)
class Rehearsal:
    """Simulation of the procedure on an exact curve."""

    procedure: Procedure
    percussion: float  # [m]
    bat: BatProperties
    turn_rate: float  # of the bat [rad/s]
    curve: Callable[[Array], Array]  # e_A, r and e0 at places, (3, n)

    @classmethod
    def of(cls, laboratory: Laboratory, percussion: float) -> Self:
        """Return the rehearsal of a laboratory's test on the curve of its true bat.

        `percussion` is the place of its result [m].
        """
        procedure = laboratory.rules.spec
        scan = procedure.scan
        low, high = (scan.low, scan.high) if scan else (percussion, percussion)
        step, beyond = 4e-3, 0.025  # m: of the curve, and how far it goes on beyond any aim
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

    def error(self, straying: HitScatter, draws: Draws, number: int) -> float:
        """Return the error of the result of rehearsal `number`."""
        rules = self.procedure
        beside, noise = draws.normal("rehearsal", (2, rules.attempts), np.array([number]))[0]
        place, metric, valid = np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool)
        sought = self._sought(place, metric)
        while (asked := next_places(rules, self.percussion, place, valid, sought.value)).size:
            more = slice(place.size, place.size + asked.size)
            places = to_set(asked, exact=False)
            seen = self.metric(places, straying.along * beside[more])
            place = np.append(place, places)
            metric = np.append(metric, seen + straying.scatter * noise[more])
            sought = self._sought(place, metric)
            valid = np.ones(place.size, dtype=bool)
        found = float(metric @ outcome_of(rules, place, valid, metric, sought).weights)
        alone = np.zeros(place.size, dtype=np.intp)
        found += float(shortfalls(rules, 1, alone, place, valid, metric).mean[0])
        exact = self.metric(place)
        looked = self._sought(place, exact).value
        true = results_of_curves(rules, 1, Visits(alone, place, valid), looked, exact)
        return found - float(true[0])

    def _sought(self, place: Array, metric: Array) -> Sought:
        return sought_of(self.procedure, metric, place, self.bat)

    def bias(self, straying: HitScatter, draws: Draws, times: int) -> tuple[float, float]:
        """Return the mean error over a number of rehearsals, and its standard error."""
        errors = np.array([self.error(straying, draws, number) for number in range(times)])
        errors = errors[np.isfinite(errors)]
        return float(errors.mean()), float(errors.std(ddof=1)) / sqrt(errors.size)
