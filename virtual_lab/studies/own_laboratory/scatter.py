"""Scatter of the shots of a test, from its reduction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.uncertainty.interlaboratory import grubbs_limit
from virtual_lab.units import Array

OUTLIER = 0.001  # probability that a sound shot is left out of a scatter


def scatter_of_shots(reduced: Reduction) -> Mapping[Stage, Mapping[str, StandardDeviation]]:
    """Return the scatter of the shots at each stage, keyed by name.

    ``speed_scatter`` is that of the ball's speed [m/s], and ``turn_rate_scatter`` that of a swung
    bat's angular rate, relative to its mean.
    """
    balls, shots = reduced.preparation.balls, reduced.shots
    at_wall, nominal = balls.flights.raw.speed_in[0, 0], balls.nominal_speed[0, 0]
    pool = StandardDeviation.of_groups
    wall = pool(at_wall[nominal == each] for each in np.unique(nominal))
    impact = {"speed_scatter": pool([without_outliers(shots.speed)])}
    rates = shots.swing_rate[np.isfinite(shots.swing_rate)]
    if rates.size and rates.mean():
        impact["turn_rate_scatter"] = pool([rates / rates.mean()])
    return {Stage.BENCH: {}, Stage.BALLS: {"speed_scatter": wall}, Stage.IMPACT: impact}


def without_outliers(values: Array) -> Array:
    """Return finite values without outliers by Grubbs's test.

    A fragment before the ball spoils its speed.
    """
    values = values[np.isfinite(values)]
    while values.size > 2:
        deviation = np.abs(values - values.mean())
        if deviation.max() <= grubbs_limit(values.size, OUTLIER) * values.std(ddof=1):
            break
        values = np.delete(values, deviation.argmax())
    return values
