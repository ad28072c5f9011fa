"""The bat's angle through a clip: picture and table."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.output.style import STYLE
from virtual_lab.video.bat.clip import BatSeen

__all__ = ["bat_text", "draw_bat", "write_bat_table"]

REST, TURN = "#0072b2", "#d55e00"
MILLI = 1e3


def bat_text(found: BatSeen) -> str:
    """Return the recoil in a line."""
    rate = with_uncertainty(found.recoil.rate.value, found.recoil.rate.u)
    return f"  {'bat recoil':12} {rate} rad/s, {found.recoil.frames} frames"


def write_bat_table(found: BatSeen, path: Path) -> None:
    """Write the bat's angles as CSV, a row a frame that shows it."""
    angles = found.angles
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "time_s", "angle_rad", "u_rad", "points"])
        for k in np.flatnonzero(np.isfinite(angles.angle)):
            numbers = [f"{angles.angle[k]:.9g}", f"{angles.u[k]:.3g}", int(angles.points[k])]
            writer.writerow([int(k), repr(float(found.times[k])), *numbers])


def draw_bat(found: BatSeen, path: Path) -> None:
    """Draw angles and what rest and recoil leave of them as PNG."""
    from matplotlib import style
    from matplotlib.figure import Figure

    recoil, angles = found.recoil, found.angles
    turning = np.maximum(found.times - recoil.contact.value, 0.0)
    line = recoil.rest + recoil.rate.value * turning
    since = MILLI * (found.times - recoil.contact.value)
    seen = np.isfinite(angles.angle)
    after = found.times > recoil.contact.value
    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(7.6, 4.2), dpi=150, layout="constrained")
        over, below = figure.subplots(2, 1, height_ratios=(2, 1.2), sharex=True)
        over.plot(since, MILLI * line, color="0.3", linewidth=0.8)
        for some, colour, name in (
            (seen & ~after, REST, "at rest"),
            (seen & after, TURN, "after contact"),
        ):
            over.plot(since[some], MILLI * angles.angle[some], ".", color=colour, label=name)
            off = MILLI * MILLI * (angles.angle - line)[some]
            u = MILLI * MILLI * angles.u[some]
            below.errorbar(since[some], off, u, fmt=".", color=colour, markersize=4, linewidth=0.6)
        below.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        over.set(ylabel="angle, mrad", title=bat_text(found).strip())
        over.legend(loc="lower left" if recoil.rate.value < 0 else "upper left")
        below.set(xlabel="time from the turn's begin, ms", ylabel="off the line, µrad")
        figure.savefig(path)
