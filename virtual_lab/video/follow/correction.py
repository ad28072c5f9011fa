"""A track that went out as CSV, was corrected by hand, and comes back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import read_text
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import SIDE
from virtual_lab.video.follow.pieces import Piece

__all__ = ["read_track"]

NEEDED = ("frame", "x_px", "y_px", "flight")


def read_track(path: Path, clip: Clip) -> tuple[Watched, list[Piece]]:
    """Return the places in a track as blobs, and the flights that its column `flight` names.

    Columns: frame, x_px and y_px in the still frame, flight (empty: of none); radius_px (else the
    median), time_s (else the frame's), drift_x_px and drift_y_px (else 0).

    Raises
    ------
    InputError
        No such file, a column that is missing, numbers that cannot be read, a frame that the clip
        does not have or that comes twice.
    """
    rows = list(csv.DictReader(read_text(path).splitlines()))
    head = list(rows[0]) if rows else []
    for name in NEEDED:
        if name not in head:
            raise InputError(str(path), "columns", ", ".join(map(str, head)), f"needs {name!r}")
    found = np.zeros(len(rows), BLOB)
    times = np.full(len(rows), np.nan)
    names = []
    for k, row in enumerate(rows):
        where = f"row {k + 2}"
        frame = _number(path, where, row, "frame")
        if frame != int(frame) or not 0 <= frame < clip.count:
            allowed = f"the clip has frames 0 to {clip.count - 1}"
            raise InputError(str(path), f"{where}: frame", row["frame"], allowed)
        found[k]["frame"] = int(frame)
        for name in ("x", "y"):
            found[k][name] = _number(path, where, row, f"{name}_px")
            drift = _number(path, where, row, f"drift_{name}_px", 0.0)
            found[k][f"picture_{name}"] = found[k][name] + drift
        found[k]["radius"] = _number(path, where, row, "radius_px", np.nan)
        times[k] = _number(path, where, row, "time_s", np.nan)
        names.append((row["flight"] or "").strip())
    frames = found["frame"]
    if len(np.unique(frames)) != len(frames):
        twice = int(frames[np.flatnonzero(np.diff(np.sort(frames)) == 0)[0]])
        raise InputError(str(path), "frame", twice, "a frame has one place of the ball")
    if np.isnan(found["radius"]).all():
        raise InputError(str(path), "radius_px", None, "at least one place needs it")
    found["radius"] = np.where(
        np.isnan(found["radius"]), np.nanmedian(found["radius"]), found["radius"]
    )
    found["length"], found["radius_u"] = found["radius"], 0.03 * found["radius"]
    order = np.argsort(frames, kind="stable")
    found, times = found[order], times[order]
    names = [names[k] for k in order]
    t = np.where(np.isnan(times), found["frame"].astype(float), times / usual_step(clip.times))
    ways = []
    for name in dict.fromkeys(each for each in names if each):
        own = np.array([each == name for each in names])
        if own.sum() < SIDE:
            continue
        ways.append(Piece.of(found, np.flatnonzero(own), t[own]))
    shifts = np.zeros((clip.count, 2))
    shifts[found["frame"]] = np.stack(
        [found["picture_x"] - found["x"], found["picture_y"] - found["y"]], axis=1
    )
    watched = Watched(
        still=still_of(list(clip.samples[:1]), max(8, int(clip.full_scale).bit_length())),
        found=found,
        shifts=shifts,
        change=np.full(clip.count, np.nan),
    )
    return watched, sorted(ways, key=lambda each: each.frames[0])


def _number(
    path: Path, where: str, row: dict[str, str], name: str, otherwise: float | None = None
) -> float:
    text = (row.get(name) or "").strip()
    if not text and otherwise is not None:
        return otherwise
    try:
        value = float(text)
    except ValueError as fault:
        raise InputError(str(path), f"{where}: {name}", text, "expected a number") from fault
    if not np.isfinite(value) or abs(value) > 1e7:
        raise InputError(str(path), f"{where}: {name}", text, "expected a number")
    return value
