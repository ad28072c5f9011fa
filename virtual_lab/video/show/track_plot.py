"""The plot of a tracked clip: every ball in one picture, and how far each is off its line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import STYLE
from virtual_lab.video.show.track_text import plus_minus
from virtual_lab.video.track.lines import Flight
from virtual_lab.video.track.speeds import Speeds
from virtual_lab.video.track.tracking import Tracked

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_track", "strobe"]

INTO, OUT, LEFT = "#0072b2", "#d55e00", "0.45"
BALLS = 14  # drawn into one picture, about


def draw_track(tracked: Tracked, found: Speeds, path: Path) -> None:
    """Draw a tracked clip as PNG."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):
        rows, columns = tracked.clip.shape
        high = min(4.6, 7.2 * rows / columns)
        figure = Figure(figsize=(7.6, high + 3.4), dpi=150, layout="constrained")
        picture, along, across = figure.subplots(3, 1, height_ratios=(high, 1.3, 1.3))
        _picture(picture, tracked)
        _residuals(along, across, tracked)
        figure.suptitle(_title(tracked, found), fontsize=9)
        figure.savefig(path)


def strobe(tracked: Tracked) -> NDArray[np.float32]:
    """Return one picture that shows the ball at several of its places."""
    located = tracked.located
    known = np.flatnonzero(np.isfinite(located.radius))
    chosen = known[:: max(1, len(known) // BALLS)]
    # what stands about, the bat too, is shown as it is at the contact
    contact = known[np.argmin(np.abs(tracked.times[known] - tracked.legs.flight_in.time))]
    index = dict(zip(tracked.frames.tolist(), range(len(tracked.frames)), strict=True))
    rows, columns = np.ogrid[: tracked.clip.shape[0], : tracked.clip.shape[1]]
    whole = np.zeros(tracked.clip.shape, np.float32)
    balls = np.zeros(tracked.clip.shape, bool)
    for number, frame in tracked.clip.chosen(tracked.frames[np.union1d(chosen, [contact])]):
        k = index[number]
        if k == contact:
            whole = np.where(balls, whole, frame)
        if k in chosen:
            reach = located.radius[k] + np.hypot(located.blur_x[k], located.blur_y[k]) / 2 + 2
            inside = np.hypot(columns - located.x[k], rows - located.y[k]) < reach
            whole[inside], balls[inside] = frame[inside], True
    return whole


def _picture(axes: Axes, tracked: Tracked) -> None:
    axes.imshow(strobe(tracked), cmap="gray", interpolation="antialiased")
    located, legs = tracked.located, tracked.legs
    rest = ~legs.used_in & ~legs.used_out
    kinds = ((legs.used_in, INTO, "in"), (legs.used_out, OUT, "out"), (rest, LEFT, "left out"))
    for used, colour, name in kinds:
        if used.any():
            axes.plot(located.x[used], located.y[used], ".", color=colour, markersize=3, label=name)
    if legs.flight_out:
        known = np.isfinite(located.x) & np.isfinite(tracked.plane.places[:, 0])
        # the plane's metres back to pixels, near enough for a mark
        near = int(np.argmin(np.abs(np.where(known, tracked.times - legs.flight_in.time, np.inf))))
        off = (legs.flight_in.place - tracked.plane.places[near]) / tracked.plane.metres_per_pixel
        off = off * [1.0, tracked.plane.sense]
        axes.plot(
            located.x[near] + off[0],
            located.y[near] + off[1],
            "+",
            color="#009e73",
            markersize=11,
            markeredgewidth=1.5,
            label="contact",
        )
    axes.set(xlim=(-0.5, tracked.clip.shape[1] - 0.5), ylim=(tracked.clip.shape[0] - 0.5, -0.5))
    axes.set(xlabel="x, pixels", ylabel="y, pixels")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0),
        facecolor="white",
        framealpha=0.75,
        frameon=True,
        edgecolor="none",
        ncols=4,
        markerscale=2,
    )


def _residuals(along: Axes, across: Axes, tracked: Tracked) -> None:
    legs, scale = tracked.legs, tracked.plane.metres_per_pixel
    located = tracked.located
    origin = legs.flight_in.time
    for used, flight, colour in (
        (legs.used_in, legs.flight_in, INTO),
        (legs.used_out, legs.flight_out, OUT),
    ):
        if flight is None:
            continue
        t = 1e3 * (tracked.times[used] - origin)
        for axes, offset in zip((along, across), _turned(flight) / scale, strict=True):
            noise = (located.x_u + located.y_u)[used] / 2
            axes.errorbar(t, offset, noise, fmt=".", color=colour, markersize=4, linewidth=0.6)
    pattern = 0.0 if located.pattern_u is None else float(np.nanmedian(located.pattern_u))
    for axes, name in ((along, "along"), (across, "across")):
        axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        if pattern:
            axes.axhspan(-pattern, pattern, color="0.9", zorder=-1, linewidth=0)
        if legs.flight_out:
            axes.axvline(0, color="#009e73", linewidth=0.8, zorder=0)
        axes.set_ylabel(f"off the line\n{name}, pixels")
        axes.grid(True, linewidth=0.3)
    along.tick_params(labelbottom=False)
    across.set_xlabel(
        "time from the contact, ms" if legs.flight_out else "time to the last frame, ms"
    )


def _turned(flight: Flight) -> Any:
    """Return residuals along and across a flight, (2, frame) [m]."""
    cos, sin = flight.velocity / flight.speed
    return np.array([[cos, sin], [-sin, cos]]) @ flight.residuals.T


def _title(tracked: Tracked, found: Speeds) -> str:
    parts = [f"in {plus_minus(found.speed_in)} m/s"]
    if found.speed_out:
        parts.append(f"out {plus_minus(found.speed_out)} m/s")
    if found.restitution:
        parts.append(f"ratio {plus_minus(found.restitution)}")
    return f"{tracked.clip.source.path.name}: {', '.join(parts)} (k = 2)"
