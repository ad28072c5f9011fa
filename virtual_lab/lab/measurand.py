"""The measurand: the procedure's result on the exact curve of the tested bat.

There are two: (i) the result from the places visited, which a laboratory without errors finds
exactly; (ii) for a scan, the value at the maximum of the continuous curve and, if the procedure
asks for it, the width of the curve near its maximum.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from virtual_lab.lab.true_metric import TrueCurve, scan_result
from virtual_lab.measurement.certification import BlockCertification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.rules import Scan
from virtual_lab.measurement.session_reduction import BlockReduction, SessionReduction
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import ImpactStation, ShotPlan, Specimen
from virtual_lab.streams import Owner
from virtual_lab.units import Array

CONTINUOUS = "metric_of_continuous_curve"
WIDTH_KEY = "width_m"
POINTS = 41  # of the continuous curve


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
        along = np.linspace(procedure.scan.low, procedure.scan.high, POINTS)
        continuous = true_curve(station, specimen, procedure, along)
        sought, metric = continuous.sought(control), continuous.metric(control)
        alone = _of_continuous(procedure.scan, along, sought[None], metric[None])
        found |= {name: float(values[0]) for name, values in alone.items()}
    return found


def measurands(
    station: ImpactStation,
    specimen: Specimen,
    reduced: BlockReduction,
    certified: BlockCertification,
) -> dict[str, Array]:
    """Return the same of a block, as `measurand` of each laboratory, (laboratory,).

    NaN where a test gave no result.
    """
    procedure, weights, owner = reduced.procedure, certified.outcome.weights, reduced.owner
    laboratories = reduced.preparation.laboratories
    some = certified.some
    at, back = np.unique(np.stack([owner, reduced.place]), axis=1, return_inverse=True)
    whose, place = at[0].astype(np.intp), at[1]
    curve = true_curve(station, specimen, procedure, place, whose)
    weighed = np.where(np.isfinite(weights), weights, 0.0)

    def result(values: Array) -> Array:
        total = np.bincount(owner, values[back] * weighed, laboratories)
        return np.where(some, total, np.nan)

    found = {name: result(values) for name, values in curve.quantities.items()}
    metric, sought = curve.metric()[back], curve.sought()[back]
    if procedure.scan is None:
        found["metric"] = np.where(
            some,
            np.bincount(owner, np.where(reduced.valid, metric, 0.0), laboratories)
            / np.maximum(np.bincount(owner, reduced.valid, laboratories), 1),
            np.nan,
        )
        return found
    found["metric"] = np.full(laboratories, np.nan)
    shots = np.split(np.argsort(owner, kind="stable"), np.cumsum(np.bincount(owner)))[:-1]
    for one in np.flatnonzero(some):
        own = shots[one]
        found["metric"][one] = scan_result(
            procedure, reduced.place[own], reduced.valid[own], sought[own], metric[own]
        )
    along = np.linspace(procedure.scan.low, procedure.scan.high, POINTS)
    every = np.arange(laboratories).repeat(POINTS)
    smooth = true_curve(station, specimen, procedure, np.tile(along, laboratories), every)
    looked, read = (each.reshape(-1, POINTS) for each in (smooth.sought(), smooth.metric()))
    for name, values in _of_continuous(procedure.scan, along, looked, read).items():
        found[name] = np.where(some, values, np.nan)
    return found


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
    beam = beam_of(specimen.bat.body)
    plan = ShotPlan(
        slot=np.arange(places.size),
        ball=np.zeros(places.shape, dtype=int),
        speed=np.full(places.shape, procedure.ball_speed),
        place=places,
        turn_rate=float(procedure.turn_rate(beam.length)),
        owner=owner,
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
