"""The picture of the collision rungs: error over time, a panel a question, a mark a series."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "COLLISION_TITLE",
    "COLLISION_WORDS",
    "ELEMENTS",
    "IN_ALL",
    "MODES",
    "REFERENCE",
    "RIGID",
    "SCIPY",
    "SOLVING",
    "STEPS",
    "SURROGATE",
    "draw_collision",
]

RIGID = "rigid"
SURROGATE = "surrogate of the default"
MODES = "modal, by number of modes"
ELEMENTS = "modal, by degree of the elements"
REFERENCE = "reference"
STEPS = "ours"
SCIPY = "solve_ivp"
IN_ALL = "120 modes, one by one"
SOLVING = "the same 20 modes, solved finer"
PANELS = {
    IN_ALL: "error of the rung, against 120 modes",
    SOLVING: "error of solving alone, same 20 modes",
}
COLLISION_TITLE = "Collision: accuracy over cost, R161, 2 to 12 in, 60 to 160 mph"
COLLISION_WORDS = (
    "Worst error in e_A over the time a shot takes on one core. Left, what a rung errs by in all, "
    "against 120 modes stepped one by one; right, what solving the equations adds to that, against "
    "the same 20 modes stepped one by one four times finer. The dashed line decides: the cheapest "
    "rung below it is taken, a tenth of the u of e_A that a certificate reaches. A red ring marks "
    "what is off by more than that u somewhere along the bat, from tip to knob, and does not say "
    "so; a dotted one what refuses to answer somewhere."
)
MARKS = {  # marker, colour
    RIGID: ("s", "black"),
    SURROGATE: ("d", "#009e73"),
    MODES: ("o", "#0072b2"),
    ELEMENTS: ("v", "#cc79a7"),
    REFERENCE: ("P", "#5e3c99"),
    STEPS: ("^", "#d55e00"),
    SCIPY: ("X", "#666666"),
}
RINGS = {  # colour, line, words
    "off_along_the_bat": ("#c00000", "solid", "off by more than u elsewhere on the bat"),
    "refused_along_the_bat": ("#e69f00", "dotted", "refuses elsewhere on the bat"),
}
SIDES = (  # where a label may stand: offset in points, alignments
    (8, 0, "left", "center"),
    (8, 7, "left", "center"),
    (8, -7, "left", "center"),
    (-8, 0, "right", "center"),
    (-8, 7, "right", "center"),
    (-8, -7, "right", "center"),
    (0, 10, "center", "bottom"),
    (0, -10, "center", "top"),
    (8, -15, "left", "center"),
    (-8, -15, "right", "center"),
    (8, 15, "left", "center"),
    (-8, 15, "right", "center"),
)
PIECES = 60  # of a line between two points, closer than a word is long


def draw_collision(rows: list[dict[str, Any]]) -> Figure:
    """Return the figure of rows as `collision_chart.measure` gives them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 5.8), dpi=150, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(PANELS))
    for (name, title), axes, end in zip(PANELS.items(), panels, ("right", "left"), strict=True):
        _panel(axes, [row for row in rows if row["held_against"] == name], end)
        axes.set_title(title, fontsize=10)
    panels[0].set_ylabel("worst error in $e_A$")
    figure.legend(loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    figure.suptitle(COLLISION_TITLE, fontsize=11)
    canvas.draw()  # settles the layout, which labels go by
    for name, axes in zip(PANELS, panels, strict=True):
        own = [row for row in rows if row["held_against"] == name]
        _label(axes, own, canvas.get_renderer())
    return figure


def _panel(axes: Any, rows: list[dict[str, Any]], end: str) -> None:
    """Draw the points, rings about what fails, and the line that decides, named at an `end`."""
    from virtual_lab.lab.laboratory import EFFICIENCY_U
    from virtual_lab.simulation.collision.ladder import SHARE

    for series, (marker, colour) in MARKS.items():
        own = [row for row in rows if row["series"] == series]
        if not own:
            continue
        times, errors = zip(*((r["us_a_shot"], r["worst_error"]) for r in own), strict=True)
        width = 0 if series == SCIPY else 1  # no series: each is a method of its own
        axes.loglog(times, errors, marker=marker, color=colour, linewidth=width, label=series)
    for key, (ring, style, words) in RINGS.items():
        own = [row for row in rows if row[key]]
        axes.scatter(
            [row["us_a_shot"] for row in own],
            [row["worst_error"] for row in own],
            s=110,
            linewidths=1.4,
            zorder=3,
            facecolors="none",
            edgecolors=ring,
            linestyles=style,
            label=words if own and axes.get_subplotspec().is_first_col() else None,
        )
    decides = SHARE * EFFICIENCY_U
    axes.axhline(decides, color="0.3", linestyle="--", linewidth=1)
    axes.annotate(
        f"what decides: u / 10 = {decides:.0e}",
        (end == "right", decides),
        xycoords=("axes fraction", "data"),
        xytext=(-4 if end == "right" else 4, 3),
        textcoords="offset points",
        ha=end,
        fontsize=7.5,
        color="0.3",
    )
    axes.margins(x=0.22, y=0.1)
    axes.set_xlabel("time a shot, one core [µs]")
    axes.grid(True, which="major", linewidth=0.3)


def _pieces(line: Any) -> list[Any]:
    """Return small boxes [px] along a line that is drawn."""
    from matplotlib.transforms import Bbox

    if not line.get_linewidth():
        return []
    corners = line.get_transform().transform(line.get_xydata())
    steps = np.linspace(0.0, 1.0, PIECES)[:, None]
    return [
        Bbox.from_bounds(x - 1, y - 1, 2, 2)
        for start, end in pairwise(corners)
        for x, y in start + steps * (end - start)
    ]


def _label(axes: Any, rows: list[dict[str, Any]], renderer: Any) -> None:
    """Write each point's setting where it covers no mark, line or word, inside the panel."""
    from matplotlib.transforms import Bbox

    points = axes.transData.transform([(row["us_a_shot"], row["worst_error"]) for row in rows])
    half = 5.0 * axes.figure.dpi / 72  # of a mark [px]
    taken = [Bbox.from_bounds(x - half, y - half, 2 * half, 2 * half) for x, y in points]
    taken += [text.get_window_extent(renderer) for text in axes.texts]
    taken += [piece for line in axes.lines for piece in _pieces(line)]
    left, right = axes.get_window_extent(renderer).intervalx
    for row in rows:
        best: tuple[int, Any] | None = None
        for x, y, horizontal, vertical in SIDES:
            label = axes.annotate(
                row["setting"],
                (row["us_a_shot"], row["worst_error"]),
                xytext=(x, y),
                textcoords="offset points",
                ha=horizontal,
                va=vertical,
                fontsize=6.5,
                color=MARKS[row["series"]][1],
            )
            box = label.get_window_extent(renderer)
            hidden = box.count_overlaps(taken) + (not left < box.x0 < box.x1 < right)
            if best is None or hidden < best[0]:
                if best:
                    best[1].remove()
                best = hidden, label
            else:
                label.remove()
            if not best[0]:
                break
        if best:
            taken.append(best[1].get_window_extent(renderer))
