"""The measurand: the procedure's result on the exact curve of the tested bat.

There are two: (i) the result from the places visited, which a laboratory without errors finds
exactly; (ii) for a scan, the value at the maximum of the continuous curve and, if the procedure
asks for it, the width of the curve near its maximum.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from virtual_lab.lab.true_metric import TrueCurve, Visits, results_of_curves
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.rules import Scan
from virtual_lab.measurement.session_reduction import BlockReduction
from virtual_lab.simulation.rig import ImpactStation, ShotPlan, Specimen
from virtual_lab.streams import Owner
from virtual_lab.units import Array

CONTINUOUS = "metric_of_continuous_curve"
WIDTH_KEY = "width_m"
POINTS = 41  # of the continuous curve


def measurands(
    station: ImpactStation,
    specimen: Specimen,
    reduced: BlockReduction,
    weights: Array,
    control: float = 1.0,
) -> dict[str, Array]:
    """Return the true metric as ``metric``, and quantities by their names, (laboratory,).

    The other quantities are those at the place on the certificate, so they have the `weights` of
    its hits, (shot,). `control` is the error-free argument of `TrueCurve.metric`. NaN where a test
    gave no result.
    """
    procedure, owner = reduced.procedure, reduced.owner
    laboratories = reduced.preparation.laboratories
    one_lot = specimen.balls.mass.ndim == 1

    def curve_at(place: Array, whose: NDArray[np.intp]) -> TrueCurve:
        return true_curve(station, specimen, procedure, place, ... if one_lot else whose)

    at, back = np.unique(np.stack([owner, reduced.place]), axis=1, return_inverse=True)
    curve = curve_at(at[1], at[0].astype(np.intp))
    weighed = np.where(np.isfinite(weights), weights, 0.0)
    some = np.bincount(owner, weighed != 0, laboratories) > 0
    found: dict[str, Array] = {
        name: np.asarray(np.bincount(owner, values[back] * weighed, laboratories), dtype=float)
        for name, values in curve.quantities.items()
    }
    visited = Visits(owner, reduced.place, reduced.valid)
    true = curve.sought(control)[back], curve.metric(control)[back]
    found["metric"] = results_of_curves(procedure, laboratories, visited, *true)
    if procedure.scan is not None:
        along = np.linspace(procedure.scan.low, procedure.scan.high, POINTS)
        smooth = curve_at(np.tile(along, laboratories), np.arange(laboratories).repeat(POINTS))
        shape = laboratories, POINTS
        found |= _of_continuous(
            procedure.scan,
            along,
            smooth.sought(control).reshape(shape),
            smooth.metric(control).reshape(shape),
        )
    return {name: np.where(some, values, np.nan) for name, values in found.items()}


def _of_continuous(
    scan: Scan, place: Array, sought_at: Array, metric_at: Array
) -> dict[str, Array]:
    """Return the metric at the maximum of each curve, and the width the rules ask for, (curve,).

    The curves are known at `place`, (curve, place).
    """
    sought = CubicSpline(place, sought_at.T)
    metric = CubicSpline(place, metric_at.T)
    turns = sought.derivative().roots(discontinuity=False, extrapolate=False)
    ends, best = place[[0, -1]], np.empty(len(sought_at))
    for one, turn in enumerate(turns):
        candidates = np.concatenate([ends, turn])
        best[one] = candidates[np.argmax(_at(sought, candidates, one))]
    top = _at(metric, best, np.arange(best.size))
    found = {CONTINUOUS: top}
    if scan.width_drop is not None:
        lowered = metric.c.copy()
        lowered[-1] -= top - scan.width_drop
        level = PPoly(lowered, metric.x).roots(discontinuity=False, extrapolate=False)
        width = np.empty(best.size)
        for one, crossings in enumerate(level):
            low = crossings[crossings < best[one]].max(initial=ends[0])
            width[one] = crossings[crossings > best[one]].min(initial=ends[1]) - low
        found[WIDTH_KEY] = width
    return found


def _at(curves: CubicSpline, place: Array, curve: Any) -> Array:
    """Return the values of some of the curves at places (n,), by Horner's rule."""
    piece = np.clip(np.searchsorted(curves.x, place, side="right") - 1, 0, len(curves.x) - 2)
    off, total = place - curves.x[piece], np.zeros(place.shape)
    for power in curves.c:
        total = total * off + power[piece, curve]
    return total


def true_curve(
    station: ImpactStation,
    specimen: Specimen,
    procedure: Procedure,
    places: Array,
    owner: Owner = ...,
) -> TrueCurve:
    """Return the true curve at `places` [m] at the procedure's nominal speeds.

    `owner` is the laboratory whose balls strike at each place of a block.
    """
    bat = specimen.bat.of_shots(owner).rigid
    plan = ShotPlan(
        slot=np.arange(places.size),
        ball=np.zeros(places.shape, dtype=int),
        speed=np.full(places.shape, procedure.ball_speed),
        place=places,
        turn_rate=float(procedure.turn_rate(bat.length)),
        owner=owner,
    )
    true = station.outcome(plan, specimen)
    rigid = true.free if procedure.recoil == "free" else true.pivoted
    return TrueCurve(
        procedure=procedure,
        bat=bat,
        place=places,
        collision_efficiency=true.collision_efficiency,
        restitution=rigid.restitution,
        recoil_factor=rigid.recoil_factor,
        ball_restitution=true.ball_restitution,
    )
