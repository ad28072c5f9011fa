"""What a test was to find: the procedure's own result on the exact curve of this very bat.

(i) the rule book's functional on the places visited, which an error-free laboratory returns
exactly; (ii) of a scan, the greatest value of the continuous curve, and where the rules ask for
it how far along the barrel the curve stays near that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure import Curve, Procedure, exact_result, metric_of
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.measurement.session_reduction import Reduced
from virtual_lab.relations.kinematics import restitution_from_efficiency
from virtual_lab.relations.peaks import peak, width_below
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import ImpactStation, Order, Specimen

__all__ = ["CONTINUOUS", "WIDTH", "measurand", "results_along"]

Array = NDArray[np.float64]
CONTINUOUS = "metric_of_continuous_curve"
WIDTH = "width_m"
CURVE_POINTS = 41


def measurand(
    station: ImpactStation, specimen: Specimen, reduced: Reduced, control: float
) -> dict[str, float]:
    """Return the true metric as ``metric``, and quantities by their names in a certificate.

    The quantities beside the metric are those at the place the certificate names, so they are
    weighed as its hits were. `control` is that of `metric_of`, without error. {} where the test
    gave no result.
    """
    procedure, outcome = reduced.procedure.spec, reduced.outcome
    if not np.isfinite(outcome.weights).all():
        return {}
    place = reduced.readings.place
    each, back = np.unique(place, return_inverse=True)
    curve, bat = results_along(station, specimen, procedure, each)
    metric_along = metric_of(procedure, control=control)
    metric = metric_along(curve, bat)
    weighed = {
        name: float(values[back] @ outcome.weights) for name, values in curve.quantities.items()
    }
    exact = exact_result(procedure, place, reduced.judgement.valid, metric[back])
    found = weighed | {"metric": exact}
    if procedure.scan is not None:
        along = np.linspace(procedure.scan.low, procedure.scan.high, CURVE_POINTS)
        fine, bat = results_along(station, specimen, procedure, along)
        exact_curve = metric_along(fine, bat)
        found[CONTINUOUS] = peak(along, exact_curve).value
        if procedure.scan.width_drop is not None:
            found[WIDTH] = width_below(along, exact_curve, procedure.scan.width_drop).width
    return found


def results_along(
    station: ImpactStation, specimen: Specimen, procedure: Procedure, places: Array
) -> tuple[Curve, BatProperties]:
    """Return what an error-free test finds at `places` [m], and the bat's true properties."""
    beam = beam_of(specimen.bat.body)
    order = Order(
        slot=np.arange(places.size),
        ball=np.zeros(places.shape, dtype=int),
        speed=np.full(places.shape, procedure.ball_speed),
        place=places,
        turn_rate=float(procedure.turn_rate(beam.length)),
    )
    true = station.outcome(order, specimen)
    recoil = true.recoil_free if procedure.recoil == "free" else true.recoil_pivoted
    bat = BatProperties(
        mass=np.array(beam.mass),
        length=np.array(beam.length),
        z_cm=np.array(beam.z_cm),
        inertia_cm=np.array(beam.inertia_cm),
        barrel_radius=np.array(np.nan),
    )
    curve = Curve(
        place=places,
        collision_efficiency=true.collision_efficiency,
        recoil_factor=recoil,
        restitution=np.asarray(restitution_from_efficiency(true.collision_efficiency, recoil)),
        ball_restitution=true.ball_restitution,
    )
    return curve, bat
