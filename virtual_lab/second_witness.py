"""What a camera says of the same hits as the gates: e_A, e and BPF by both, joined, and agreed.

The two share the bat, the balls and the hits, so their results go up and down together; what
each constant does to both is known, and the two are joined so that the uncertainty is least.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.estimate import Estimate
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.reduced import Reduced, constants_known
from virtual_lab.reduction.flights import Flights, timed
from virtual_lab.reduction.measurement import ShotResults, drag_of, measured_balls
from virtual_lab.reduction.video.filmed import Filmed, filmed, frames_u
from virtual_lab.reduction.video.windows import Sightings, sight
from virtual_lab.session import Session
from virtual_lab.uncertainty.budget import Budget, Component, combine, propagate, scatter, spread

__all__ = ["COMPARED", "SecondWitness", "Told", "second_witness"]

Array = NDArray[np.float64]
COMPARED: Mapping[str, str] = {  # name in a certificate: the shots' field it is the mean of
    "collision_efficiency": "lot_collision_efficiency",
    "restitution": "lot_restitution",
    "bat_performance_factor": "bat_performance_factor",
}
GATES, VIDEO = "gates", "video"


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """One quantity as the witnesses tell it."""

    gates: Budget
    video: Budget
    joined: Budget
    difference: Budget  # video less gates
    share: float  # of the video in what is joined

    @property
    def agree(self) -> bool:
        """Whether 0 lies within the difference's 95 % interval."""
        low, high = self.difference.interval_95
        return low <= 0 <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondWitness:
    """What the camera adds to a test."""

    told: Mapping[str, Told]  # by the keys of COMPARED; {} where no hit that counts was filmed
    hits: int  # that count and both saw
    missed: int  # that count, and the camera did not see well
    filmed: Filmed
    shots: ShotResults
    u: Mapping[str, Array]  # of each shot's speed_in, speed_out, efficiency, place and angle


@constants_known()
def second_witness(session: Session, reduced: Reduced) -> SecondWitness | None:
    """Return what a session's camera says, None where it had none.

    Raises
    ------
    InputError
        The camera's record or its calibration cannot be used.
    """
    record = session.records["impact"].get("camera")
    if not isinstance(record, ClipRecord | TrackRecord):
        return None
    best = {name: np.array(known.value) for name, known in reduced.constants.items()}
    seen = sight(record, camera_constants(session), float(best["ball.radius"]))
    by_gates = timed("impact", reduced.readings.passages)

    def by_camera(x: Mapping[str, Array], drag: Array) -> Flights:
        return filmed(x, "impact", seen, drag, by_gates(x, drag)).flights

    shots = reduced.results(best, by_camera)
    both = np.isfinite(shots.rebound_efficiency) & np.isfinite(reduced.shots.rebound_efficiency)
    used, weights = reduced.outcome.used & both, reduced.outcome.weights
    told: dict[str, Told] = {}
    if used.any() and np.isfinite(weights[used]).all():
        share = np.where(used, weights, 0.0) / weights[used].sum()
        place = np.round(reduced.readings.place, 6)

        def model(x: Mapping[str, Array]) -> dict[str, Array]:
            witnesses = {GATES: reduced.results(x), VIDEO: reduced.results(x, by_camera)}
            return {
                f"{name}.{who}": getattr(results, field)[..., used] @ share[used]
                for who, results in witnesses.items()
                for name, field in COMPARED.items()
            }

        parts = propagate(model, reduced.constants)
        for name, field in COMPARED.items():
            hits = {GATES: getattr(reduced.shots, field), VIDEO: getattr(shots, field)}
            told[name] = _told(
                {who: values[used] for who, values in hits.items()},
                {who: parts[f"{name}.{who}"] for who in hits},
                share[used],
                place[used],
            )
    found = _flights(reduced, best, seen)
    return SecondWitness(
        told=told,
        hits=int(used.sum()),
        missed=int((reduced.outcome.used & ~both).sum()),
        filmed=found,
        shots=shots,
        u=_shots_u(reduced, seen, found),
    )


