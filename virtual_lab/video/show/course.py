"""A ball's course through a clip, place by place: what is drawn and written of any clip."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.locate.located import PlaceFlag

# one record per place, in the still frame; NaN: unknown
Places = NDArray[np.void]
WRITTEN = {  # columns of track.csv
    "frame": int,
    **dict.fromkeys(("time_s", "x_px", "y_px", "x_u_px", "y_u_px", "radius_px"), float),
    **dict.fromkeys(("x_m", "y_m", "chi_square"), float),
    "flight": "U8",  # its number, "" outside of flights
    "flags": "U64",
    **dict.fromkeys(("drift_x_px", "drift_y_px", "right_mps", "up_mps"), float),
}
# deviation of a place from its flight, and distance from its middle to its blur's end
DRAWN = dict.fromkeys(("along_px", "across_px", "reach_px"), float)
PLACE = np.dtype([*WRITTEN.items(), *DRAWN.items()])


def course_of(found: FollowedClip) -> Places:
    """Return the course of a ball: its flights, else all its pieces, else some frames."""
    clip, sharp, ways = found.clip, found.sharp, found.ways or found.pieces
    known: dict[str, Any]
    if sharp:
        at = sharp.located
        known = {
            "frame": sharp.frames,
            "x_px": at.x,
            "y_px": at.y,
            "x_u_px": at.x_u,
            "y_u_px": at.y_u,
            "radius_px": at.radius,
            "reach_px": at.radius + np.hypot(at.blur_x, at.blur_y) / 2,
            "chi_square": at.chi_square,
            "x_m": sharp.plane.places[:, 0],
            "y_m": sharp.plane.places[:, 1],
            "flags": ["|".join(str(e.name) for e in PlaceFlag(int(own))) for own in at.flags],
        }
    elif ways:
        blobs = found.watched.found[np.concatenate([way.blobs for way in ways])]
        unit = found.scale.metres_per_pixel if found.scale else np.nan
        u = found.fit.spread if found.fit else np.nan
        known = {
            "frame": np.concatenate([way.frames for way in ways]),
            "time_s": found.seconds * np.concatenate([way.t for way in ways]),
            # mean of the half axes, as used for the scale
            "radius_px": (blobs["radius"] + blobs["length"]) / 2,
            "reach_px": blobs["length"],
        }
        for axis in "xy":
            known |= {f"{axis}_px": blobs[axis], f"{axis}_u_px": u, f"{axis}_m": unit * blobs[axis]}
            known[f"drift_{axis}_px"] = blobs[f"picture_{axis}"] - blobs[axis]
    else:
        known = {"frame": np.unique(np.linspace(0, clip.count - 1, 12).astype(np.intp))}
    places = np.zeros(len(known["frame"]), PLACE)
    known = {"time_s": clip.times[known["frame"]], "drift_x_px": 0.0, "drift_y_px": 0.0} | known
    for name, kind in (WRITTEN | DRAWN).items():
        places[name] = known.get(name, np.nan if kind is float else "")
    places = places[np.argsort(places["frame"], kind="stable")]
    if found.fit and found.scale:
        for k, way in enumerate(found.ways):
            own, states = np.isin(places["frame"], way.frames), found.fit.at(k, way.t)
            middle = states[len(way.t) // 2, 2:]
            right, down = middle / max(float(np.hypot(*middle)), 1e-12)
            speeds = found.scale.metres_per_pixel / found.seconds * states[:, 2:]
            places["flight"][own] = str(k + 1)
            places["along_px"][own] = found.fit.residuals[k] @ [right, down]
            places["across_px"][own] = found.fit.residuals[k] @ [-down, right]
            places["right_mps"][own], places["up_mps"][own] = speeds.T * [[1], [-1]]
    return places


def course_rows(places: Places) -> list[dict[str, Any]]:
    """Return the rows of track.csv, one per position that is known or flagged."""
    shown = places[np.isfinite(places["x_px"]) | (places["flags"] != "")]
    return [dict(zip(WRITTEN, row, strict=True)) for row in shown[[*WRITTEN]].tolist()]


def spots(places: Places) -> Array:
    """Return the positions in the still frame, (place, 2) [pixels]."""
    return np.stack([places["x_px"], places["y_px"]], axis=1)


def names_of(places: Places) -> list[str]:
    """Names of flights, in order."""
    return [each for each in dict.fromkeys(places["flight"].tolist()) if each]
