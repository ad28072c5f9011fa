"""Drawing of maps with colored cells, of axes of error against time, and of labels of points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from virtual_lab.output.tables import table_text

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]


class CellState(StrEnum):
    """State of a cell in a map: description, letter for text, color for a figure."""

    mark: str
    colour: str

    def __new__(cls, words: str, mark: str = "", colour: str = "") -> Self:
        state = str.__new__(cls, words)
        state._value_, state.mark, state.colour = words, mark, colour
        return state


class State(CellState):
    """State of a cell in a map of integration steps."""

    GOOD = "good", ".", "#6baed6"
    NOTICED = "inaccurate, detected", "?", "#fee391"
    INACCURATE = "inaccurate", "o", "#f16913"
    UNSTABLE = "unstable", "X", "#800026"
    NO_RESULT = "no result", "-", "#d9d9d9"


class PictureState(CellState):
    """State of a cell in a map of pictures."""

    GOOD = "good", ".", "#6baed6"
    INACCURATE = "inaccurate within the stated u", "o", "#fee391"
    FLAGGED = "flagged", "F", "#f16913"
    LOST = "lost", "-", "#bdbdbd"
    UNSAID = "wrong without a flag", "X", "#800026"


def _line_of(row: Row) -> str:
    return _short(row["step"])


def _maps(rows: Sequence[Row]) -> dict[str, list[Row]]:
    maps: dict[str, list[Row]] = {}
    for row in rows:
        maps.setdefault(row["map"], []).append(row)
    return maps


def _used_states(states: type[CellState], rows: Sequence[Row]) -> list[CellState]:
    return [state for state in states if any(row["state"] == state for row in rows)]


def _short(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.0e}".replace("e-0", "e-") if 0 < value < 0.05 else f"{value:g}"


def maps_text(rows: Sequence[Row], states: type[CellState], down: Sequence[str]) -> str:
    """Return the maps as text: one table per map, with one letter per cell for its state.

    The first line states the meaning of the letters. Each element of `rows` is a cell with the keys
    `map`, `value` (column of the table), `state`, a value of `states`, those in `down`, which
    together name the row of the table, and perhaps `refused`. If `refused` is true, the program
    rejects the settings of the cell; the letter is then in parentheses.
    """
    parts = [", ".join(f"{state.mark} {state}" for state in _used_states(states, rows))]
    if any(row.get("refused") for row in rows):
        parts[0] += "; in parentheses: refused, with its state"
    for name, map_rows in _maps(rows).items():
        table: dict[tuple[str, ...], Row] = {}
        for row in map_rows:
            mark = states(row["state"]).mark
            labels = {key: _short(row[key]) for key in down}
            line = table.setdefault(tuple(labels.values()), labels)
            line[_short(row["value"])] = f"({mark})" if row.get("refused") else mark
        parts.append(f"{name}\n{table_text(list(table.values()))}")
    return "\n\n".join(parts)


def draw_maps(
    rows: Sequence[Row],
    *,
    title: str,
    states: type[CellState],
    line_of: Callable[[Row], str] = _line_of,
    down: str = "",
    abreast: int = 5,
    framed: str | None = None,
) -> PageFigure:
    """Return a figure of maps. A map is a grid of cells, colored by state.

    The number in a cell is the number of collisions with a large error (key `off`). In maps of
    pictures, it is the number of wrong pictures without a flag (key `unsaid`). No number is printed
    if it is 0 or missing. A cell with a true value of the key `refused` is hatched.

    Parameters
    ----------
    rows
        Cells of all maps, one dictionary per cell. The key `map` is the name of the cell's map, and
        `value` is the label of its column in the map. The key `state` is its state.
    title
        Title of the figure.
    states
        Enumeration of the states.
    line_of
        Function of a cell that returns the label of its row in the map. By default it is the value
        of the key `step`.
    down
        Label of the y axis.
    abreast
        Number of maps side by side in the figure.
    framed
        Label of the row of cells that gets a frame; by default no row has one.
    """
    from matplotlib.patches import Patch

    from virtual_lab.output.page_figure import PageFigure

    maps = _maps(rows)
    high = -(-len(maps) // abreast)
    figure = PageFigure(figsize=(17, 3.6 * high + 0.6), dpi=110, layout="constrained")
    panels = figure.subplots(high, abreast, squeeze=False).ravel()
    shared_labels: list[str] = []  # tick labels that maps to the right share
    for k, (axes, (name, map_rows)) in enumerate(zip(panels, maps.items(), strict=False)):
        labels = _draw_map(axes, map_rows, states, line_of, framed)
        axes.set_xlabel(name, fontsize=9)
        if k % abreast and labels == shared_labels:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel(down, fontsize=9)
            shared_labels = labels
    for axes in panels[len(maps) :]:
        axes.set_axis_off()
    keys = [Patch(color=state.colour, label=state) for state in _used_states(states, rows)]
    if any("refused" in row for row in rows):
        keys.append(Patch(fill=False, hatch="//", edgecolor="0.5", label="refused"))
    figure.legend(handles=keys, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_map(
    axes: Any,
    rows: list[Row],
    states: type[CellState],
    line_of: Callable[[Row], str],
    framed: str | None,
) -> list[str]:
    """Draw one map. Return the labels of its lines."""
    from matplotlib.patches import Rectangle

    values = list(dict.fromkeys(row["value"] for row in rows))
    lines = list(dict.fromkeys(map(line_of, rows)))
    for row in rows:
        x, y = values.index(row["value"]), lines.index(line_of(row))
        look: dict[str, Any] = {"edgecolor": "white", "linewidth": 1.0}
        if row.get("refused"):
            look = {"hatch": "//", "edgecolor": "0.6", "linewidth": 0.0}
        colour = states(row["state"]).colour
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, **look))
        count = row.get("off") or row.get("unsaid")
        if count:
            ink = "white" if colour == State.UNSTABLE.colour else "black"
            axes.annotate(count, (x, y), ha="center", va="center", fontsize=6.5, color=ink)
    if framed in lines:
        corner = (-0.5, lines.index(framed) - 0.5)
        axes.add_patch(Rectangle(corner, len(values), 1, fill=False, linewidth=2, clip_on=False))
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_ylim(len(lines) - 0.5, -0.5)
    heads = [_short(value).replace(" ", "\n", 1) for value in values]
    axes.set_xticks(range(len(values)), heads)
    axes.set_yticks(range(len(lines)), lines)
    axes.tick_params(length=0, labelsize=7.5)
    axes.spines[:].set_visible(False)
    return lines


def error_axes(axes: Any, error: str) -> None:
    """Set logarithmic axes. x is the time per shot [µs], and `error` is the label of y."""
    axes.set(xscale="log", yscale="log", xlabel="time per shot, one core [µs]", ylabel=error)
    axes.grid(True, which="major", linewidth=0.3)


def label_points(axes: Any, points: Sequence[tuple[float, float, str, str]]) -> None:
    """Write a label beside each point, if possible without overlaps.

    A point is (x, y, label, color), with x and y in the units of the axes. The figure must have
    been drawn once before the call, because drawing fixes the layout.
    """
    from matplotlib.transforms import Bbox

    renderer = axes.figure.canvas.get_renderer()
    pixels = axes.transData.transform([point[:2] for point in points])
    occupied = [Bbox.from_bounds(x - 10, y - 10, 20, 20) for x, y in pixels]
    occupied += [text.get_window_extent(renderer) for text in axes.texts]
    for line in axes.lines:
        if line.get_linewidth():
            corners = line.get_transform().transform(line.get_xydata())
            for start, end in pairwise(corners):  # boxes along the line
                positions = start + np.linspace(0.0, 1.0, 60)[:, None] * (end - start)
                occupied += [Bbox.from_bounds(x - 1, y - 1, 2, 2) for x, y in positions]
    left, right = axes.get_window_extent(renderer).intervalx
    for x, y, words, colour in points:
        candidates: list[tuple[int, int, Any]] = []
        for up, side in product((0, 7, -7, 15, -15), ("left", "right")):
            label = axes.annotate(
                words,
                (x, y),
                xytext=(8 if side == "left" else -8, up),
                textcoords="offset points",
                ha=side,
                va="center",
                fontsize=6.5,
                color=colour,
            )
            box = label.get_window_extent(renderer)
            hidden = box.count_overlaps(occupied) + (not left < box.x0 < box.x1 < right)
            candidates.append((hidden, len(candidates), label))
        *rejected, (_, _, best) = sorted(candidates, reverse=True)
        for _, _, label in rejected:
            label.remove()
        occupied.append(best.get_window_extent(renderer))
