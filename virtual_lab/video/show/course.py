"""The course of a ball through a clip, one record per position, for figures and track.csv."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.follow.models import positions_off
from virtual_lab.video.locate.located import PlaceFlag

if TYPE_CHECKING:
    import pandas as pd

# one record per position, in the still frame; NaN: unknown
Places = NDArray[np.void]
WRITTEN = {  # columns of track.csv
    "frame": int,
    **dict.fromkeys(("time_s", "x_px", "y_px", "x_u_px", "y_u_px", "radius_px"), float),
    **dict.fromkeys(("x_m", "y_m", "chi_square"), float),
    "flight": "U8",  # number of the flight, "" outside flights
    "flag_names": "U64",
    **dict.fromkeys(("drift_x_px", "drift_y_px", "right_m_per_s", "up_m_per_s"), float),
}
# deviation of a position from its flight, distance from its middle to the end of its blur, and
# whether it is far from its flight
DRAWN = dict.fromkeys(("along_px", "across_px", "reach_px", "far"), float)
PLACE = np.dtype([*WRITTEN.items(), *DRAWN.items()])


def course_of(track: FollowedClip) -> Places:
    """Return one record of the type `PLACE` per position of the ball, in the order of frames.

    The track may hold three kinds of positions. The best kind that it holds is used for all frames:

    * sharp positions, located by the outline of the ball
    * positions of the flights
    * positions of all pieces of smooth motion

    If the track holds none, the result has up to 12 evenly spaced frames of the clip with the
    position NaN.
    """
    clip, sharp, ways = track.clip, track.sharp, track.ways or track.pieces
    unit = track.scale.metres_per_pixel if track.scale else np.nan
    values: dict[str, Any] = {"drift_x_px": 0.0, "drift_y_px": 0.0}
    if sharp:
        at, frames = sharp.located, sharp.frames
        for axis in "xy":
            values |= {f"{axis}_px": getattr(at, axis), f"{axis}_u_px": getattr(at, f"{axis}_u")}
        values["x_m"], values["y_m"] = sharp.plane.places.T
        values["radius_px"], values["chi_square"] = at.radius, at.chi_square
        values["reach_px"] = at.radius + np.hypot(at.blur_x, at.blur_y) / 2
        names = [[str(flag.name) for flag in PlaceFlag(int(each))] for each in at.flags]
        values["flag_names"] = [" ".join(each) for each in names]
    elif ways:
        blobs = track.scene.blobs[np.concatenate([way.blobs for way in ways])]
        frames = blobs["frame"]
        values["time_s"] = track.seconds * np.concatenate([way.t for way in ways])
        # mean of the half axes, which is also used for the scale
        values["radius_px"] = (blobs["radius"] + blobs["length"]) / 2
        values["reach_px"] = blobs["length"]
        for axis in "xy":
            values |= {f"{axis}_px": blobs[axis], f"{axis}_m": unit * blobs[axis]}
            values[f"{axis}_u_px"] = track.fit.spread if track.fit else np.nan
            values[f"drift_{axis}_px"] = blobs[f"picture_{axis}"] - blobs[axis]
    else:
        frames = np.unique(np.linspace(0, clip.count - 1, 12).astype(np.intp))
    places = np.zeros(len(frames), PLACE)
    values = {"frame": frames, "time_s": clip.times[frames]} | values
    for name, kind in (WRITTEN | DRAWN).items():
        places[name] = values.get(name, np.nan if kind is float else "")
    places = places[np.argsort(places["frame"], kind="stable")]
    if track.fit and track.scale:
        for k, way in enumerate(track.ways):
            rows = np.isin(places["frame"], way.frames)
            states = track.fit.at(k, way.t + track.fit.readout * track.scene.late(way.blobs))
            middle = states[len(way.t) // 2, 2:]
            right, down = middle / max(float(np.hypot(*middle)), 1e-12)
            speeds = unit / track.seconds * states[:, 2:]
            places["flight"][rows] = str(k + 1)
            places["far"][rows] = positions_off(track.ways, track.fit)[k]
            places["along_px"][rows] = track.fit.residuals[k] @ [right, down]
            places["across_px"][rows] = track.fit.residuals[k] @ [-down, right]
            places["right_m_per_s"][rows], places["up_m_per_s"][rows] = speeds.T * [[1], [-1]]
            if not sharp:  # in the plane of the speeds, not in the picture
                flown = unit * track.fit.in_plane(way.xy)
                places["x_m"][rows], places["y_m"][rows] = flown.T
    return places


def course_table(places: Places) -> pd.DataFrame:
    """Return the table of the file track.csv, with one row per position.

    Positions that are unknown and have no flag are left out.
    """
    import pandas as pd

    rows = places[np.isfinite(places["x_px"]) | (places["flag_names"] != "")]
    return pd.DataFrame(rows[[*WRITTEN]])


def spots(places: Places) -> Array:
    """Return the ball's positions without camera drift, (position, 2) [pixels]; NaN if unknown."""
    return np.stack([places["x_px"], places["y_px"]], axis=1)


def names_of(places: Places) -> list[str]:
    """Return the names of the flights in order, one per flight: "1", "2" and so on."""
    return [each for each in dict.fromkeys(places["flight"].tolist()) if each]
