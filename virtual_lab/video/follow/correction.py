"""A track that went out as CSV, was corrected by hand, and comes back."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.files import read_text
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import FLIGHTS
from virtual_lab.video.follow.pieces import Piece


def read_track(path: Path, clip: Clip) -> tuple[Watched, list[Piece]]:
    """Places in a track as blobs, and the flights that its column `flight` names.

    Columns: frame, x_px and y_px in the still frame, flight (empty: of none); radius_px (else the
    median), time_s (else the frame's), drift_x_px and drift_y_px (else 0).

    Raises
    ------
    InputError
        No such file, a column that is missing, numbers that cannot be read, a frame that the clip
        does not have or that comes twice, flights at the same time.
    """
    rows = list(csv.DictReader(read_text(path).splitlines()))
    head = list(rows[0]) if rows else []
    for name in ("frame", "x_px", "y_px", "flight"):
        if name not in head:
            raise InputError(str(path), "columns", ", ".join(map(str, head)), f"needs {name!r}")
    frames = _column(path, rows, "frame")
    if (bad := np.flatnonzero(~np.isin(frames, np.arange(clip.count)))).size:
        row, allowed = int(bad[0]), f"the clip has frames 0 to {clip.count - 1}"
        raise InputError(str(path), f"row {row + 2}: frame", rows[row]["frame"], allowed)
    numbers, counts = np.unique(frames, return_counts=True)
    if counts.max() > 1:
        twice = int(numbers[counts.argmax()])
        raise InputError(str(path), "frame", twice, "a frame has one place of the ball")
    found = np.zeros(len(rows), BLOB)
    found["frame"] = frames
    for name in ("x", "y"):
        found[name] = _column(path, rows, f"{name}_px")
        found[f"picture_{name}"] = found[name] + _column(path, rows, f"drift_{name}_px", 0.0)
    radius = _column(path, rows, "radius_px", np.nan)
    if np.isnan(radius).all():
        raise InputError(str(path), "radius_px", None, "at least one place needs it")
    found["radius"] = np.where(np.isnan(radius), np.nanmedian(radius), radius)
    found["length"], found["edge"] = found["radius"], 0.1 * found["radius"]
    times = _column(path, rows, "time_s", np.nan) / usual_step(clip.times)
    order = np.argsort(frames)
    found, t = found[order], np.where(np.isnan(times), frames, times)[order]
    names = np.array([(row["flight"] or "").strip() for row in rows])[order]
    flights = [np.flatnonzero(names == name) for name in dict.fromkeys(names) if name]
    watched = Watched(
        still=still_of(list(clip.samples[:1]), max(8, int(clip.full_scale).bit_length())),
        found=found,
        change=np.full(clip.count, np.nan),
    )
    pieces = [Piece.of(found, own, t[own]) for own in flights if len(own) >= FLIGHTS.side_places]
    pieces.sort(key=lambda each: each.frames[0])
    for one, other in pairwise(pieces):
        if other.frames[0] <= one.frames[-1]:
            which, allowed = int(other.frames[0]), "a flight begins after the one before has ended"
            raise InputError(str(path), f"flight at frame {which}", names[other.blobs[0]], allowed)
    return watched, pieces


def _column(
    path: Path, rows: list[dict[str, str]], name: str, otherwise: float | None = None
) -> NDArray[np.float64]:
    """Numbers of a column; `otherwise` where there is none."""
    values = np.full(len(rows), np.nan if otherwise is None else otherwise)
    for k, row in enumerate(rows):
        text = (row.get(name) or "").strip()
        if not text and otherwise is not None:
            continue
        fault = InputError(str(path), f"row {k + 2}: {name}", text, "expected a number")
        try:
            values[k] = float(text)
        except ValueError as cause:
            raise fault from cause
        if not abs(values[k]) <= 1e7:
            raise fault
    return values
