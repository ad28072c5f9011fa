"""Figure of the metric of each hit, with result, interval and limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.measurement.procedure import curve_of
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import with_axis_unit
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.units import INCH

if TYPE_CHECKING:
    from virtual_lab.measurement.certification import Certification
    from virtual_lab.output.page_figure import PageFigure


def plot_hits(certification: Certification, statement: str) -> PageFigure:
    """Return a figure of the metric of each shot, in its printed unit.

    The horizontal axis is the number of the shot, counted from 1. For a scan it is the impact
    position [in from the tip], and the fitted curve is drawn. Filled circles are the hits that are
    used in the result, open circles are other valid hits, and crosses are rejected shots. The
    result and the limit are lines, and the 95 % interval is a band. Without a result only the limit
    is drawn. The `statement` of the certificate is printed below the figure.
    """
    from matplotlib.ticker import MaxNLocator

    printed, procedure = METRICS[certification.procedure.metric], certification.procedure
    values = printed.in_unit(certification.shot_metric)
    place = certification.readings.position / INCH
    across = 1 + np.arange(values.size) if procedure.scan is None else place
    valid, in_result = certification.judgement.valid, certification.hit_weights.used
    with page_figure(2.6) as figure:
        axes = figure.add_subplot()
        for kind, marker, color, fill, label in (
            (valid & in_result, "o", "black", "black", "in the result"),
            (
                valid & ~in_result,
                "o",
                "black",
                "white",
                "other valid hits" if in_result.any() else "valid hits",
            ),
            (~valid, "x", "0.5", "0.5", "rejected shots"),
        ):
            if kind.any():
                axes.plot(across[kind], values[kind], marker, color=color, mfc=fill, label=label)
        if certification.metric:
            ends = map(printed.in_unit, certification.metric.interval_95)
            value = printed.in_unit(certification.metric.value)
            axes.axhspan(*ends, color=INTERVAL_GREY, zorder=0, label="95 % interval of the result")
            axes.axhline(value, color="black", linewidth=0.8, label="result")
        curve = (
            curve_of(procedure, certification.readings.position, in_result, values)
            if certification.metric
            else None
        )
        if curve is not None:
            along, heights = curve.linspace()
            axes.plot(along / INCH, heights, color="black", linestyle=":", label="fitted curve")
            axes.plot(
                certification.hit_weights.position / INCH,
                value,
                "+",
                color="black",
                label="impact position of the result",
            )
        if procedure.metric_limit is not None:
            limit = printed.in_unit(procedure.metric_limit)
            axes.axhline(limit, color="black", linestyle="--", linewidth=0.8, label="limit")
        x_label = "shot" if procedure.scan is None else "impact position from the tip, in"
        axes.set(xlabel=x_label, ylabel=with_axis_unit(printed.words, printed.unit))
        if procedure.scan is None:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        tested, rules = as_drawn(certification.session.bat), as_drawn(procedure.name)
        axes.set_title(f"{tested} by {rules}: {certification.verdict.value}")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        figure.supxlabel(as_drawn(statement), fontsize="x-small", x=0.01, ha="left", wrap=True)
    return figure
