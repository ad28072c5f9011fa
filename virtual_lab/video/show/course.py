"""A ball's course through a clip, place by place: what is drawn and written of any clip."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.locate.located import PlaceFlag

# a record a place, in the still frame; NaN: not known
Places = NDArray[np.void]
FIRST = ("time_s", "x_px", "y_px", "x_u_px", "y_u_px", "radius_px", "x_m", "y_m", "chi_square")
LAST = ("drift_x_px", "drift_y_px", "right_mps", "up_mps")
DRAWN = ("along_px", "across_px", "reach_px")  # off its flight; from its middle to its blur's end
NUMBERS = (*FIRST, *LAST, *DRAWN)
WORDS = {"flight": "U8", "flags": "U64"}  # number, "" outside of flights
PLACE = np.dtype([("frame", int), *WORDS.items(), *((name, float) for name in NUMBERS)])
WRITTEN = ("frame", *FIRST, *WORDS, *LAST)  # columns of track.csv


def course_of(found: FollowedClip) -> Places:
    """Course of a ball: of its flights, else of all its pieces, else some frames to look at."""
    clip, sharp, ways = found.clip, found.sharp, found.ways or found.pieces
    if sharp:
        frames = sharp.frames
    elif ways:
        frames = np.concatenate([way.frames for way in ways])
    else:
        frames = np.unique(np.linspace(0, clip.count - 1, 12).astype(np.intp))
    places = np.zeros(len(frames), PLACE)
    for name in NUMBERS:
        places[name] = np.nan
    places["frame"], places["time_s"] = frames, clip.times[frames]
    places["drift_x_px"], places["drift_y_px"] = 0.0, 0.0
    if sharp:
        located = sharp.located
        for name, values in (
            ("x_px", located.x),
            ("y_px", located.y),
            ("x_u_px", located.x_u),
            ("y_u_px", located.y_u),
            ("radius_px", located.radius),
            ("chi_square", located.chi_square),
        ):
            places[name] = values
        places["x_m"], places["y_m"] = sharp.plane.places.T
        places["reach_px"] = located.radius + np.hypot(located.blur_x, located.blur_y) / 2
        flags = ["|".join(str(e.name) for e in PlaceFlag(int(own))) for own in located.flags]
        places["flags"] = flags
    elif ways:
        some = found.watched.found[np.concatenate([way.blobs for way in ways])]
        places["time_s"] = found.seconds * np.concatenate([way.t for way in ways])
        for axis in "xy":
            places[f"{axis}_px"] = some[axis]
            places[f"{axis}_u_px"] = found.fit.spread if found.fit else np.nan
            places[f"{axis}_m"] = some[axis] * (
                found.scale.metres_per_pixel if found.scale else np.nan
            )
            places[f"drift_{axis}_px"] = some[f"picture_{axis}"] - some[axis]
        places["radius_px"] = (some["radius"] + some["length"]) / 2  # as the scale takes it
        places["reach_px"] = some["length"]
    places = places[np.argsort(places["frame"], kind="stable")]
    if found.fit and found.scale:
        for k, way in enumerate(found.ways):
            own, states = np.isin(places["frame"], way.frames), found.fit.at(k, way.t)
            places["flight"][own] = str(k + 1)
            middle = states[len(way.t) // 2, 2:]
            along = middle / max(float(np.hypot(*middle)), 1e-12)
            off = found.fit.residuals[k]
            places["along_px"][own] = off @ along
            places["across_px"][own] = off @ [-along[1], along[0]]
            speeds = found.scale.metres_per_pixel / found.seconds * states[:, 2:]
            places["right_mps"][own], places["up_mps"][own] = speeds.T * [[1], [-1]]
    return places


def course_rows(places: Places) -> list[dict[str, Any]]:
    """Rows of track.csv, one a place that is known or flagged."""
    shown = places[np.isfinite(places["x_px"]) | (places["flags"] != "")]
    return [dict(zip(WRITTEN, row, strict=True)) for row in shown[list(WRITTEN)].tolist()]


def spots(places: Places) -> Array:
    """Places in the still frame, (place, 2) [pixels]."""
    return np.stack([places["x_px"], places["y_px"]], axis=1)


def names_of(places: Places) -> list[str]:
    """Names of flights, in order."""
    return [each for each in dict.fromkeys(places["flight"].tolist()) if each]
