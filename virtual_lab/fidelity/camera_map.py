"""The picture of where the ways of locating a ball hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from virtual_lab.fidelity.drawing import CellState

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Seen(CellState):
    """Result of the pictures of a cell."""

    GOOD = "good", ".", "#6baed6"
    INACCURATE = "inaccurate, and says so", "o", "#fee391"
    FLAGGED = "flagged", "F", "#f16913"
    LOST = "lost", "-", "#bdbdbd"
    UNSAID = "wrong, unsaid", "X", "#800026"


def draw_maps(rows: list[dict[str, Any]], summary: str, *, abreast: int = 4) -> Figure:
    """Return the figure of rows as `camera_stability.camera_cells` gives them."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    axes_of = list(dict.fromkeys(row["map"] for row in rows))
    lines = -(-len(axes_of) // abreast)
    figure = Figure(figsize=(16, 3.1 * lines + 1), dpi=120, layout="constrained")
    panels = figure.subplots(lines, abreast, squeeze=False).ravel()
    for panel in panels[len(axes_of) :]:
        panel.set_axis_off()
    first: list[str] | None = None
    for k, (panel, name) in enumerate(zip(panels, axes_of, strict=False)):
        names = _draw(panel, [row for row in rows if row["map"] == name])
        first = first or names
        if names != first:
            panel.yaxis.tick_right()
            panel.tick_params(length=0)
        elif k % abreast:
            panel.set_yticklabels([])
        panel.set_xlabel(name, fontsize=9)
    keys = [Patch(color=state.colour, label=state) for state in Seen]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    figure.suptitle(
        "Locating the ball: result of each picture; numbers: pictures of a cell wrong and "
        f"unsaid\n{summary}",
        fontsize=11,
    )
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
        colour = Seen(row["state"]).colour
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
