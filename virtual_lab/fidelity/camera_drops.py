"""What frames that a camera drops unnoticed do to a speed, and whether anything is said of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from virtual_lab.fidelity.camera_map import FLAGGED, GOOD, INACCURATE, UNSAID
from virtual_lab.streams import Streams
from virtual_lab.video.track.legs import AirOnFlight, Places, split

__all__ = ["DROPPED", "METHOD", "dropped_frames"]

DROPPED, METHOD = "frames dropped, no time stamps", "legs"
COUNTS = (0, 1, 2, 3, 5)  # of dropped frames, one after the other
ERRORS = (0.002, 0.02, 0.1, 0.5)  # pixels, of a place
FLIGHTS, FRAMES = 24, 20  # of each a flight in and out
STEP, BACK = 12.5, -5.0  # pixels a frame
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
        legs = split(
            Places(
                t=np.arange(kept.size, dtype=float),
                places=seen,
                u=np.full(kept.size, error),
                pattern_u=0.0,
                exposure=0.0,
            ),
            AirOnFlight(),
            stamped=False,
        )
        said[k] = bool(legs.lost or legs.stepped)
        true = float(np.hypot(STEP, 0.1))
        off[k] = legs.flight_in.speed / true - 1
        beyond[k] = abs(legs.flight_in.speed - true) > BEYOND * legs.flight_in.speed_u
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
