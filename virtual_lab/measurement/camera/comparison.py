"""Comparison of camera and gates for the same hits: e_A, e and BPF by both, and combined.

Both methods share bat, balls and hits, so their results are correlated. The effect of each constant
on both results is known, and they are combined so that the uncertainty is smallest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.camera.filmed import (
    CameraResults,
    Sightings,
    frames_u,
    reduce_film,
)
from virtual_lab.measurement.procedure import HitWeights
from virtual_lab.measurement.procedure.model import MeasurementModel
from virtual_lab.measurement.reduction.flights import FlightModel
from virtual_lab.measurement.reduction.gates import GateReadings, heights_moved
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.shot_algebra import (
    SetResults,
    ball_masses,
    bat_properties,
    drag_of,
    of_ball,
)
from virtual_lab.measurement.session_reduction import Reduction, best_values, name_missing_constants
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.records.block import SessionBlock
from virtual_lab.uncertainty.budget import Budget, Variants, means_of_hits
from virtual_lab.uncertainty.scatter import Scatter
from virtual_lab.units import Array

COMPARED: Mapping[str, str] = {  # name in a certificate: field of the shots that is averaged
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "bat_performance_factor": "bat_performance_factor",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedQuantity:
    """One quantity from the gates, from video, and combined."""

    gates: Budget
    video: Budget
    joined: Budget
    difference: Budget  # video minus gates
    share: float  # weight of the video in the combined result

    @property
    def agree(self) -> bool:
        """Whether the 95 % interval of the difference contains 0."""
        low, high = self.difference.interval_95
        return low <= 0 <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraComparison:
    """Results of the camera in a test."""

    # results by the keys of COMPARED; {} if no hit of the result was measured by both
    quantities: Mapping[str, ComparedQuantity]
    hits: int  # number of hits of the result that both gates and camera measured
    missed: int  # number of hits of the result that were not measured by both
    filmed: CameraResults
    shots: SetResults
    # standard uncertainty of each shot's speed_in, speed_out, efficiency, place and angle
    u: Mapping[str, Array]


@name_missing_constants()
def compare_camera(
    block: SessionBlock, reduced: Reduction, readings: ImpactReadings, outcome: HitWeights
) -> CameraComparison | None:
    """Return e_A, e and BPF from camera and gates for the same hits of one laboratory.

    e_A is the collision efficiency, e the bat-ball restitution, and BPF the bat performance factor.
    For each quantity, the result also holds the weighted mean of camera and gates, and the
    difference camera minus gates. It also holds the camera's readings of each shot. The result is
    None if there is no camera record, or if the balls were not timed by gates or light boards.

    Raises
    ------
    InputError
        The camera's record or its calibration cannot be used.
    """
    record, gates = block.impact.get("camera"), readings.flights
    # The gates measure the height of the ball, which determines its distance from the camera.
    if not isinstance(record, ClipRecord | TrackRecord) or not isinstance(gates, GateReadings):
        return None
    from virtual_lab.measurement.camera.windows import sight  # loads the ball locator

    variants, model = Variants.of(reduced.constants), reduced.single_model(readings)
    best = {name: values[0, 0, 0] for name, values in best_values(reduced.constants).items()}
    columns = {name: values[0] for name, values in variants.columns.items()}
    sightings = sight(record, best)
    by_gates, by_video, camera = _by_both(model, sightings, best, gates.correct)
    moved = _by_both(model, sightings, columns, gates.correct)
    risen = _by_both(model, sightings, best, heights_moved(gates))
    both = np.isfinite(by_video.rebound_efficiency) & np.isfinite(by_gates.rebound_efficiency)
    used, weights = outcome.used & both, outcome.weights
    compared: dict[str, ComparedQuantity] = {}
    if used.any() and np.isfinite(weights[used]).all():
        share = weights[used] / weights[used].sum()
        place = np.round(readings.position, 6)[used]
        for name, field in COMPARED.items():
            of_gates, of_video = (getattr(each, field)[:, used] for each in moved[:2])
            compared[name] = _compare_quantity(variants, of_gates, of_video, share, place)
    moved_by, risen_by = _per_shot(*moved[1:]), _per_shot(*risen[1:])
    u = frames_u(best, sightings, camera)
    for name, value in _per_shot(by_video, camera).items():
        by_heights = np.sum((risen_by[name] - value) ** 2, axis=0)
        u[name] = np.sqrt(u[name] ** 2 + variants.u(moved_by[name]) ** 2 + by_heights)
    return CameraComparison(
        quantities=compared,
        hits=int(used.sum()),
        missed=int((outcome.used & ~both).sum()),
        filmed=camera,
        shots=by_video,
        u=u,
    )


def _by_both(
    model: MeasurementModel, sightings: Sightings, x: Mapping[str, Array], by_gates: FlightModel
) -> tuple[SetResults, SetResults, CameraResults]:
    """Return the results of the shots by gates, by video, and by the camera alone, (..., shot)."""
    bat = bat_properties(x)
    gates = model.shots(x, bat, by_gates)
    drag = drag_of(x, of_ball(ball_masses(x, model.balls), model.readings.ball))
    results = reduce_film(x, sightings, drag, by_gates(x, drag))
    return gates, model.shots(x, bat, lambda *_: results.flights), results


def _per_shot(video: SetResults, camera: CameraResults) -> dict[str, Array]:
    """Return the camera results of each shot by the names in `CameraComparison.u`."""
    return {
        "speed_in": camera.flights.speed_in,
        "speed_out": camera.flights.speed_out,
        "efficiency": video.rebound_efficiency,
        "place": camera.place,
        "angle": camera.angle_in,
    }


def _compare_quantity(
    variants: Variants, gates: Array, video: Array, weights: Array, places: Array
) -> ComparedQuantity:
    """Return a quantity of hits (variant, hit) from gates, from video, and combined.

    The combined result is the weighted mean with the smallest uncertainty. Only errors that differ
    between the two methods determine the weights. These are the errors of the constants, and for
    each method half of the scatter of the differences. The scatter of the hits is common to both.
    """

    def mix(of_gates: float, of_video: float) -> Budget:
        # Noise that differs from shot to shot (frames, heights) is part of the scatter of the hits.
        hits, share = (of_gates * gates + of_video * video)[None], weights[None]
        return means_of_hits(variants, hits, share, places[None], share).row(0)

    gate_effects, video_effects = (
        variants.components((hits @ weights)[None]).effect[0] for hits in (gates, video)
    )
    apart, off = video - gates, video_effects - gate_effects
    effects = variants.effects(apart)[None]
    noise = Scatter.of_hits(apart[:1], weights[None], places[None], effects).u[0] ** 2
    total = float(off @ off) + noise
    share = float(np.clip((noise / 2 - gate_effects @ off) / total, 0.0, 1.0)) if total else 0.5
    return ComparedQuantity(
        gates=mix(1.0, 0.0),
        video=mix(0.0, 1.0),
        joined=mix(1 - share, share),
        difference=mix(-1.0, 1.0),
        share=share,
    )
