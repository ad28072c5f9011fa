"""How charts and maps look: cells and their states, axes of errors over times, words at points."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise, product
from pathlib import Path
from typing import Any, Self

import numpy as np

from virtual_lab.output.tables import table_text

Row = dict[str, Any]


class CellState(StrEnum):
    """Result in a cell of a map: words, letter in a terminal, colour in a picture."""

    mark: str
    colour: str

    def __new__(cls, words: str, mark: str = "", colour: str = "") -> Self:
        state = str.__new__(cls, words)
        state._value_, state.mark, state.colour = words, mark, colour
        return state


class State(CellState):
    """Result in a cell where steps are tried."""

    GOOD = "good", ".", "#6baed6"
    NOTICED = "inaccurate, and the pass doubts it", "?", "#fee391"
    INACCURATE = "inaccurate", "o", "#f16913"
    UNSTABLE = "unstable", "X", "#800026"
    NO_RESULT = "no result is given", "-", "#d9d9d9"


def _maps(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each map, under the method where there are several."""
    maps: dict[str, list[Row]] = {}
    for row in rows:
        name = f"{row['method']}: {row['map']}" if "method" in row else row["map"]
        maps.setdefault(name, []).append(row)
    return maps


def _states(rows: Sequence[Row]) -> list[State]:
    return [state for state in State if any(row["state"] == state for row in rows)]


def _short(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.0e}".replace("e-0", "e-") if 0 < value < 0.05 else f"{value:g}"


def maps_text(rows: Sequence[Row], down: str) -> str:
    """Return a table a map for a terminal, the states by their marks.

    A row is a cell: its `map`, its `value` and its `step`, its `state`, whether it is `refused`.
    """
    key = ", ".join(f"{state.mark} {state}" for state in _states(rows))
    parts = [f"down, {down}; {key}; in brackets refused, and what it would be"]
    for name, own in _maps(rows).items():
        table: dict[str, Row] = {}
        for row in own:
            mark = State(row["state"]).mark
            line = table.setdefault(_short(row["step"]), {"step": _short(row["step"])})
            line[_short(row["value"])] = f"({mark})" if row["refused"] else mark
        parts.append(f"{name}\n{table_text(list(table.values()))}")
    return "\n\n".join(parts)


def draw_stability(
    rows: Sequence[Row], path: Path, *, title: str, down: str, framed: float | str | None = None
) -> None:
    """Draw the maps of rows as `maps_text` takes them, five abreast, the step `framed` in a frame.

    A cell shows how many of its scenes are `off`, where its row says so.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    maps = _maps(rows)
    lines = -(-len(maps) // 5)
    figure = Figure(figsize=(17, 3.6 * lines + 0.6), dpi=110, layout="constrained")
    panels = figure.subplots(lines, 5, squeeze=False).ravel()
    for axes, (name, own) in zip(panels, maps.items(), strict=False):
        _draw_map(axes, own, framed)
        axes.set_xlabel(name, fontsize=9)
        axes.set_ylabel(down, fontsize=9)
    for axes in panels[len(maps) :]:
        axes.set_axis_off()
    keys = [Patch(color=state.colour, label=state) for state in _states(rows)]
    keys.append(Patch(fill=False, hatch="//", edgecolor="0.5", label="refused"))
    figure.legend(handles=keys, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)


def _draw_map(axes: Any, rows: list[Row], framed: float | str | None) -> None:
    from matplotlib.patches import Rectangle

    values = list(dict.fromkeys(row["value"] for row in rows))
    steps = list(dict.fromkeys(row["step"] for row in rows))
    for row in rows:
        x, y, state = values.index(row["value"]), steps.index(row["step"]), State(row["state"])
        look: dict[str, Any] = {"edgecolor": "white", "linewidth": 1.0}
        if row["refused"]:
            look = {"hatch": "//", "edgecolor": "0.6", "linewidth": 0.0}
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=state.colour, **look))
        if row.get("off"):
            ink = "white" if state is State.UNSTABLE else "black"
            place = {"ha": "center", "va": "center", "fontsize": 6.5, "color": ink}
            axes.annotate(row["off"], (x, y), **place)
    if framed in steps:
        corner = (-0.5, steps.index(framed) - 0.5)
        axes.add_patch(Rectangle(corner, len(values), 1, fill=False, linewidth=2, clip_on=False))
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_ylim(len(steps) - 0.5, -0.5)
    heads = [_short(value).replace(" ", "\n", 1) for value in values]
    axes.set_xticks(range(len(values)), heads)
    axes.set_yticks(range(len(steps)), [_short(step) for step in steps])
    axes.tick_params(length=0, labelsize=7.5)
    axes.spines[:].set_visible(False)


def error_axes(axes: Any, error: str) -> None:
    """Lay out axes of an error over the time of a shot."""
    axes.set(xscale="log", yscale="log", xlabel="time per shot, one core [µs]", ylabel=error)
    axes.grid(True, which="major", linewidth=0.3)


def label_points(axes: Any, points: Sequence[tuple[float, float, str, str]]) -> None:
    """Write words at points (x, y, words, colour) where they cover no mark, line or word.

    The figure must have been drawn once, which settles where everything is.
    """
    from matplotlib.transforms import Bbox

    renderer = axes.figure.canvas.get_renderer()
    pixels = axes.transData.transform([point[:2] for point in points])
    taken = [Bbox.from_bounds(x - 10, y - 10, 20, 20) for x, y in pixels]
    taken += [text.get_window_extent(renderer) for text in axes.texts]
    for line in axes.lines:
        if line.get_linewidth():
            corners = line.get_transform().transform(line.get_xydata())
            for start, end in pairwise(corners):  # in boxes closer than a word is long
                way = start + np.linspace(0.0, 1.0, 60)[:, None] * (end - start)
                taken += [Bbox.from_bounds(x - 1, y - 1, 2, 2) for x, y in way]
    left, right = axes.get_window_extent(renderer).intervalx
    for x, y, words, colour in points:
        tried: list[tuple[int, int, Any]] = []
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
            hidden = box.count_overlaps(taken) + (not left < box.x0 < box.x1 < right)
            tried.append((hidden, len(tried), label))
        *others, (_, _, best) = sorted(tried, reverse=True)
        for _, _, label in others:
            label.remove()
        taken.append(best.get_window_extent(renderer))
