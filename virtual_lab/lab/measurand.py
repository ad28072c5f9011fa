"""The measurand: the procedure's result on the exact curve of the tested bat.

There are two: (i) the result from the places visited, which a laboratory without errors finds
exactly; (ii) for a scan, the value at the maximum of the continuous curve and, if the procedure
asks for it, the width of the curve near its maximum.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from virtual_lab.lab.true_metric import TrueCurve, scan_result
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.session_reduction import SessionReduction
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import ImpactStation, ShotPlan, Specimen
from virtual_lab.units import Array

CONTINUOUS = "metric_of_continuous_curve"
WIDTH_KEY = "width_m"


def measurand(
    station: ImpactStation, specimen: Specimen, reduced: SessionReduction, control: float
) -> dict[str, float]:
    """Return the true metric as ``metric``, and quantities by their names in a certificate.

    The other quantities are those at the place on the certificate, so they have the weights of its
    hits. `control` is the error-free argument of `TrueCurve.metric`. {} if the test gave no
    result.
    """
    procedure, outcome = reduced.procedure, reduced.outcome
    if not np.isfinite(outcome.weights).all():
        return {}
    place = reduced.readings.place
    each, back = np.unique(place, return_inverse=True)
    curve = true_curve(station, specimen, procedure, each)
    found = {
        name: float(values[back] @ outcome.weights) for name, values in curve.quantities.items()
    }
    found["metric"] = scan_result(
        procedure,
        place,
        reduced.judgement.valid,
        curve.sought(control)[back],
        curve.metric(control)[back],
    )
    if procedure.scan is not None:
        along = np.linspace(procedure.scan.low, procedure.scan.high, 41)
        found |= _of_continuous(true_curve(station, specimen, procedure, along), control)
    return found


def _of_continuous(curve: TrueCurve, control: float) -> dict[str, float]:
    """Return the metric at the maximum of the curve, and the width the rules ask for."""
    scan = curve.procedure.scan
    assert scan is not None
    sought = CubicSpline(curve.place, curve.sought(control))
    metric = CubicSpline(curve.place, curve.metric(control))
    turns = sought.derivative().roots(discontinuity=False, extrapolate=False)
    candidates = np.concatenate([curve.place[[0, -1]], turns])
    best = candidates[np.argmax(sought(candidates))]
    found = {CONTINUOUS: float(metric(best))}
    if scan.width_drop is not None:
        level = float(metric(best)) - scan.width_drop
        crossings = metric.solve(level, discontinuity=False, extrapolate=False)
        low = crossings[crossings < best].max(initial=curve.place[0])
        high = crossings[crossings > best].min(initial=curve.place[-1])
        found[WIDTH_KEY] = float(high - low)
    return found


def true_curve(
    station: ImpactStation, specimen: Specimen, procedure: Procedure, places: Array
) -> TrueCurve:
    """Return the true curve at `places` [m] at the procedure's nominal speeds."""
    beam = beam_of(specimen.bat.body)
    plan = ShotPlan(
        slot=np.arange(places.size),
        ball=np.zeros(places.shape, dtype=int),
        speed=np.full(places.shape, procedure.ball_speed),
        place=places,
        turn_rate=float(procedure.turn_rate(beam.length)),
    )
    true = station.outcome(plan, specimen)
    rigid = true.free if procedure.recoil == "free" else true.pivoted
    return TrueCurve(
        procedure=procedure,
        beam=beam,
        place=places,
        collision_efficiency=true.collision_efficiency,
        restitution=rigid.restitution,
        recoil_factor=rigid.recoil_factor,
        ball_restitution=true.ball_restitution,
    )