def camera_constants(session: Session) -> dict[str, Estimate]:
    """Return the calibration of the camera at the bat."""
    stem = "impact.camera."
    return {
        name.removeprefix(stem): known
        for name, known in session.calibration.items()
        if name.startswith(stem)
    }


def _flights(reduced: Reduced, best: Mapping[str, Array], seen: Sightings) -> Filmed:
    balls = measured_balls(best, reduced.balls)
    drag = drag_of(best, balls.mass[..., reduced.readings.ball])
    by_gates = timed("impact", reduced.readings.passages)(best, drag)
    return filmed(best, "impact", seen, drag, by_gates)


def _shots_u(reduced: Reduced, seen: Sightings, found: Filmed) -> dict[str, Array]:
    """Return each shot's standard uncertainties, calibrations and frames together."""
    by_gates = timed("impact", reduced.readings.passages)

    def model(x: Mapping[str, Array]) -> dict[str, Array]:
        made: list[Filmed] = []

        def by_camera(x: Mapping[str, Array], drag: Array) -> Flights:
            made.append(filmed(x, "impact", seen, drag, by_gates(x, drag)))
            return made[0].flights

        efficiency = reduced.results(x, by_camera).rebound_efficiency
        flights = made[0].flights
        return {
            "speed_in": flights.speed_in,
            "speed_out": flights.speed_out,
            "efficiency": efficiency,
            "place": made[0].place,
            "angle": made[0].angle_in,
        }

    best = {name: np.array(known.value) for name, known in reduced.constants.items()}
    own = frames_u(best, "impact", seen, found)
    ratio = np.hypot(own.speed_in / found.flights.speed_in, own.speed_out / found.flights.speed_out)
    frames = {
        "speed_in": own.speed_in,
        "speed_out": own.speed_out,
        "efficiency": ratio * found.flights.speed_out / found.flights.speed_in,
        "place": own.place,
        "angle": own.angle_in,
    }
    known = spread(model, reduced.constants)
    return {name: np.hypot(known[name], frames[name]) for name in frames}


def _told(
    hits: Mapping[str, Array],
    parts: Mapping[str, list[Component]],
    weights: Array,
    places: Array,
) -> Told:
    """Return a quantity by both witnesses, joined, and their difference."""

    def mixed(gates: float, video: float) -> Budget:
        values = gates * hits[GATES] + video * hits[VIDEO]
        shared = [
            _blend(one, other, gates, video)
            for one, other in zip(parts[GATES], parts[VIDEO], strict=True)
        ]
        return combine(float(values @ weights), [*shared, scatter(values, weights, places)])

    share = _share(parts, scatter(hits[VIDEO] - hits[GATES], weights, places))
    return Told(
        gates=mixed(1.0, 0.0),
        video=mixed(0.0, 1.0),
        joined=mixed(1 - share, share),
        difference=mixed(-1.0, 1.0),
        share=share,
    )


def _share(parts: Mapping[str, list[Component]], apart: Component) -> float:
    """Return the video's share in what has the least uncertainty.

    Only what sets the witnesses apart counts: the constants, and half of the scatter of their
    differences for each. How the hits themselves scatter is the same for both.
    """
    gates = np.array([part.sensitivity * part.u for part in parts[GATES]])
    off = np.array([part.sensitivity * part.u for part in parts[VIDEO]]) - gates
    noise = apart.contribution**2
    total = float(off @ off) + noise
    if total == 0:
        return 0.5
    return float(np.clip((noise / 2 - gates @ off) / total, 0.0, 1.0))


def _blend(one: Component, other: Component, gates: float, video: float) -> Component:
    sensitivity = gates * one.sensitivity + video * other.sensitivity
    return Component(
        name=one.name,
        value=one.value,
        u=one.u,
        evaluation=one.evaluation,
        dof=one.dof,
        sensitivity=sensitivity,
        contribution=abs(sensitivity) * one.u,
        shift=gates * one.shift + video * other.shift,
    )
