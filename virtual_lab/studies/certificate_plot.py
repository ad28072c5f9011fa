"""Figure of the metric of each hit, with result, interval and limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.measurement.procedure import curve_of
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.style import INTERVAL_GREY, PAGE_WIDTH_IN, STYLE, as_drawn
from virtual_lab.units import INCH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from virtual_lab.measurement.certification import Certification


def plot_hits(found: Certification, statement: str) -> Figure:
    """Return the figure against shot number or, for a scan, against place with the fitted curve.

    The `statement` of the certificate is printed below the figure.

    Hits of the result are filled discs, other valid ones open, rejected shots crosses; shots
    count from 0, as on the certificate.
    """
    from matplotlib import style
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    printed, procedure = METRICS[found.procedure.metric], found.procedure
    values, place = found.shot_metric / printed.unit_si, found.readings.place / INCH
    across = np.arange(values.size) if procedure.scan is None else place
    valid, used = found.judgement.valid, found.outcome.used
    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(PAGE_WIDTH_IN, 2.6), dpi=150, layout="constrained")
        axes = figure.add_subplot()
        for kind, marker, color, fill, label in (
            (valid & used, "o", "black", "black", "in the result"),
            (
                valid & ~used,
                "o",
                "black",
                "white",
                "other valid hits" if used.any() else "valid hits",
            ),
            (~valid, "x", "0.5", "0.5", "rejected shots"),
        ):
            if kind.any():
                axes.plot(across[kind], values[kind], marker, color=color, mfc=fill, label=label)
        if found.metric:
            low, high = (end / printed.unit_si for end in found.metric.interval_95)
            value = found.metric.value / printed.unit_si
            axes.axhspan(low, high, color=INTERVAL_GREY, zorder=0, label="95 % interval")
            axes.axhline(value, color="black", linewidth=0.8, label="result")
        curve = curve_of(procedure, found.readings.place, used, values) if found.metric else None
        if curve is not None:
            along, heights = curve.linspace()
            axes.plot(along / INCH, heights, color="black", linestyle=":", label="fitted curve")
            axes.plot(
                found.outcome.place / INCH, value, "+", color="black", label="place of the result"
            )
        if procedure.metric_limit is not None:
            limit = procedure.metric_limit / printed.unit_si
            axes.axhline(limit, color="black", linestyle="--", linewidth=0.8, label="limit")
        unit = f", {printed.unit}" if printed.unit else ""
        x_label = "shot" if procedure.scan is None else "place from the tip, in"
        axes.set(xlabel=x_label, ylabel=f"{printed.words}{unit}")
        if procedure.scan is None:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        tested, rules = as_drawn(found.session.bat), as_drawn(procedure.name)
        axes.set_title(f"{tested} by {rules}: {found.verdict.value}")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        figure.supxlabel(as_drawn(statement), fontsize="x-small", x=0.01, ha="left", wrap=True)
    return figure
