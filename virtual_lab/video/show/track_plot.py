"""The plot of a tracked clip: every ball in one picture, and how far each is off its flight."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import STYLE
from virtual_lab.video.show.course import Course
from virtual_lab.video.show.track_film import Pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_track", "strobe"]

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
LEFT = "0.45"
BALLS = 14  # drawn into one picture, about


def draw_track(course: Course, pictures: Pictures, title: str, path: Path) -> None:
    """Draw a tracked clip as PNG."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):
        rows, columns = course.clip.shape
        high = min(6.0, 7.2 * rows / columns)
        figure = Figure(figsize=(7.6, high + 3.4), dpi=150, layout="constrained")
        picture, along, across = figure.subplots(3, 1, height_ratios=(high, 1.3, 1.3))
        _picture(picture, course, pictures)
        _residuals(along, across, course)
        figure.suptitle(title, fontsize=9)
        figure.savefig(path)


def strobe(course: Course, pictures: Pictures) -> NDArray[np.uint8]:
    """Return one picture that shows the ball at several of its places, as small as they are."""
    shown = [k for k in range(len(course.frames)) if int(course.frames[k]) in pictures.frames]
    seen = [k for k in shown if np.isfinite(course.radius[k])]
    chosen = seen[:: max(1, len(seen) // BALLS)]
    scale = pictures.scale
    # what stands about, a bat too, is shown as it is at a contact
    time = course.contacts[0][0] if course.contacts else float(course.times[0])
    stands = min(shown, key=lambda k: abs(course.times[k] - time))
    whole = _still(pictures, course, stands).copy()
    rows, columns = np.ogrid[: whole.shape[0], : whole.shape[1]]
    for k in chosen:
        x, y = (course.xy[k] + 0.5) * scale - 0.5
        inside = np.hypot(columns - x, rows - y) < (course.reach[k] + 2) * scale
        whole[inside] = _still(pictures, course, k)[inside]
    return whole[..., ::-1]


def _still(pictures: Pictures, course: Course, k: int) -> NDArray[np.uint8]:
    """Return a picture where the still frame has it."""
    import cv2

    picture = pictures.frames[int(course.frames[k])]
    if not course.drift[k].any():
        return picture
    x, y = course.drift[k] * pictures.scale
    back = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
    size, flags = picture.shape[1::-1], cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    mode = cv2.BORDER_REPLICATE
    return np.asarray(cv2.warpAffine(picture, back, size, flags=flags, borderMode=mode), np.uint8)


def _picture(axes: Axes, course: Course, pictures: Pictures) -> None:
    rows, columns = course.clip.shape
    extent = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(strobe(course, pictures), extent=extent, interpolation="antialiased")
    names = course.flights
    for k, name in enumerate([*names, ""]):
        used = course.of(name)
        if used.any():
            colour = COLOURS[k % len(COLOURS)] if name else LEFT
            label = name or ("left out" if names else "seen")
            axes.plot(*course.xy[used].T, ".", color=colour, markersize=3, label=label)
    for k, (_, x, y) in enumerate(course.contacts):
        mark = "contact" if k == 0 else None
        axes.plot(x, y, "+", color="k", markersize=11, markeredgewidth=1.2, label=mark)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    axes.set(xlabel="x, pixels", ylabel="y, pixels")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0) if columns > rows else (1.02, 1.0),
        facecolor="white",
        framealpha=0.75,
        frameon=True,
        edgecolor="none",
        ncols=5 if columns > rows else 1,
        markerscale=2,
    )


def _residuals(along: Axes, across: Axes, course: Course) -> None:
    origin = course.contacts[0][0] if course.contacts else float(course.times[0])
    for k, name in enumerate(course.flights):
        used = course.of(name)
        t = 1e3 * (course.times[used] - origin)
        noise = course.u[used].mean(axis=1)
        for axes, off in zip((along, across), course.residuals[used].T, strict=True):
            colour = COLOURS[k % len(COLOURS)]
            axes.errorbar(t, off, noise, fmt=".", color=colour, markersize=4, linewidth=0.6)
    for axes, name in ((along, "along"), (across, "across")):
        axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        for time, _, _ in course.contacts:
            axes.axvline(1e3 * (time - origin), color="k", linewidth=0.8, zorder=0)
        axes.set_ylabel(f"off the flight\n{name}, pixels")
        axes.grid(True, linewidth=0.3)
    along.tick_params(labelbottom=False)
    across.set_xlabel(f"time from the {'first contact' if course.contacts else 'start'}, ms")
