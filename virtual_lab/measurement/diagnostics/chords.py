"""Check of beam interruptions: none may be longer than the ball's diameter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Flag
from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.measurement.reduction.gates import INBOUND, GateReadings
from virtual_lab.measurement.reduction.shot_algebra import drag_of
from virtual_lab.records import BoardRecord, GateRecord
from virtual_lab.units import Array

SIZE = 0.02  # relative, of the diameter; the rules' own 9 to 9 1/4 in are 0.014 either way


def chords(seen: Evidence) -> Iterator[Flag]:
    """Compare the diameter from the edges of each beam with the ball's diameter.

    No beam can show more than the diameter; a single beam off the centre shows less.
    """
    found = {
        "wall": _diameters(seen, "balls", seen.balls.seen, seen.balls.ball),
        "bat": _diameters(seen, "impact", seen.readings.seen, seen.readings.ball),
    }
    if isinstance(seen.session.records["impact"].get("gates"), BoardRecord):
        # the window on the edges has already thrown out what scraps of the sabot spoil
        found["bat"] = found["bat"][~seen.off_flight]
    nominal = 2 * float(seen.best["ball.radius"])
    for where, diameters in found.items():
        flat = diameters.reshape(len(diameters), diameters[:1].size)
        known = np.isfinite(flat)
        longest = np.where(known, flat, 0.0).max(axis=1, initial=0.0)
        bad = int((longest > nominal * (1 + SIZE)).sum())
        if bad:
            yield Flag(
                name="chords",
                sentence=f"{bad} of {longest.size} balls at the {where} look up to "
                f"{longest.max() * 1e3:.1f} mm across, they are {nominal * 1e3:.1f} mm",
            )
        # a single beam sees most balls off their centre, and shorter
        size = float(np.quantile(flat[known], 0.9)) if known.any() else nominal
        if size < nominal * (1 - SIZE):
            yield Flag(
                name="chords",
                sentence=f"balls at the {where} look {size * 1e3:.1f} mm across, "
                f"they are {nominal * 1e3:.1f} mm",
            )


def _diameters(
    seen: Evidence, stage: str, readings: FlightReadings, ball: NDArray[np.int_]
) -> Array:
    """Return the diameter from each passage [m], (shot, way, gate); NaN: none."""
    if not isinstance(readings, GateReadings):
        return np.full((len(ball), 2, 1), np.nan)
    record: Any = seen.session.records[stage]["gates"]
    x = seen.best
    drag = drag_of(x, seen.measured_balls.mass[ball])
    flown = readings.flights(x, drag)
    grows = np.exp(drag[:, None] * readings.distances)
    speed = np.stack([flown.speed_in[:, None] * grows, flown.speed_out[:, None] / grows], axis=1)
    if isinstance(record, GateRecord):
        times = record.times
        if stage == "balls":  # of which the reduction keeps the hits seen both ways
            ends = times[:, :, [0, -1]]
            times = times[np.isfinite(ends).all(axis=(1, 2, 3))]
        return np.asarray(np.diff(times, axis=-1)[..., 0] * speed / x[f"{stage}.gates.clock"])
    if not isinstance(record, BoardRecord):
        return np.full(speed.shape, np.nan)
    # a beam off the centre's height sees a shorter chord; a steep way back is left out
    pitch, lowest = float(x[f"{stage}.gates.pitch"]), float(x[f"{stage}.gates.lowest"])
    beams = lowest + pitch * np.arange(record.times.shape[3])
    along = np.diff(record.times[:, INBOUND], axis=-1)[..., 0] * speed[:, INBOUND, :, None]
    above = beams - readings.passages.heights[:, INBOUND, :, None]
    square = along**2 + 4 * above**2
    seen_any = np.asarray(np.isfinite(square).any(axis=-1))
    middle = np.nanmedian(np.where(seen_any[..., None], square, 0.0), axis=-1)
    return np.sqrt(np.where(seen_any, middle, np.nan))
