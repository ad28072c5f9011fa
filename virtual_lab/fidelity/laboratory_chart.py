"""Chart of the whole test: effect of each model on the metric, against its run time.

The chart is drawn from ``data/uncertainty/laboratory.csv``, which a command of the benchmarks
writes (CONTRIBUTING.md).
"""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING, Any

from virtual_lab.catalog.reading import DATA
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.ladder import SHARE

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]
LEAST = 1e-4  # smallest drawn effect [u]; smaller effects are drawn at this value
CLOSE = 3  # ratio of times below which labels are placed on opposite sides
EXPLAINED = {  # reason why a part does not use the fastest model with an effect below u / 10
    "camera": "a single test films the windows that it tracks, because the clip is the record",
    "uncertainty": "with few hits the interval by Monte Carlo is longer; that by first order has "
    "the stated coverage",
}
SIZES = ("effect", "se", "rms", "ms")


def laboratory_chart(_progress: Progress = quiet) -> SpeedChart:
    """Return a chart of the effect of each model on the metric of a test, against computing time.

    A test has several parts, such as the camera. Each part can be computed by several models. There
    is one row per model of a part. A row states:

    * the effect of the model on the metric, relative to the most accurate model of the part;
    * the standard error of this effect;
    * the computing time [ms], per shot for the camera, and per certificate for the other parts.

    Effect and standard error are divided by the standard uncertainty u of the metric. Two parts
    have another quantity instead of the metric. For the camera it is the collision efficiency e_A
    of one filmed shot. For the uncertainty it is half the length of the uncertainty interval.

    The rows come from a stored table. Nothing is simulated.
    """
    text = (DATA / "uncertainty" / "laboratory.csv").read_text("utf-8")
    rows: list[Row] = []
    for line in csv.DictReader(text.splitlines()):
        shipped, many = bool(int(line["shipped"])), int(line["laboratories"])
        row = {"part": line["part"], "rung": line["rung"], "shipped": shipped}
        rows.append(row | {"laboratories": many} | {key: float(line[key]) for key in SIZES})
    explanations = "; ".join(f"{part}: {why}" for part, why in EXPLAINED.items())
    return SpeedChart(
        name="laboratory",
        title="The whole test: effect of each model on the metric against its time",
        words="r161 by astm-f1881. Effect: mean over laboratories of the metric minus that by the "
        "finest model of the part, over u, with its standard error. For the uncertainty: half the "
        "length of the interval. For the camera: e_A of one filmed shot over its u. Gray: effects "
        f"below a tenth of u. Filled circles: models for studies of many laboratories; a single "
        f"certificate stores every edge and count, because they are its records. {explanations}.",
        rows=rows,
        figure=draw_laboratory,
    )


def draw_laboratory(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the effects of models on the metric, with one panel per part of the test.

    Each point is one model. The horizontal axis is the computing time of the model [ms], per shot
    for the camera, and per certificate for the other parts. The vertical axis is the absolute
    effect of the model on the metric, divided by the standard uncertainty of the metric.

    `rows` are the rows of `laboratory_chart`, which defines the effect. `title` is the title of the
    figure.
    """
    from virtual_lab.output.page_figure import PageFigure

    figure = PageFigure(figsize=(11.5, 6.4), dpi=150, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    parts = list(dict.fromkeys(row["part"] for row in rows))
    for axes, part in zip(panels, parts, strict=True):
        axes.axhspan(LEAST, SHARE, color="0.93", linewidth=0)
        part_rows = [row for row in rows if row["part"] == part]
        finest, part_rows = part_rows[-1], sorted(part_rows, key=lambda row: row["ms"])
        for at, row in enumerate(part_rows):
            size, time = max(abs(row["effect"]), LEAST), row["ms"]
            far = abs(row["effect"]) + 2 * row["se"]
            axes.plot([time, time], [LEAST, max(far, LEAST)], color="0.6", linewidth=1)
            look = {"markersize": 8, "markerfacecolor": "black" if row["shipped"] else "white"}
            axes.plot(time, size, "o", color="black", zorder=3, **look)
            words = row["rung"] if row is not finest else f"{row['rung']}\n(reference)"
            before, after = (
                part_rows[k]["ms"] if 0 <= k < len(part_rows) else 0 for k in (at - 1, at + 1)
            )
            side, shift = "center", (0, 9)
            if time > before > time / CLOSE:
                side, shift = "left", (8, -3)
            elif time < after < time * CLOSE:
                side, shift = "right", (-8, -3)
            look = {"textcoords": "offset points", "ha": side, "fontsize": 8}
            axes.annotate(words, (time, size), shift, **look)
        axes.set(xscale="log", yscale="log", xlim=(0.005, 2e5), ylim=(LEAST / 1.5, 60))
        unit = "shot" if part == "camera" else "certificate"
        axes.set_xlabel(f"time per {unit}, one core [ms]")
        axes.set_title(f"{part}, {min(row['laboratories'] for row in part_rows)} laboratories")
        axes.grid(True, which="major", linewidth=0.3)
    for axes in panels[::3]:
        axes.set_ylabel("effect on the metric, over u")
    figure.suptitle(f"{title}\nlines: effect plus two standard errors", fontsize=11)
    return figure
