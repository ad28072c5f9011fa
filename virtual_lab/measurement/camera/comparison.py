"""Comparison of camera and gates for the same hits: e_A, e and BPF by both, and combined.

Both methods share bat, balls and hits, so their results are correlated. The effect of each
constant on both is known, and the two are combined with the least uncertainty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.camera.filmed import CameraResults, FramesU, filmed, frames_u
from virtual_lab.measurement.camera.windows import Sightings, sight
from virtual_lab.measurement.reduction.flights import FlightModel
from virtual_lab.measurement.reduction.gates import GateReadings, heights_moved
from virtual_lab.measurement.reduction.shot_algebra import ShotResults, bat_properties, drag_of
from virtual_lab.measurement.session_reduction import SessionReduction, best_values, constants_known
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import (
    Budget,
    Component,
    Variants,
    mean_of_hits,
    scatter,
)
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

COMPARED: Mapping[str, str] = {  # name in a certificate: the shots' field it is the mean of
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "bat_performance_factor": "bat_performance_factor",
}
GATES, VIDEO = "gates", "video"


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedQuantity:
    """One quantity from the gates, from video, and combined."""

    gates: Budget
    video: Budget
    joined: Budget
    difference: Budget  # video less gates
    share: float  # of the video in what is joined

    @property
    def agree(self) -> bool:
        """Whether the 95 % interval of the difference contains 0."""
        low, high = self.difference.interval_95
        return low <= 0 <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraComparison:
    """Results of the camera in a test."""

    # by the keys of COMPARED; {} where no hit that counts was filmed
    quantities: Mapping[str, ComparedQuantity]
    hits: int  # that count and both saw
    missed: int  # that count, and the camera did not see well
    filmed: CameraResults
    shots: ShotResults
    u: Mapping[str, Array]  # of each shot's speed_in, speed_out, efficiency, place and angle


@constants_known()
def compare_camera(session: Session, reduced: SessionReduction) -> CameraComparison | None:
    """Camera results of a session, None without a camera.

    Raises
    ------
    InputError
        The camera's record or its calibration cannot be used.
    """
    record = session.records["impact"].get("camera")
    if not isinstance(record, ClipRecord | TrackRecord):
        return None
    best = best_values(reduced.constants)
    seen = sight(record, camera_constants(session), float(best["ball.radius"]))
    variants, gates = Variants.of(reduced.constants), reduced.readings.flights
    if not isinstance(gates, GateReadings):  # which show how high a ball flies, so how far away
        return None
    by_gates, risen = gates.corrected, heights_moved(gates)
    found = _by_both(reduced, seen, best, by_gates)
    moved = _by_both(reduced, seen, variants.columns, by_gates)
    both = np.isfinite(found.video.rebound_efficiency) & np.isfinite(found.gates.rebound_efficiency)
    used, weights = reduced.outcome.used & both, reduced.outcome.weights
    compared: dict[str, ComparedQuantity] = {}
    if used.any() and np.isfinite(weights[used]).all():
        share = weights[used] / weights[used].sum()
        place = np.round(reduced.readings.place, 6)[used]
        for name, field in COMPARED.items():
            hits = {who: getattr(moved.results[who], field)[:, used] for who in (GATES, VIDEO)}
            compared[name] = _compared(variants, hits, share, place)
    return CameraComparison(
        quantities=compared,
        hits=int(used.sum()),
        missed=int((reduced.outcome.used & ~both).sum()),
        filmed=found.filmed,
        shots=found.video,
        u=_shots_u(
            found,
            frames_u(best, "impact", seen, found.filmed),
            {name: variants.u(values) for name, values in moved.quantities.items()},
            _by_both(reduced, seen, best, risen).quantities,
        ),
    )


def camera_constants(session: Session) -> dict[str, Estimate]:
    """Calibration of the camera at the bat."""
    stem = "impact.camera."
    return {
        name.removeprefix(stem): known
        for name, known in session.calibration.items()
        if name.startswith(stem)
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Both:
    """Results of the shots for any values of the constants by gates and by video, (..., shot)."""

    gates: ShotResults
    video: ShotResults
    filmed: CameraResults

    @property
    def results(self) -> dict[str, ShotResults]:
        return {GATES: self.gates, VIDEO: self.video}

    @property
    def quantities(self) -> dict[str, Array]:
        """Camera results of each shot."""
        return {
            "speed_in": self.filmed.flights.speed_in,
            "speed_out": self.filmed.flights.speed_out,
            "efficiency": self.video.rebound_efficiency,
            "place": self.filmed.place,
            "angle": self.filmed.angle_in,
        }


def _by_both(
    reduced: SessionReduction, seen: Sightings, x: Mapping[str, Array], by_gates: FlightModel
) -> _Both:
    bat = bat_properties(x)
    gates = reduced.model.shots(x, bat, by_gates)
    drag = drag_of(x, gates.ball_mass)
    found = filmed(x, "impact", seen, drag, by_gates(x, drag))
    video = reduced.model.shots(x, bat, lambda *_: found.flights)
    return _Both(gates=gates, video=video, filmed=found)


def _shots_u(
    found: _Both, own: FramesU, known: Mapping[str, Array], risen: Mapping[str, Array]
) -> dict[str, Array]:
    """Each shot's standard uncertainties: calibrations, frames and heights together.

    Parameters
    ----------
    own
        From the frames alone.
    known
        From the calibrations, (shot,).
    risen
        The quantities with shifted heights, (independent shift, shot).
    """
    flights = found.filmed.flights
    ratio = np.hypot(own.speed_in / flights.speed_in, own.speed_out / flights.speed_out)
    frames = {
        "speed_in": own.speed_in,
        "speed_out": own.speed_out,
        "efficiency": ratio * flights.speed_out / flights.speed_in,
        "place": own.place,
        "angle": own.angle_in,
    }
    return {
        name: np.sqrt(known[name] ** 2 + u**2 + np.sum((risen[name] - best) ** 2, axis=0))
        for (name, u), best in zip(frames.items(), found.quantities.values(), strict=True)
    }


def _compared(
    variants: Variants, hits: Mapping[str, Array], weights: Array, places: Array
) -> ComparedQuantity:
    """Quantity from gates and from video, combined, and their difference.

    `hits` are those of the variants, (k, hit).
    """

    def mixed(gates: float, video: float) -> Budget:
        # what is new in every shot, as noise of frames and of heights, is in the hits' own scatter
        values = gates * hits[GATES] + video * hits[VIDEO]
        return mean_of_hits(variants, values, weights, places)

    parts = {who: variants.components(values @ weights).of(0) for who, values in hits.items()}
    apart = hits[VIDEO] - hits[GATES]
    share = _share(parts, scatter(apart[0], weights, places, variants.effects(apart)))
    return ComparedQuantity(
        gates=mixed(1.0, 0.0),
        video=mixed(0.0, 1.0),
        joined=mixed(1 - share, share),
        difference=mixed(-1.0, 1.0),
        share=share,
    )


def _share(parts: Mapping[str, list[Component]], apart: Component) -> float:
    """Weight of the video in the combination of least uncertainty.

    Only errors that differ between the two methods matter: the constants, and half of the scatter
    of the differences for each method. The scatter of the hits is common to both.
    """
    gates = np.array([part.sensitivity * part.u for part in parts[GATES]])
    off = np.array([part.sensitivity * part.u for part in parts[VIDEO]]) - gates
    noise = apart.contribution**2
    total = float(off @ off) + noise
    if total == 0:
        return 0.5
    return float(np.clip((noise / 2 - gates @ off) / total, 0.0, 1.0))
