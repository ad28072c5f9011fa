"""A figure of values with their intervals, one line per name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from virtual_lab.output.style import as_drawn, page_figure

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure


class Interval(NamedTuple):
    """A value with the limits of its interval, at the line `name`; `hollow` marks another kind."""

    name: str
    value: float
    low: float
    high: float
    hollow: bool = False


def draw_intervals(
    intervals: Sequence[Interval],
    title: str,
    label: str,
    *,
    references: Sequence[float] = (),
    words: str = "",
    hollow: str = "",
) -> PageFigure:
    """Return a figure of values with their intervals, one line per interval, the first on top.

    Parameters
    ----------
    intervals
        Values with their limits, all in one unit. Intervals with the same name have separate lines.
    title
        Title of the figure.
    label
        Label of the horizontal axis.
    references
        Values marked by dashed vertical lines; none by default.
    words
        Legend text of the dashed lines.
    hollow
        Legend text of the hollow markers, which mark the intervals with `Interval.hollow`.
    """
    with page_figure(1.2 + 0.19 * max(len(intervals), 2)) as figure:
        axes = figure.subplots()
        for number, value in enumerate(references):
            name = words if number == 0 else f"_{words}"
            axes.axvline(value, color="black", linestyle="--", linewidth=0.8, label=name)
        for place, each in enumerate(intervals):
            axes.plot((each.low, each.high), (place, place), color="black")
            fill = "white" if each.hollow else "black"
            axes.plot(each.value, place, "o", color="black", mfc=fill, markersize=4)
        if any(each.hollow for each in intervals):
            axes.plot([], [], "o", color="black", mfc="white", markersize=4, label=hollow)
        axes.set_yticks(range(len(intervals)), [as_drawn(each.name) for each in intervals])
        axes.set(title=as_drawn(title), xlabel=label, ylim=(len(intervals) - 0.4, -0.6))
        if axes.get_legend_handles_labels()[0]:
            figure.legend(loc="outside lower center", ncols=2)
    return figure
