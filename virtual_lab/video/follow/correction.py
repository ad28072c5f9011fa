"""Import of a track that was written as CSV and corrected by hand."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import read_table
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.columns import numbers_in
from virtual_lab.video.clips.timing import frame_steps, usual_step
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import GROWTH, Piece


def read_track(path: Path, clip: Clip) -> tuple[Watched, list[Piece]]:
    """Return the positions in a track file as blobs, and the flights in its column `flight`.

    The required columns are:

    * frame: number of the frame.
    * x_px, y_px: position after the drift of the camera is removed.
    * flight: name of the flight; empty for a position outside flights.

    The optional columns are:

    * radius_px: radius of the ball. The default is the median of the other rows.
    * time_s: time of the position. The default is the time of the frame in the clip.
    * drift_x_px, drift_y_px: drift of the camera. The default is 0.

    Flights of fewer than five positions are left out.

    Raises
    ------
    InputError
        The file or a column is missing, or a number cannot be read. No position has a radius. A
        frame is not in the clip or occurs twice. Two flights overlap in time.
    """
    table = read_table(path)
    if "flight" not in table:
        raise InputError(str(path), "columns", ", ".join(map(str, table)), "needs 'flight'")
    column = partial(numbers_in, table, path=path, most=1e7)
    frames = column("frame")
    if (bad := np.flatnonzero(~np.isin(frames, np.arange(clip.count)))).size:
        key, allowed = f"row {bad[0] + 2}: frame", f"the clip has frames 0 to {clip.count - 1}"
        raise InputError(str(path), key, f"{frames[bad[0]]:g}", allowed)
    order = np.argsort(frames)
    if not (steps := np.diff(frames[order])).all():
        twice = int(frames[order[steps.argmin()]])
        raise InputError(str(path), "frame", twice, "allowed: one position of the ball per frame")
    blobs = np.zeros(len(table), BLOB)
    blobs["frame"] = frames
    for name in ("x", "y"):
        blobs[name] = column(f"{name}_px")
        blobs[f"picture_{name}"] = blobs[name] + column(f"drift_{name}_px", otherwise=0.0)
    radius = column("radius_px", otherwise=np.nan)
    if np.isnan(radius).all():
        raise InputError(str(path), "radius_px", None, "at least one position needs a radius")
    blobs["radius"] = np.where(np.isnan(radius), np.nanmedian(radius), radius)
    blobs["length"], blobs["edge"] = blobs["radius"], 0.1 * blobs["radius"]
    blobs["contrast"] = 80.0  # contrast of a usual ball [DN], because a track states none
    times = column("time_s", otherwise=np.nan) / usual_step(clip.times)
    stamped = frame_steps(clip.times)[frames.astype(np.intp)]
    blobs, t = blobs[order], np.where(np.isnan(times), stamped, times)[order]
    names = table["flight"].iloc[order].reset_index(drop=True)
    flights = map(np.asarray, names.groupby(names).indices.values())  # "" is not a flight
    still = still_of(list(clip.samples[:1]), max(8, int(clip.full_scale).bit_length()))
    watched = Watched(still=still, blobs=blobs, change=np.full(clip.count, np.nan))
    long = [rows for rows in flights if len(rows) >= GROWTH.least_places]
    pieces = [Piece.of(blobs, rows, t[rows]) for rows in sorted(long, key=lambda rows: rows[0])]
    for one, other in pairwise(pieces):
        if other.frames[0] <= one.frames[-1]:
            allowed = "a flight must begin after the previous one has ended"
            raise InputError(str(path), f"flight at frame {other.frames[0]}", None, allowed)
    return watched, pieces
