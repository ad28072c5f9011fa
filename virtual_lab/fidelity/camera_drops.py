"""What frames that a camera drops unnoticed do to a speed, and whether anything is said of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.fidelity.camera_map import FLAGGED, GOOD, INACCURATE, UNSAID
from virtual_lab.streams import Streams
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.follow.flights import flights_of
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.track.legs import AirOnFlight, fit_flight

__all__ = ["DROPPED", "METHOD", "dropped_frames"]

Array = NDArray[np.float64]
DROPPED, METHOD = "frames dropped, no time stamps", "followed"
COUNTS = (0, 1, 2, 3, 5)  # of dropped frames, one after the other
ERRORS = (0.002, 0.02, 0.1, 0.5)  # pixels, of a place
FLIGHTS, FRAMES = 24, 20  # of each a flight in and out
STEP, BACK, RADIUS = 12.5, -5.0, 15.0  # pixels a frame, pixels
BEYOND, TOLERANCE = 5.0, 1e-3  # standard uncertainties; of the speed, of a good cell


def dropped_frames() -> list[dict[str, Any]]:
    """Return rows as `camera_stability.measure` does; errors are relative, of the speed."""
    return [_cell(count, error) for error in ERRORS for count in COUNTS]


def _cell(count: int, error: float) -> dict[str, Any]:
    draws = Streams(1)
    name = f"{count} of {error:g}"
    middle = np.round(2 + (FRAMES - 5) * (draws.uniform(f"{name}: where", FLIGHTS) + 0.5))
    off, said, beyond = np.empty(FLIGHTS), np.zeros(FLIGHTS, bool), np.zeros(FLIGHTS, bool)
    for k, first in enumerate(middle.astype(int)):
        t = np.arange(2 * FRAMES + count) - FRAMES - count + 0.5
        x = np.where(t < 0, STEP * t, BACK * t)
        places = np.stack([x, 0.1 * t], axis=1)
        kept = np.delete(np.arange(t.size), np.arange(first, first + count))
        seen = (
            places[kept] + error * draws.normal(f"{name}: places", (kept.size, 2), np.array([k]))[0]
        )
        flights, lost = _followed(seen)
        said[k] = bool(lost) or len(flights) != 2
        first_flight = flights[0]
        speed = fit_flight(
            first_flight.t,
            first_flight.xy,
            np.full(len(first_flight.t), error),
            0.0,
            AirOnFlight(),
            float(first_flight.t[-1]),
        )
        true = float(np.hypot(STEP, 0.1))
        off[k] = speed.speed / true - 1
        beyond[k] = abs(speed.speed - true) > BEYOND * speed.speed_u
    rms = float(np.sqrt(np.mean(off**2)))
    unsaid = int((beyond & ~said).sum())
    if unsaid:
        state = UNSAID
    elif rms <= TOLERANCE:
        state = GOOD
    else:
        state = FLAGGED if said.mean() >= 0.5 else INACCURATE
    return {
        "map": DROPPED,
        "value": count,
        "method": METHOD,
        "ball": f"places to {error:g} px",
        "state": state,
        "rms_unflagged": rms,
        "pictures": FLIGHTS,
        "unsaid": unsaid,
        "flagged": int(said.sum()),
        "lost": 0,
    }


def _followed(places: Array) -> tuple[list[Piece], dict[int, int]]:
    """Return the flights that places are followed as, one a frame, and frames that are missing."""
    found = np.zeros(len(places), BLOB)
    found["frame"] = np.arange(len(places))
    for names, values in ((("x", "picture_x"), places[:, 0]), (("y", "picture_y"), places[:, 1])):
        for name in names:
            found[name] = values
    found["radius"] = found["length"] = RADIUS
    time = np.arange(len(places), dtype=float)
    scene = FlightScene(found=found, time=time, stamped=time, size=(1280, 800), exposure=0.0)
    flights, _ = flights_of(scene, pieces(found, time))
    return flights, scene.lost(flights)
