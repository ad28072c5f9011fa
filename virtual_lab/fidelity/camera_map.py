"""The picture of where the ways of locating a ball hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FLAGGED", "GOOD", "INACCURATE", "LOST", "MARKS", "UNSAID", "draw_maps"]

GOOD, INACCURATE, FLAGGED, LOST = "good", "inaccurate, and says so", "flagged", "lost"
UNSAID = "wrong, unsaid"
MARKS = {GOOD: ".", INACCURATE: "o", FLAGGED: "F", LOST: "-", UNSAID: "X"}
COLOURS = {
    GOOD: "#6baed6",
    INACCURATE: "#fee391",
    FLAGGED: "#f16913",
    LOST: "#bdbdbd",
    UNSAID: "#800026",
}
COLUMNS = 4
TITLE = (
    "Locating the ball: what each picture comes to; numbers: pictures of a cell wrong and unsaid"
)


def draw_maps(rows: list[dict[str, Any]], summary: str) -> Figure:
    """Return the figure of rows as `camera_stability.measure` gives them."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    axes_of = list(dict.fromkeys(row["map"] for row in rows))
    lines = -(-len(axes_of) // COLUMNS)
    figure = Figure(figsize=(16, 3.1 * lines + 1), dpi=120, layout="constrained")
    panels = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for panel in panels[len(axes_of) :]:
        panel.set_axis_off()
    first: list[str] | None = None
    for k, (panel, name) in enumerate(zip(panels, axes_of, strict=False)):
        names = _draw(panel, [row for row in rows if row["map"] == name])
        first = first or names
        if names != first:
            panel.yaxis.tick_right()
            panel.tick_params(length=0)
        elif k % COLUMNS:
            panel.set_yticklabels([])
        panel.set_xlabel(name, fontsize=9)
    keys = [Patch(color=colour, label=state) for state, colour in COLOURS.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    figure.suptitle(f"{TITLE}\n{summary}", fontsize=11)
    return figure


def _draw(axes: Any, rows: list[dict[str, Any]]) -> list[str]:
    from matplotlib.patches import Rectangle

    values = list(dict.fromkeys(row["value"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    pairs = dict.fromkeys((row["method"], row["ball"]) for row in rows)
    names = sorted(pairs, key=lambda pair: methods.index(pair[0]))
    # the methods stand apart
    heights = [k + 0.4 * methods.index(method) for k, (method, _) in enumerate(names)]
    for row in rows:
        left = values.index(row["value"]) - 0.5
        top = heights[names.index((row["method"], row["ball"]))] - 0.5
        colour = COLOURS[row["state"]]
        axes.add_patch(Rectangle((left, top), 1, 1, facecolor=colour, edgecolor="white"))
        if row["unsaid"]:
            middle = left + 0.5, top + 0.5
            axes.annotate(
                row["unsaid"], middle, ha="center", va="center", fontsize=7, color="white"
            )
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_ylim(heights[-1] + 0.5, -0.5)
    axes.set_xticks(range(len(values)), [f"{value:g}" for value in values])
    labels = [f"{method}: {ball}" for method, ball in names]
    axes.set_yticks(heights, labels)
    axes.tick_params(length=0, labelsize=7.5)
    axes.spines[:].set_visible(False)
    return labels
