"""Positions and labels read from a figure of intervals, to compare with the rows of a result."""

from __future__ import annotations

from matplotlib.figure import Figure

__all__ = ["lines_of"]


def lines_of(figure: Figure) -> list[tuple[float, float, float]]:
    """Return low end, value and high end of each line, from top to bottom."""
    lines = [each for each in figure.axes[0].lines if len(each.get_xdata())]
    bars = [each for each in lines if len(each.get_xdata()) == 2 and each.get_linestyle() == "-"]
    dots = {each.get_ydata()[0]: each.get_xdata()[0] for each in lines if each.get_marker() == "o"}
    return [
        (low, dots[place], high) for each in bars for (low, high), (place, _) in [each.get_data()]
    ]
