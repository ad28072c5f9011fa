"""The measurand: the procedure's result for the exact curve of the tested bat.

There are two measurands. The first is the result from the positions that were hit, which a
laboratory without errors finds exactly. The second is for scans: the value at the maximum of the
continuous curve and, if the procedure requires it, the width of the curve near its maximum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.lab.true_metric import TrueCurve, Visits, results_of_curves
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import AS_FOUND, CONTROL
from virtual_lab.measurement.procedure.rules import Scan
from virtual_lab.measurement.session_reduction import Reduction
from virtual_lab.simulation.physics.cubics import PiecewiseCubic, smooth_cubic
from virtual_lab.simulation.physics.truth import SealedTruth
from virtual_lab.simulation.stations.rig import ErrorFreeTest, ShotPlan, Specimen
from virtual_lab.streams import Owner
from virtual_lab.units import Array

CONTINUOUS = "metric_of_continuous_curve"
STANDARD_BALL = "metric_with_standard_ball"
WIDTH_KEY = "width_m"
TRUE_OF_HIT = ("place", "collision_efficiency", "ball_restitution")  # keys of `SealedTruth.shots`
POINTS = 41  # number of points of the continuous curve


def measurands(
    station: ErrorFreeTest,
    specimen: Specimen,
    reduced: Reduction,
    weights: Array,
    control_ratio: float = 1.0,
) -> dict[str, Array]:
    """Return the true results of each laboratory's test, keyed by name, (laboratory,) [SI].

    * ``metric`` is the result that a laboratory without errors would find from the same impact
      positions.
    * The other quantities of a certificate, such as ``restitution``, are weighted means of the true
      values at the impact positions.
    * ``metric_of_continuous_curve`` is the metric at the maximum of the continuous curve. It exists
      only for a scan.
    * ``width_m`` is the width of the curve [m] at the drop `width_drop` below the maximum. It
      exists only if the scan states `width_drop`.
    * ``metric_as_found`` is the metric before the conversion to a standard ball. It exists only if
      the procedure requires this conversion.
    * ``metric_with_standard_ball`` is the metric of the bat struck by the standard ball, which has
      the same e0 at every speed. It comes from the dynamics, without the formula of the conversion.
      It exists only if the procedure converts to a standard ball.

    All values are NaN in a laboratory without a result.

    Parameters
    ----------
    station
        Rig that returns the error-free result of each shot.
    specimen
        True bat and true balls of each laboratory.
    reduced
        Reduced shots of the test: impact positions, and which hits are valid. The shots of all
        laboratories are on one axis.
    weights
        Weights of the hits in the result on the certificate, (shot,), on the same axis. NaN counts
        as 0.
    control_ratio
        True e of the control bat divided by its known e.
    """
    procedure, owner = reduced.procedure, reduced.owner
    laboratories = reduced.preparation.laboratories
    one_lot = specimen.balls.mass.ndim == 1

    def curve_at(position: Array, whose: NDArray[np.intp], struck: Specimen) -> TrueCurve:
        return true_curve(station, struck, procedure, position, ... if one_lot else whose)

    at, inverse = np.unique(owner + 1j * reduced.position, return_inverse=True)
    curve = curve_at(at.imag, at.real.astype(np.intp), specimen)
    finite_weights = np.where(np.isfinite(weights), weights, 0.0)
    has_result = np.bincount(owner, finite_weights != 0, laboratories) > 0
    true_values: dict[str, Array] = {
        name: np.asarray(
            np.bincount(owner, values[inverse] * finite_weights, laboratories), dtype=float
        )
        for name, values in curve.quantities.items()
    }
    visited = Visits(owner, reduced.position, reduced.valid)

    def result(objective: Array, metric: Array) -> Array:
        by_shot = objective[inverse], metric[inverse]
        return results_of_curves(procedure, laboratories, visited, *by_shot)

    objective = curve.objective(control_ratio)
    true_values["metric"] = result(objective, curve.metric(control_ratio))
    if procedure.normalized:  # at the position of the result
        plain = replace(curve, procedure=procedure.as_found).metric()
        true_values[AS_FOUND] = result(objective, plain)
    if (standard := procedure.standard_restitution) is not None:
        balls = specimen.balls.with_restitution(standard)
        struck = curve_at(at.imag, at.real.astype(np.intp), replace(specimen, balls=balls))
        struck = replace(struck, procedure=procedure.as_found)
        true_values[STANDARD_BALL] = result(struck.objective(), struck.metric())
    if procedure.scan is not None:
        along = np.linspace(procedure.scan.low, procedure.scan.high, POINTS)
        whose = np.arange(laboratories).repeat(POINTS)
        smooth = curve_at(np.tile(along, laboratories), whose, specimen)
        shape = laboratories, POINTS
        true_values |= _continuous_results(
            procedure.scan,
            along,
            smooth.objective(control_ratio).reshape(shape),
            smooth.metric(control_ratio).reshape(shape),
        )
    return {name: np.where(has_result, values, np.nan) for name, values in true_values.items()}


def _continuous_results(
    scan: Scan, position: Array, objective_at: Array, metric_at: Array
) -> dict[str, Array]:
    """Return the metric at the maximum of each curve, and the width that the rules require.

    The results are (curve,). `objective_at` and `metric_at`, (curve, position), are the values of
    the curves at the positions `position`, (position,) [m].
    """
    objective, metric = (smooth_cubic(position, values.T) for values in (objective_at, metric_at))
    best = _maxima(objective)
    top = _values_at(metric, best)
    results = {CONTINUOUS: top}
    if scan.width_drop is not None:
        low, high = (
            _locate_level(metric, metric_at.T, top - scan.width_drop, best, w) for w in (-1, 1)
        )
        results[WIDTH_KEY] = high - low
    return results


def _maxima(curves: PiecewiseCubic) -> Array:
    """Return the position of the maximum of each curve: an end, or a zero of the slope."""
    cubic, square, flat, value = curves.coefficients  # (piece, curve)
    start, size = curves.knots[:-1, None], np.diff(curves.knots)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -(square + np.copysign(np.sqrt(square**2 - 3 * cubic * flat), square))
        turns = np.stack([root / (3 * cubic), flat / root])
    turns = np.where((turns > 0) & (turns < size), turns, 0.0)  # False for NaN
    values = ((cubic * turns + square) * turns + flat) * turns + value
    ends = np.full((1, curves.coefficients.shape[2]), curves.knots[-1])
    positions = np.concatenate([(start + turns).reshape(-1, ends.size), ends])
    heights = np.concatenate([values.reshape(-1, ends.size), _values_at(curves, ends[0])[None]])
    return np.asarray(np.take_along_axis(positions, heights.argmax(axis=0)[None], axis=0)[0])


def _locate_level(
    curves: PiecewiseCubic, at: Array, level: Array, best: Array, direction: int
) -> Array:
    """Return the position at which each curve first falls to `level` in `direction` (±1).

    The search starts at the maximum `best`. If the curve does not fall to the level, the result is
    the end. `at` are the values at the knots, (knot, curve).
    """
    knots = curves.knots[:, None]
    beyond = (at < level) & ((knots - best) * direction > 0)
    falls = beyond.any(axis=0)
    low = beyond.argmax(axis=0) if direction > 0 else len(at) - 1 - beyond[::-1].argmax(axis=0)
    outer = np.where(falls, curves.knots[low], curves.knots[-1 if direction > 0 else 0])
    before = curves.knots[np.clip(low - direction, 0, len(at) - 1)]
    inner = np.where(direction * (before - best) > 0, before, best)
    inner = np.where(falls, inner, outer)
    for _ in range(52):  # bisections down to rounding
        middle = (inner + outer) / 2
        above = _values_at(curves, middle) >= level
        inner, outer = np.where(above, middle, inner), np.where(above, outer, middle)
    return np.asarray(outer)


def _values_at(curves: PiecewiseCubic, position: Array) -> Array:
    """Return the value of each curve at one position per curve, (curve,), by Horner's rule."""
    piece = np.clip(
        np.searchsorted(curves.knots, position, side="right") - 1, 0, len(curves.knots) - 2
    )
    step, curve = position - curves.knots[piece], np.arange(position.size)
    total = np.zeros(position.shape)
    for power in curves.coefficients:
        total = total * step + power[piece, curve]
    return total


