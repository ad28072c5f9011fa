"""The picture of a calibration: what the lens leaves of every corner, over the picture."""

from __future__ import annotations

from math import floor, log10
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.output.style import STYLE
from virtual_lab.video.calibration.calibrating import Calibrated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_calibration"]

ARROW = 0.02  # of the picture's width: how long the rms residual is drawn
DOTS = 1200  # residuals whose dots still tell apart
INK, PLANE = "#0072b2", "#d55e00"


def draw_calibration(found: Calibrated, path: Path) -> None:
    """Draw a calibration's residuals as PNG."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):
        wide, high = found.model.image_size
        tall = min(4.6, 5.2 * high / wide)
        figure = Figure(figsize=(7.6, tall + 2.3), dpi=150, layout="constrained")
        over, below = figure.subplots(2, 1, height_ratios=(tall, 1.7))
        inset, views = below.get_subplotspec().subgridspec(1, 2, width_ratios=(1, 2.6)).subplots()
        below.remove()
        _over_picture(over, found)
        _scatter(inset, found)
        _by_view(views, found)
        figure.savefig(path)


def _over_picture(axes: Axes, found: Calibrated) -> None:
    solved = found.solved
    wide, high = found.model.image_size
    times = _round(ARROW * wide / solved.rms) if solved.rms else 1.0
    x, y = solved.places.T
    right, down = times * solved.residuals.T
    own = solved.view == found.plane
    for some, colour, name in ((~own, INK, "other views"), (own, PLANE, "plane view")):
        axes.quiver(
            x[some],
            y[some],
            right[some],
            down[some],
            color=colour,
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.0012,
            headwidth=4,
            label=name,
        )
    axes.set(xlim=(-0.5, wide - 0.5), ylim=(high - 0.5, -0.5), aspect="equal")
    axes.set(xlabel="x, pixels", ylabel="y, pixels")
    axes.set_title(f"what the lens leaves of each corner, drawn {times:.0f} times as long", pad=16)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2, borderpad=0, handlelength=1.4)


def _round(number: float) -> float:
    """Return the 1, 2 or 5 with zeros next below a number above 1."""
    power = 10.0 ** floor(log10(number))
    return max(power * digit for digit in (1, 2, 5) if power * digit <= number)


def _scatter(axes: Axes, found: Calibrated) -> None:
    solved = found.solved
    every = max(1, len(solved.residuals) // DOTS)
    axes.plot(*solved.residuals[::every].T, ".", color=INK, markersize=2)
    reach = 1.1 * float(np.abs(solved.residuals).max())
    axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
    axes.axvline(0, color="0.6", linewidth=0.6, zorder=0)
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    axes.set(xlabel="residual, pixels")
    axes.locator_params(nbins=4)


def _by_view(axes: Axes, found: Calibrated) -> None:
    rms = found.solved.view_rms
    number = np.arange(len(rms))
    axes.bar(number, rms, color=[PLANE if n == found.plane else INK for n in number], width=0.7)
    axes.axhline(found.solved.rms, color="0.3", linewidth=0.8, linestyle="--")
    axes.set(xlabel="picture", ylabel="rms each way, pixels")
    axes.set_xticks(number)
    labels = [Path(name).stem for name in found.views]
    axes.set_xticklabels(labels, rotation=0 if max(map(len, labels)) < 5 else 45, ha="right")
