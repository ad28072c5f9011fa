"""What `virtual-lab track` prints and the table it writes."""

from __future__ import annotations

import csv
from math import hypot
from pathlib import Path

import numpy as np

from virtual_lab.output.rounding import decimals, with_uncertainty
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.locate.located import Flag
from virtual_lab.video.track.speeds import Said, Speeds
from virtual_lab.video.track.tracking import Tracked

__all__ = ["plus_minus", "track_text", "write_table"]

COLUMNS = (
    "frame",
    "time_s",
    "x_px",
    "y_px",
    "x_u_px",
    "y_u_px",
    "radius_px",
    "x_m",
    "y_m",
    "chi_square",
    "flight",
    "flags",
)


def track_text(tracked: Tracked, found: Speeds) -> str:
    """Return the result in a few lines."""
    legs = tracked.legs
    lines = [
        f"{tracked.clip.source.path.name}: {tracked.clip.count} frames, the ball in "
        f"{len(tracked.frames)}, {int(legs.used_in.sum())} of them in, "
        f"{int(legs.used_out.sum())} out",
        _line("speed in", found.speed_in, "m/s"),
    ]
    if found.speed_out and found.angle_out:
        turned = (found.angle_out.value - found.angle_in.value) / DEGREE % 360
        turned_u = hypot(found.angle_out.u, found.angle_in.u) / DEGREE
        lines.append(_line("speed out", found.speed_out, "m/s"))
        if found.restitution:
            of = f"ratio of {found.restitution_of}"
            lines.append(_line("restitution", found.restitution, of))
        lines.append(_line("turned by", Said(value=turned, u=turned_u), "deg"))
    if found.contact_time:
        ms = Said(value=1e3 * found.contact_time.value, u=1e3 * found.contact_time.u)
        lines.append(_line("contact at", ms, "ms"))
    if found.flags:
        lines.append(f"  flags: {', '.join(found.flags)}")
    return "\n".join(lines + [f"  warning: {each}" for each in found.warnings])


def write_table(tracked: Tracked, path: Path) -> None:
    """Write the track as CSV, a row a frame that shows the ball."""
    located, legs = tracked.located, tracked.legs
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for k, frame in enumerate(tracked.frames):
            flight = "in" if legs.used_in[k] else "out" if legs.used_out[k] else ""
            numbers = (
                located.x[k],
                located.y[k],
                located.x_u[k],
                located.y_u[k],
                located.radius[k],
                *tracked.plane.places[k],
                located.chi_square[k],
            )
            writer.writerow(
                [int(frame), repr(float(tracked.times[k]))]
                + ["" if np.isnan(number) else f"{number:.7g}" for number in numbers]
                + [flight, "|".join(flag.name or "" for flag in Flag(int(located.flags[k])))]
            )


def plus_minus(said: Said) -> str:
    """Return ``0.9470 ± 0.0096``, with twice the standard uncertainty."""
    places = decimals(2 * said.u)
    return f"{said.value:.{places}f} ± {2 * said.u:.{places}f}"


def _line(name: str, said: Said, unit: str) -> str:
    mph = f", {miles_per_hour(said.value):.2f} mph" if unit == "m/s" else ""
    rounded = with_uncertainty(said.value, said.u)
    return f"  {name:12} {rounded} {unit}{mph}".rstrip()
