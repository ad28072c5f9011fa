"""Effect of unnoticed dropped frames on the speed of a ball, and whether they are flagged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from virtual_lab.fidelity.camera_errors import BEYOND
from virtual_lab.fidelity.drawing import PictureState
from virtual_lab.streams import Streams
from virtual_lab.units import Array
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.follow.flights import flights_of
from virtual_lab.video.follow.joint import Fit, estimate_of, fit_flights
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.scene import FlightScene

ERRORS = (0.002, 0.02, 0.1, 0.5)  # standard deviations of a position [px]


def dropped_frames(
    counts: Sequence[int] = (0, 1, 2, 3, 5), flights: int = 24
) -> list[dict[str, Any]]:
    """Return one row per combination of a number of dropped frames and a position error.

    The located positions have random errors. Their standard deviations are `ERRORS` [px]. The keys
    of a row are those of `camera_stability.picture_cells`:

    * ``rms_unflagged`` is the relative rms error of the measured incoming speed, over all balls
      without a flag.
    * ``pictures`` is the number of balls. ``unsaid`` is the number of balls with a wrong speed and
      no flag. ``flagged`` is the number of balls with a flag, and ``lost`` of those without a
      flight, which count as flagged.
    * ``state`` is a value of `PictureState`. It follows from the rms error of all incoming speeds.

    Parameters
    ----------
    counts
        Numbers of consecutive dropped frames.
    flights
        Number of balls per row, each with an incoming and a rebound flight.
    """
    return [_cell(count, error, flights) for error in ERRORS for count in counts]


def _cell(count: int, error: float, flights: int) -> dict[str, Any]:
    frames, speed_in, speed_out = 20, 12.5, -5.0  # frames per flight; speeds [px/frame]
    draws = Streams(1)
    name = f"{count} of {error:g}"
    middle = np.round(2 + (frames - 5) * (draws.uniform(f"{name}: where", flights) + 0.5))
    relative_error = np.full(flights, np.nan)
    flagged, beyond = np.zeros((2, flights), bool)
    for k, first in enumerate(middle.astype(int)):
        t = np.arange(2 * frames + count) - frames - count + 0.5
        x = np.where(t < 0, speed_in * t, speed_out * t)
        places = np.stack([x, 0.1 * t], axis=1)
        frames_left = np.delete(np.arange(t.size), np.arange(first, first + count))
        measured = (
            places[frames_left]
            + error * draws.normal(f"{name}: places", (frames_left.size, 2), np.array([k]))[0]
        )
        flights_found, scene = _follow(measured)
        flagged[k] = bool(scene.missing_frames(flights_found)) or len(flights_found) != 2
        if not flights_found:
            continue
        incoming = flights_found[0]
        incoming = replace(incoming, u=np.full(len(incoming.t), error), sharp=True)
        still = replace(scene, pull=np.zeros(2), drag=(0.0, 0.0))
        speed = estimate_of(_last_speed, fit_flights(still, [incoming]))
        true = float(np.hypot(speed_in, 0.1))
        relative_error[k] = speed.value / true - 1
        beyond[k] = abs(speed.value - true) > BEYOND * speed.u
    rms = _rms(relative_error)
    unsaid = int((beyond & ~flagged).sum())
    if unsaid:
        state = PictureState.UNSAID
    elif rms <= 1e-3:
        state = PictureState.GOOD
    else:
        state = PictureState.FLAGGED if flagged.mean() >= 0.5 else PictureState.INACCURATE
    return {
        "map": "number of dropped frames, no time stamps",
        "value": count,
        "method": "followed",
        "ball": f"error of positions {error:g} px",
        "state": state.value,
        "rms_unflagged": None if flagged.all() else _rms(relative_error[~flagged]),
        "pictures": flights,
        "unsaid": unsaid,
        "flagged": int(flagged.sum()),
        "lost": int(np.isnan(relative_error).sum()),
    }


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error[np.isfinite(error)] ** 2)))


def _last_speed(fit: Fit) -> Array:
    return np.asarray(np.linalg.norm(fit.states[..., 0, 2:], axis=-1))


def _follow(places: Array) -> tuple[list[Piece], FlightScene]:
    """Return the flights through `places`, shape (frame, 2), and their scene."""
    blobs = np.zeros(len(places), BLOB)
    blobs["frame"] = np.arange(len(places))
    for names, values in ((("x", "picture_x"), places[:, 0]), (("y", "picture_y"), places[:, 1])):
        for name in names:
            blobs[name] = values
    blobs["radius"] = blobs["length"] = 15.0
    time = np.arange(len(places), dtype=float)
    scene = FlightScene(blobs=blobs, time=time, stamped=time, size=(1280, 800), exposure=0.0)
    flights, _ = flights_of(scene, pieces(blobs, time))
    return flights, scene
