"""Control charts as PNG: daily values, limits, and the first alarm of each chart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import page_figure
from virtual_lab.studies.control_charts import (
    CUSUM_LIMIT,
    EWMA_LIMIT,
    RANGE_LIMIT,
    RULES,
    DayCharts,
)
from virtual_lab.units import Array, Mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure

LIMIT = {"color": "black", "linestyle": "--", "linewidth": 0.7}
FIRST = "#d55e00"


def draw_control_chart(values: Array, charted: DayCharts, label: str) -> PageFigure:
    """Draw four panels: daily values, moving range, moving average, and cumulative sums.

    Days with an alarm are marked. The first panel shows all days. The others show only the days
    after the baseline, in standard deviations.

    Parameters
    ----------
    values
        Values of all days in any unit, the baseline first, (day,).
    charted
        The charts of the days after the baseline.
    label
        Axis label of the values.
    """
    base, first = charted.baseline, charted.baseline_days
    days = np.arange(1, values.size + 1)
    later = days[first:]
    words = [run.words for run in RULES.values()]
    shewhart = [flags for name, flags in charted.alarms.items() if name in words]
    with page_figure(8.0, 7.2) as figure:
        panels = figure.subplots(4, 1, sharex=True, height_ratios=(3, 2, 2, 2))
        panels[0].plot(days, values, ".-", color="black", linewidth=0.6)
        for side, dash in zip(range(-3, 4), ("--", ":", ":", "-", ":", ":", "--"), strict=True):
            at = base.centre + side * base.sigma
            panels[0].axhline(at, color="black", linewidth=0.6, linestyle=dash)
        every = np.logical_or.reduce(shewhart) if shewhart else np.zeros(later.size, dtype=bool)
        _mark(panels[0], later, values[first:], every)
        panels[0].set_ylabel(label)
        panels[0].set_title(f"individual values, limits of {first} days: 1, 2 and 3 σ")
        panels[1].plot(later, charted.ranges, ".-", color="black", linewidth=0.6)
        panels[1].axhline(RANGE_LIMIT, **LIMIT)
        _mark(panels[1], later, charted.ranges, charted.alarms["moving range"])
        panels[1].set_title("moving range, σ")
        panels[2].plot(later, charted.average, ".-", color="black", linewidth=0.6)
        for limit in (EWMA_LIMIT, -EWMA_LIMIT):
            panels[2].axhline(limit, **LIMIT)
        _mark(panels[2], later, charted.average, charted.alarms["moving average (EWMA)"])
        _keep_in_sight(panels[2], EWMA_LIMIT, charted.average.min(), charted.average.max())
        panels[2].set_title("exponentially weighted moving average, σ")
        for sums, side in ((charted.sum_up, 1), (charted.sum_down, -1)):
            panels[3].plot(later, side * sums, ".-", color="black", linewidth=0.6)
            panels[3].axhline(side * CUSUM_LIMIT, **LIMIT)
        down = charted.sum_down > charted.sum_up
        worse = np.where(down, -charted.sum_down, charted.sum_up)
        _mark(panels[3], later, worse, charted.alarms["cumulative sum (CUSUM)"])
        _keep_in_sight(panels[3], CUSUM_LIMIT, -charted.sum_down.max(), charted.sum_up.max())
        panels[3].set_title("cumulative sums up and down, σ")
        for axes in panels:
            axes.axvspan(0.5, first + 0.5, facecolor="0.93", edgecolor="none", zorder=0)
        panels[3].set(xlabel="day", xlim=(0.5, values.size + 0.5))
    return figure


def _mark(axes: Axes, days: NDArray[np.int_], values: Array, alarms: Mask) -> None:
    """Mark the days with an alarm, and state the first one in the title of the panel."""
    if not alarms.any():
        axes.set_title("no alarm", loc="right")
        return
    axes.plot(days[alarms], values[alarms], "o", color=FIRST, fillstyle="none", markersize=6)
    first = days[alarms][0]
    axes.axvline(first, color=FIRST, linewidth=0.8)
    axes.set_title(f"first alarm: day {first}", loc="right", color=FIRST)


def _keep_in_sight(axes: Axes, limit: float, low: float, high: float) -> None:
    """Set the range of the axis so that the control limits stay visible beside large values."""
    edges = np.clip([1.1 * min(low, -limit), 1.1 * max(high, limit)], -5 * limit, 5 * limit)
    axes.set_ylim(*edges)
