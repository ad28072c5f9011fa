"""Check of beam interruptions: none may be longer than the ball's diameter."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Raised
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.gates import INBOUND, THICKNESS, GateReadings
from virtual_lab.measurement.reduction.shot_algebra import drag_of, of_ball
from virtual_lab.records import BoardRecord, GateRecord, Record
from virtual_lab.units import Array, Mask

Numbers = NDArray[np.intp]

SIZE = 0.02  # relative tolerance of the diameter; the rules allow ±0.014 (9 to 9 1/4 in around)


def chords(evidence: Evidence) -> Iterator[Raised]:
    """Yield the flags about implausible ball diameters that the gates measured.

    A diameter is computed from the time for which the ball breaks a beam. The time that the ball
    takes to cross the thickness of the beam is subtracted. A beam that misses the center of the
    ball shows less than the diameter, but no beam can show more.

    Two flags are yielded for the gates at the wall, and two for the gates at the bat:

    * The first is raised if a diameter is more than 2 % above the nominal diameter.
    * The second is raised if nine of ten diameters are more than 2 % below the nominal diameter.

    A flag holds the laboratories in which it is raised. It is also yielded if no laboratory raises
    it. Nothing is yielded for gates that recorded no edges.
    """
    hits = evidence.reduced.preparation.balls
    wall, bat = (evidence.block.records[stage].get("gates") for stage in ("balls", "impact"))
    by_hit = np.arange(evidence.laboratories).repeat(hits.ball.shape[-1])
    shots = evidence.readings
    diameters_at = {
        "wall": (by_hit, _diameters(evidence, "balls", wall, hits.flights, hits.ball)),
        "bat": (
            evidence.owner,
            _diameters(evidence, "impact", bat, shots.flights, shots.ball),
        ),
    }
    if isinstance(bat, BoardRecord):
        # The window on the edges has already excluded shots that scraps of the sabot disturbed.
        owner, diameters = diameters_at["bat"]
        diameters_at["bat"] = owner[~evidence.off_flight], diameters[~evidence.off_flight]
    nominal = 2 * evidence.best["ball.radius"][:, 0, 0]
    for where, (owner, diameters) in diameters_at.items():
        flat = diameters.reshape(len(diameters), diameters[:1].size)
        finite = np.isfinite(flat)
        if not finite.any():
            continue
        longest = np.where(finite, flat, 0.0).max(axis=1, initial=0.0)
        is_wide = longest > nominal[owner] * (1 + SIZE)
        yield _too_wide(evidence, where, owner, longest, is_wide, nominal)
        # A single beam meets most balls off their center and shows less than the diameter.
        size = nominal.copy()
        for laboratory in range(evidence.laboratories):
            values = flat[owner == laboratory]
            if np.isfinite(values).any():
                size[laboratory] = np.quantile(values[np.isfinite(values)], 0.9)
        yield _too_narrow(where, size, nominal)


def _too_wide(
    evidence: Evidence, where: str, owner: Numbers, longest: Array, wide: Mask, nominal: Array
) -> Raised:
    bad = np.bincount(owner, wide, evidence.laboratories)

    def describe(i: int) -> str:
        values = longest[owner == i]
        return (
            f"in {bad[i]:.0f} of {values.size} shots at the {where}, the gates show a ball "
            f"diameter of up to {values.max() * 1e3:.1f} mm instead of {nominal[i] * 1e3:.1f} mm"
        )

    return Raised(name="chords", where=bad > 0, sentence=describe)


def _too_narrow(where: str, size: Array, nominal: Array) -> Raised:
    return Raised(
        name="chords",
        where=size < nominal * (1 - SIZE),
        sentence=lambda i: (
            f"the gates at the {where} show a ball diameter of {size[i] * 1e3:.1f} mm instead of "
            f"{nominal[i] * 1e3:.1f} mm"
        ),
    )


def _diameters(
    evidence: Evidence, stage: str, record: Record | None, readings: FlightReadings, ball: Numbers
) -> Array:
    """Return the ball diameter from each passage [m], (shot, direction, gate), NaN if unknown."""
    if not isinstance(readings, GateReadings) or not isinstance(record, GateRecord | BoardRecord):
        return np.full((ball.size, 2, 1), np.nan)
    x, mass = evidence.best, evidence.measured_balls.mass
    if stage == "impact":  # constants of the laboratory of each shot, (shot, 1, 1)
        x = {name: value[evidence.owner] for name, value in x.items()}
        mass, ball = mass[evidence.owner], ball[:, None, None]
        readings = readings.part(np.arange(ball.size)[:, None, None])
    drag = drag_of(x, of_ball(mass, np.maximum(ball, 0)))
    flights, shots = readings.correct(x, drag), ball.size
    distances = readings.distances
    grows = np.exp(drag.reshape(shots, 1) * distances)
    speed_in, speed_out = (each.reshape(shots, 1) for each in (flights.speed_in, flights.speed_out))
    speed = np.stack([speed_in * grows, speed_out / grows], axis=1)
    owner = (
        evidence.owner
        if stage == "impact"
        else np.arange(evidence.laboratories).repeat(ball.shape[-1])
    )

    def constant(name: str) -> Array:
        return np.ravel(evidence.best[f"{stage}.gates.{name}"])[owner]

    thick = evidence.block.calibration.get(stage + THICKNESS)
    through = np.zeros(shots) if thick is None else thick.value[owner]
    if isinstance(record, GateRecord):
        chords_shown = np.diff(record.times, axis=-1)[..., 0]
        along = chords_shown * speed / constant("clock")[:, None, None]
        return np.asarray(along - through[:, None, None])
    # A beam above or below the ball's center shows a shorter chord. Rebounds are left out because
    # they may be steep.
    pitch, lowest = constant("pitch"), constant("lowest")
    beams = lowest[:, None] + pitch[:, None] * np.arange(record.times.shape[3])
    along = np.diff(record.times[:, INBOUND], axis=-1)[..., 0] * speed[:, INBOUND, :, None]
    along = along - through[:, None, None]
    heights = readings.passages.heights.reshape(shots, *readings.passages.heights.shape[-2:])
    above = beams[:, None] - heights[:, INBOUND, :, None]
    square = along**2 + 4 * above**2
    seen_any = np.asarray(np.isfinite(square).any(axis=-1))
    middle = np.nanmedian(np.where(seen_any[..., None], square, 0.0), axis=-1)
    return np.sqrt(np.where(seen_any, middle, np.nan))