def true_curve(
    station: ErrorFreeTest,
    specimen: Specimen,
    procedure: Procedure,
    positions: Array,
    owner: Owner = ...,
) -> TrueCurve:
    """Return the true collision curve of a bat at positions along it, arrays (position,).

    The curve holds the collision efficiency e_A, the bat-ball restitution e, the recoil factor r
    and the ball-wall restitution e0. The speeds are the nominal speeds of the procedure.

    Parameters
    ----------
    positions
        Distances from the barrel tip [m].
    owner
        For a block of laboratories, the index of the laboratory of each position, (position,). The
        bat and the balls of this laboratory are used. For a single laboratory, Python's `Ellipsis`,
        the default.
    """
    bat = specimen.bat.of_shots(owner).rigid
    plan = ShotPlan(
        slot=np.arange(positions.size),
        ball=np.zeros(positions.shape, dtype=int),
        speed=np.full(positions.shape, procedure.ball_speed),
        place=positions,
        turn_rate=float(procedure.turn_rate(bat.length)),
        owner=owner,
    )
    true = station.outcome(plan, specimen)
    rigid = true.free if procedure.recoil == "free" else true.pivoted
    return TrueCurve(
        procedure=procedure,
        bat=bat,
        position=positions,
        collision_efficiency=true.collision_efficiency,
        restitution=rigid.restitution,
        recoil_factor=rigid.recoil_factor,
        ball_restitution=true.ball_restitution,
    )


def true_metrics_of_hits(truth: SealedTruth, procedure: Procedure, balls: Sequence[int]) -> Array:
    """Return the true metric of each shot, for its ball and true impact position, (shot,) [SI].

    Parameters
    ----------
    truth
        True values of a test, whose shots have those of `TRUE_OF_HIT`.
    procedure
        Procedure, which states the metric and the support of the bat.
    balls
        Number of the ball of each shot, (shot,).
    """
    bat, (place, e_A, e0) = truth.bat.rigid, (truth.shots[name] for name in TRUE_OF_HIT)
    axis = bat.length - procedure.pivot_from_knob
    yielding = (axis - place) ** 2 / bat.inertia(axis)  # 1 / effective mass
    if procedure.recoil == "free":
        yielding = 1 / bat.mass + (place - bat.z_cm) ** 2 / bat.inertia_cm
    r = yielding * truth.balls.mass[balls]
    curve = TrueCurve(
        procedure=procedure,
        bat=bat,
        position=place,
        collision_efficiency=e_A,
        restitution=e_A * (1 + r) + r,
        recoil_factor=r,
        ball_restitution=e0,
    )
    return curve.metric(truth.constants.get(CONTROL, 1.0))
