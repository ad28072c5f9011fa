"""Figure of the metric of each hit, with result, interval and limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.output.metrics import METRICS
from virtual_lab.output.style import INTERVAL_GREY, PAGE_WIDTH_IN, STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from virtual_lab.measurement.certification import Certification


def plot_hits(found: Certification) -> Figure:
    """Return the figure over the shot number: valid hits filled, rejected hits open."""
    from matplotlib import style
    from matplotlib.figure import Figure

    printed = METRICS[found.procedure.metric]
    values = found.shot_metric / printed.unit_si
    shots, valid = np.arange(1, values.size + 1), found.judgement.valid
    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(PAGE_WIDTH_IN, 2.6), dpi=150, layout="constrained")
        axes = figure.add_subplot()
        axes.plot(shots[valid], values[valid], "o", color="black", label="valid hits")
        axes.plot(shots[~valid], values[~valid], "x", color="0.5", label="rejected shots")
        if found.metric:
            low, high = (end / printed.unit_si for end in found.metric.interval_95)
            value = found.metric.value / printed.unit_si
            axes.axhspan(low, high, color=INTERVAL_GREY, zorder=0, label="95 % interval")
            axes.axhline(value, color="black", linewidth=0.8, label="result")
        if found.procedure.metric_limit is not None:
            limit = found.procedure.metric_limit / printed.unit_si
            axes.axhline(limit, color="black", linestyle="--", linewidth=0.8, label="limit")
        unit = f", {printed.unit}" if printed.unit else ""
        axes.set(xlabel="shot", ylabel=f"{printed.words}{unit}")
        axes.set_title(f"{found.session.bat} by {found.procedure.name}: {found.verdict.value}")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure
