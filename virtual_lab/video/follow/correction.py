"""Import of a track that was written as CSV and corrected by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import read_table
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.columns import numbers_in
from virtual_lab.video.find.blobs import BLOB, Blobs
from virtual_lab.video.follow.pieces import GROWTH, Piece
from virtual_lab.video.follow.searching import FlightsFound

PLACE = ["frame", "x", "y", "picture_x", "picture_y"]  # fields of a blob that a row states


def read_track(path: Path, clip: Clip) -> list[Blobs]:
    """Return the positions of each flight in a track file, as blobs.

    The required columns are:

    * frame: number of the frame.
    * x_px, y_px: position after the drift of the camera is removed.
    * flight: name of the flight; empty for a position outside flights.

    The optional columns are:

    * radius_px: radius of the ball. The default is the median of the other rows.
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
    rows = np.zeros(len(table), BLOB)
    rows["frame"] = frames
    for name in ("x", "y"):
        rows[name] = column(f"{name}_px")
        rows[f"picture_{name}"] = rows[name] + column(f"drift_{name}_px", otherwise=0.0)
    radius = column("radius_px", otherwise=np.nan)
    if not (least := float(np.fmin.reduce(radius))) > 0:
        raise InputError(str(path), "radius_px", least, "allowed: above 0; empty in some rows")
    rows["radius"] = np.where(np.isnan(radius), np.nanmedian(radius), radius)
    # edge and contrast [DN] of a usual ball, if the clip shows none
    rows["length"], rows["edge"], rows["contrast"] = rows["radius"], 0.1 * rows["radius"], 80.0
    names = table["flight"].iloc[order].reset_index(drop=True)
    named = map(np.asarray, names.groupby(names).indices.values())  # "" is not a flight
    flights = [rows[order][each] for each in named if len(each) >= GROWTH.least_places]
    flights.sort(key=lambda each: each["frame"][0])
    for one, other in pairwise(flights):
        if other["frame"][0] <= one["frame"][-1]:
            allowed = "a flight must begin after the previous one has ended"
            raise InputError(str(path), f"flight at frame {other['frame'][0]}", None, allowed)
    return flights


def require_moving_object(blobs: Blobs, flights: Sequence[Blobs]) -> None:
    """Raise `InputError` if no position by hand is within a radius of an object that moves.

    The positions are then those of another clip: in eight pairs of clips none was on such an
    object, but at least 95 % of those of the same clip. `blobs` are all objects that move in the
    clip.
    """
    rows = np.concatenate([blobs[:0], *flights])
    right, down, late = (np.subtract.outer(rows[n], blobs[n]) for n in (*PLACE[3:], "frame"))
    near = (np.hypot(right, down) < rows["radius"][:, None]) & (late == 0)
    if not near.any():
        words = f"none of its {len(rows)} positions in flights (5 or more) is on a moving object"
        raise InputError("", "{corrected}", None, f"{words}; allowed: a track of this clip")


def apply_correction(result: FlightsFound, flights: list[Blobs]) -> FlightsFound:
    """Return the flights with positions and sizes that were set by hand.

    The clip shows the other properties: missing frames, edge, contrast, color and axes of the ball,
    and the u of its positions. They are those of the tracked ball in the same frame or, where it
    was not tracked, in the nearest one.

    Parameters
    ----------
    result
        Flights of the clip without a correction.
    flights
        Flights by hand, from `read_track`.
    """
    every, scene, ways = result.scene.blobs, result.scene, []
    counted = np.flatnonzero(np.isfinite(scene.time))
    time = np.interp(np.arange(len(scene.time)), counted, scene.time[counted])
    balls = [every[way.blobs] for way in result.ways] or flights
    tracked = np.concatenate([every[:0], *balls])
    lost = np.concatenate([way.t - time[way.frames] for way in result.ways] or [0 * tracked["x"]])
    for rows in flights:
        frames = rows["frame"]
        nearest = np.abs(np.subtract.outer(frames, tracked["frame"])).argmin(axis=1)
        ball = tracked[nearest]
        larger = (rows["radius"] + rows["length"]) / (ball["radius"] + ball["length"])
        for name in ("radius", "length", "edge"):
            ball[name] *= larger
        ball[PLACE] = rows[PLACE]
        places, every = len(every) + np.arange(len(ball)), np.concatenate([every, ball])
        way = Piece.of(every, places, time[frames] + lost[nearest])
        same = [each.pattern_u for each in result.ways if np.isin(each.frames, frames).any()]
        ways.append(replace(way, pattern_u=max([way.pattern_u, *same])))
    return replace(result, scene=replace(scene, blobs=every), ways=ways)
